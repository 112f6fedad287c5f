// What the page uses of Preact; written here.
export function h(type: unknown, props: object | null, ...children: unknown[]): unknown;
export function render(node: unknown, parent: Element): void;
