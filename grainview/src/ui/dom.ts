// Creation of elements, and helpers for them.

type Attributes = Record<string, string | number | boolean | ((event: Event) => void) | undefined>;

/** Create an element. Functions become event listeners; attributes that are false or undefined are left out. */
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

/** Replace the content of an element; if a button in it has the focus, the new button at the same index gets it. */
export function replaceKeepingFocus(element: HTMLElement, content: Node[]): void {
  const buttons = (): HTMLElement[] => [...element.querySelectorAll("button")];
  const at = buttons().indexOf(document.activeElement as HTMLElement);
  element.replaceChildren(...content);
  if (at >= 0) (buttons()[at] ?? buttons().at(-1))?.focus();
}

/** Distance [pixels] between pressing and releasing above which a press is a drag and not a click. */
const DRAG = 4;

/** Call a function for clicks on an element that are no drags, with positions relative to the element [pixels]. */
export function onClick(element: HTMLElement, action: (x: number, y: number) => void): void {
  let down: [number, number] | null = null;
  element.addEventListener("pointerdown", (e) => (down = [e.clientX, e.clientY]));
  element.addEventListener("pointerup", (e) => {
    const clicked = down && Math.hypot(e.clientX - down[0], e.clientY - down[1]) < DRAG;
    const box = element.getBoundingClientRect();
    if (clicked) action(e.clientX - box.left, e.clientY - box.top);
  });
}
