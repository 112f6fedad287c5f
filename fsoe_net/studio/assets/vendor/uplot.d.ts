// What the page uses of uPlot; written here.
declare class uPlot {
  constructor(options: object, data: (number | null)[][], box: HTMLElement);
  static paths: { stepped(options: object): unknown };
  setData(data: (number | null)[][]): void;
  setSize(size: { width: number; height: number }): void;
  destroy(): void;
}
export default uPlot;
