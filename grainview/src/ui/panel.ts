// The panel of controls, generated from the table of settings.

import type { Setting, Settings } from "../state";
import { h } from "./dom";

/** The first group is always open, the others are folded until they are asked for. */
const GROUPS = ["Picture", "Colour", "Show", "Camera", "Time"];

/** Settings that controls show and change. */
export interface ControlledSettings extends Settings {
  readonly settings: Setting[];
  setting(id: string): Setting;
  onChange(listener: (id: string) => void): void;
}

export class Panel {
  readonly element = h("aside", { class: "gv-panel", "aria-label": "Settings", id: "gv-panel" });
  private readonly rows = new Map<string, HTMLElement>();

  constructor(private readonly settings: ControlledSettings) {
    for (const group of GROUPS) {
      const part = group === GROUPS[0]
        ? h("div", { role: "group", "aria-label": group, class: "gv-group" })
        : h("details", { "aria-label": group, class: "gv-group" }, h("summary", {}, group));
      for (const setting of settings.settings.filter((s) => s.group === group && s.kind !== "hidden")) {
        if (setting.kind === "choice" && !setting.options?.length) continue;
        const row = this.row(setting);
        this.rows.set(setting.id, row);
        part.append(row);
      }
      this.element.append(part);
    }
    settings.onChange((id) => this.update(id));
  }

  private row(setting: Setting): HTMLElement {
    const id = `gv-${setting.id}`;
    const title = setting.key ? `key: ${setting.key}` : undefined;
    const label = h("label", { for: id, title }, setting.label);
    const row = h("div", { class: `gv-row gv-${setting.kind}` });
    row.append(...(setting.kind === "toggle" ? [this.input(setting, id), label] : [label, this.input(setting, id)]));
    if (setting.kind === "range") row.append(h("output", { for: id }, String(this.settings.get(setting.id))));
    return row;
  }

  private input(setting: Setting, id: string): HTMLElement {
    const { settings } = this;
    if (setting.kind === "choice") {
      const options = (setting.options ?? []).map(([value, label]) => h("option", { value }, label));
      const change = (e: Event): void => settings.set(setting.id, (e.target as HTMLSelectElement).value);
      const select = h("select", { id, change }, ...options);
      select.value = settings.get<string>(setting.id);
      return select;
    }
    if (setting.kind === "toggle") {
      const change = (e: Event): void => settings.set(setting.id, (e.target as HTMLInputElement).checked);
      const box = h("input", { id, type: "checkbox", change });
      box.checked = settings.get<boolean>(setting.id);
      return box;
    }
    if (setting.kind === "number") {
      const change = (e: Event): void => {
        const text = (e.target as HTMLInputElement).value.trim();
        settings.set(setting.id, text === "" ? NaN : Number(text));
        this.update(setting.id); // removes invalid text
      };
      return h("input", { id, type: "text", inputmode: "decimal", placeholder: "auto (SI)", change });
    }
    const input = (e: Event): void => settings.set(setting.id, Number((e.target as HTMLInputElement).value));
    const slider = h("input", { id, type: "range", min: setting.from, max: setting.to, step: setting.by, input });
    slider.value = String(settings.get(setting.id));
    return slider;
  }

  /** Update the options of a choice. */
  refill(id: string): void {
    const select = this.rows.get(id)?.querySelector("select");
    const options = this.settings.setting(id).options ?? [];
    if (!select || select.options.length === options.length) return;
    select.replaceChildren(...options.map(([value, label]) => h("option", { value }, label)));
    this.update(id);
  }

  /** Show the present value of a setting. */
  update(id: string): void {
    const row = this.rows.get(id);
    if (!row) return;
    const value = this.settings.get(id);
    const input = row.querySelector("input, select") as HTMLInputElement;
    if (input.type === "checkbox") input.checked = Boolean(value);
    else input.value = Number.isNaN(value) ? "" : String(value);
    const output = row.querySelector("output");
    if (output) output.textContent = String(value);
  }

  /** Enable or disable a control. */
  enable(id: string, on: boolean): void {
    const input = this.rows.get(id)?.querySelector("input, select") as HTMLInputElement | null;
    if (input) input.disabled = !on;
  }
}
