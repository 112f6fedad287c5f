// What the page uses of htm; written here.
declare const htm: {
  bind(h: Function): (strings: TemplateStringsArray, ...values: any[]) => unknown;
};
export default htm;
