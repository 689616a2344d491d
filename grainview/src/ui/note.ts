// Messages over the canvas.

/** Shows a message to the user. */
export type Notify = (message: string) => void;

/** Milliseconds for which a brief message is shown. */
const BRIEF = 2500;

export class Note {
  constructor(private readonly element: HTMLElement) {}

  get message(): string {
    return this.element.textContent ?? "";
  }

  /** Show a message until the next one; an empty message hides the element. */
  show(message: string): void {
    this.element.textContent = message;
    this.element.hidden = !message;
  }

  showBriefly(message: string): void {
    this.show(message);
    window.setTimeout(() => this.message === message && this.show(""), BRIEF);
  }
}
