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

/** Actions that a key which is held down does not repeat. */
const ONCE = new Set(["play", "help", "picture", "movie", "quick", "link", "panel"]);

const SLIDES = /^(Arrow\w+|Home|End|PageUp|PageDown)$/;

function pressed(event: KeyboardEvent): string {
  // signs that a keyboard has on its third level come with Ctrl and Alt, or Alt, of which nothing is meant
  const third = event.key.length === 1 && (event.getModifierState("AltGraph") || (event.altKey && !event.ctrlKey));
  if (third) return event.key;
  const before = `${event.ctrlKey || event.metaKey ? "Ctrl+" : ""}${event.altKey ? "Alt+" : ""}`;
  const shift = event.shiftKey && event.key.length > 1 ? "Shift+" : "";
  return before + shift + event.key;
}

export class Keys {
  constructor(
    private readonly state: State,
    private readonly actions: Action[],
  ) {}

  /** What a key does; false if nothing. Switches do not flicker while one is `held`. */
  press(key: string, held = false): boolean {
    const action = this.actions.find((a) => a.keys.includes(key));
    if (action) {
      if (!held || !ONCE.has(action.id)) action.run();
      return true;
    }
    for (const setting of this.state.settings) {
      if (held && setting.key === key && setting.kind === "toggle") return true;
      if (setting.key === key) this.state.step(setting.id, 1);
      else if (setting.down === key) this.state.step(setting.id, -1);
      else if (setting.kind === "choice" && setting.key?.toUpperCase() === key) this.state.step(setting.id, -1);
      else continue;
      return true;
    }
    return false;
  }

  listen(element: HTMLElement | Document): void {
    element.addEventListener("keydown", (happened) => {
      const event = happened as KeyboardEvent;
      const target = event.target as HTMLElement;
      const typing = target.matches("input[type=text], select, textarea");
      const sliding = target.matches("input[type=range]") && SLIDES.test(event.key);
      const pushing = target.matches("button, input[type=checkbox]") && (event.key === " " || event.key === "Enter");
      if (target.ownerDocument.querySelector(".gv dialog[open]")) return; // Esc closes it, the rest has to wait
      if (typing || sliding || pushing || event.defaultPrevented) return;
      if (this.press(pressed(event), event.repeat)) event.preventDefault();
    });
  }

  /** The table behind “?”. */
  help(): HTMLElement {
    const told = (key: string): string => key.replace(/\b(Arrow\w+|Escape)\b|^ $/g, (name) => NAMES[name] ?? name);
    const row = (keys: string[], label: string): HTMLElement =>
      h("div", {}, h("dt", {}, ...keys.map((k) => h("kbd", {}, told(k)))), h("dd", {}, label));
    const rows = this.actions.map((a) => row(a.keys, a.label));
    for (const s of this.state.settings) {
      if (!s.key || (s.kind === "choice" && !s.options?.length)) continue;
      const back = s.kind === "choice" ? s.key.toUpperCase() : s.down; // if it means nothing else
      const free = back && !this.actions.some((a) => a.keys.includes(back));
      const other = this.state.settings.some((t) => t !== s && (t.key === back || t.down === back));
      rows.push(row(free && !other ? [s.key, back] : [s.key], s.label));
    }
    return h("dl", { class: "gv-keys" }, ...rows);
  }
}
