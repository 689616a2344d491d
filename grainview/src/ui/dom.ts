// Elements of the page, made in one line each.

type Attributes = Record<string, string | number | boolean | ((event: Event) => void) | undefined>;

/** An element; attributes that are functions listen, those that are false or undefined are left out. */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== undefined) element.setAttribute(name, String(value));
  }
  element.append(...children);
  return element;
}

export function svg(tag: string, attributes: Record<string, string | number> = {}): SVGElement {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  return element;
}

/** New content for an element; a button in it that has the focus passes it on to the one in its place. */
export function replaceKeepingFocus(element: HTMLElement, content: Node[]): void {
  const buttons = (): HTMLElement[] => [...element.querySelectorAll("button")];
  const at = buttons().indexOf(document.activeElement as HTMLElement);
  element.replaceChildren(...content);
  if (at >= 0) (buttons()[at] ?? buttons().at(-1))?.focus();
}
