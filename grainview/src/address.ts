// The settings in the address of the page: a view can be shared, and a reload restores it.

import type { Notify } from "./ui/note";

/** Settings that can be written as text. */
export interface AddressableSettings {
  toAddress(): string;
  onChange(listener: (id: string) => void): void;
}

/** Milliseconds between a change of a setting and the update of the address. */
const DELAY = 250;

export class AddressBar {
  private timer = 0;
  private written = "";

  /** @param apply called with the new text when the user edits the address */
  constructor(
    private readonly settings: AddressableSettings,
    private readonly apply: (text: string) => void,
    private readonly notify: Notify,
  ) {}

  /** Start to keep the address and the settings in step. */
  connect(): void {
    this.written = location.hash.slice(1);
    this.settings.onChange(() => {
      if (!this.timer) this.timer = window.setTimeout(() => this.write(), DELAY);
    });
    window.addEventListener("hashchange", () => {
      const text = location.hash.slice(1);
      if (text !== this.written) this.apply(text);
    });
  }

  /** Copy the address to the clipboard, if the browser allows it. */
  async copy(): Promise<void> {
    this.write();
    try {
      await navigator.clipboard.writeText(location.href);
      this.notify("The address of this view was copied to the clipboard.");
    } catch {
      this.notify("The browser does not allow this page to copy; copy the address from the address bar.");
    }
  }

  private write(): void {
    window.clearTimeout(this.timer);
    this.timer = 0;
    this.written = this.settings.toAddress();
    history.replaceState(null, "", this.written ? `#${this.written}` : location.pathname + location.search);
  }
}
