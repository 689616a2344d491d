// Everything by keyboard: actions, and the settings that have keys; the help is made of the same two tables.

import type { State } from "../state";
import { h } from "./dom";

export interface Action {
  id: string;
  label: string;
  keys: string[];
  run: () => void;
}

const NAMES: Record<string, string> = {
  " ": "space", ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓", Escape: "Esc",
};

function pressed(event: KeyboardEvent): string {
  const before = `${event.ctrlKey || event.metaKey ? "Ctrl+" : ""}${event.altKey ? "Alt+" : ""}`;
  const shift = event.shiftKey && event.key.length > 1 ? "Shift+" : "";
  return before + shift + event.key;
}

export class Keys {
  constructor(
    private readonly state: State,
    private readonly actions: Action[],
  ) {}

  /** What a key does; false if nothing. */
  press(key: string): boolean {
    const action = this.actions.find((a) => a.keys.includes(key));
    if (action) {
      action.run();
      return true;
    }
    for (const setting of this.state.settings) {
      if (setting.key === key) this.state.step(setting.id, 1);
      else if (setting.down === key) this.state.step(setting.id, -1);
      else if (setting.kind === "choice" && setting.key?.toUpperCase() === key) this.state.step(setting.id, -1);
      else continue;
      return true;
    }
    return false;
  }

  listen(element: HTMLElement): void {
    element.addEventListener("keydown", (event) => {
      const target = event.target as HTMLElement;
      const typing = target.matches("input[type=text], select, textarea");
      const sliding = target.matches("input[type=range]") && event.key.startsWith("Arrow");
      const pushing = target.matches("button, input[type=checkbox]") && (event.key === " " || event.key === "Enter");
      if (typing || sliding || pushing || event.defaultPrevented) return;
      if (this.press(pressed(event))) event.preventDefault();
    });
  }

  /** The table behind “?”. */
  help(): HTMLElement {
    const told = (key: string): string => key.replace(/\b(Arrow\w+|Escape)\b|^ $/g, (name) => NAMES[name] ?? name);
    const row = (keys: string[], label: string): HTMLElement =>
      h("div", {}, h("dt", {}, ...keys.map((k) => h("kbd", {}, told(k)))), h("dd", {}, label));
    const rows = this.actions.map((a) => row(a.keys, a.label));
    for (const s of this.state.settings) if (s.key) rows.push(row(s.down ? [s.key, s.down] : [s.key], s.label));
    return h("dl", { class: "gv-keys" }, ...rows);
  }
}
