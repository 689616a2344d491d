// Keyboard control of actions and settings; the help is generated from the same two tables.

import type { Setting } from "../state";
import { h } from "./dom";

export interface Action {
  id: string;
  label: string;
  keys: string[];
  run: () => void;
}

/** Settings that keys change. */
export interface SteppedSettings {
  readonly settings: Setting[];
  step(id: string, direction: 1 | -1): void;
}

const NAMES: Record<string, string> = {
  " ": "space", ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓", Escape: "Esc",
};

/** Actions that a held key does not repeat. */
const NO_REPEAT = new Set(["play", "help", "picture", "movie", "save-now", "link", "panel"]);

/** Keys that move the slider that has the focus. */
const SLIDER_KEYS = /^(Arrow\w+|Home|End|PageUp|PageDown)$/;

/** Help on the mouse. */
const MOUSE =
  "Drag to rotate; drag with the right button or two fingers to pan; use the wheel or pinch to zoom. Click a grain " +
  "or a contact for its values. The address of the page contains the view and can be shared or bookmarked.";

/** Name of a key with its modifiers, as in the tables. */
function keyName(event: KeyboardEvent): string {
  // characters of the third level of a keyboard are typed with AltGr or Alt, which are then no modifiers
  const thirdLevel = event.key.length === 1 && (event.getModifierState("AltGraph") || (event.altKey && !event.ctrlKey));
  if (thirdLevel) return event.key;
  const modifiers = `${event.ctrlKey || event.metaKey ? "Ctrl+" : ""}${event.altKey ? "Alt+" : ""}`;
  const shift = event.shiftKey && event.key.length > 1 ? "Shift+" : "";
  return modifiers + shift + event.key;
}

export class Keys {
  constructor(
    private readonly settings: SteppedSettings,
    private readonly actions: Action[],
  ) {}

  /** Execute a key; false if it has no effect. A held key does not repeat toggles. */
  press(key: string, held = false): boolean {
    const action = this.actions.find((a) => a.keys.includes(key));
    if (action) {
      if (!held || !NO_REPEAT.has(action.id)) action.run();
      return true;
    }
    for (const setting of this.settings.settings) {
      if (held && setting.key === key && setting.kind === "toggle") return true;
      if (setting.key === key) this.settings.step(setting.id, 1);
      else if (setting.down === key) this.settings.step(setting.id, -1);
      else if (setting.kind === "choice" && setting.key?.toUpperCase() === key) this.settings.step(setting.id, -1);
      else continue;
      return true;
    }
    return false;
  }

  listen(element: HTMLElement | Document): void {
    element.addEventListener("keydown", (e) => {
      const event = e as KeyboardEvent;
      const target = event.target as HTMLElement;
      const typing = target.matches("input[type=text], select, textarea");
      const sliding = target.matches("input[type=range]") && SLIDER_KEYS.test(event.key);
      const pressing = target.matches("button, input[type=checkbox]") && (event.key === " " || event.key === "Enter");
      if (target.ownerDocument.querySelector(".gv dialog[open]")) return; // Esc closes it, other keys have no effect
      if (typing || sliding || pressing || event.defaultPrevented) return;
      if (this.press(keyName(event), event.repeat)) event.preventDefault();
    });
  }

  /** Content of the help: usage of the mouse, and all keys. */
  help(): (Node | string)[] {
    const displayed = (key: string): string => key.replace(/\b(Arrow\w+|Escape)\b|^ $/g, (name) => NAMES[name] ?? name);
    const row = (keys: string[], label: string): HTMLElement =>
      h("div", {}, h("dt", {}, ...keys.map((k) => h("kbd", {}, displayed(k)))), h("dd", {}, label));
    const rows = this.actions.map((a) => row(a.keys, a.label));
    for (const s of this.settings.settings) {
      if (!s.key || (s.kind === "choice" && !s.options?.length)) continue;
      const reverse = s.kind === "choice" ? s.key.toUpperCase() : s.down;
      const isAction = this.actions.some((a) => reverse && a.keys.includes(reverse));
      const isSetting = this.settings.settings.some((t) => t !== s && (t.key === reverse || t.down === reverse));
      rows.push(row(reverse && !isAction && !isSetting ? [s.key, reverse] : [s.key], s.label));
    }
    return [MOUSE, h("dl", { class: "gv-keys" }, ...rows)];
  }
}
