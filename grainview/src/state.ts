// The settings: one table, from which controls, keys, help and the address are generated.

export type Value = number | boolean | string;

export interface Setting {
  id: string;
  label: string;
  group: "Picture" | "Colour" | "Show" | "Camera" | "Time" | ""; // those of Picture are never folded
  kind: "toggle" | "choice" | "range" | "number" | "hidden";
  initial: Value;
  options?: [value: string, label: string][];
  from?: number;
  to?: number;
  by?: number;
  key?: string; // toggles, increases, or selects the next option; with shift the previous option
  down?: string; // decreases (ranges)
  form?: RegExp; // allowed text
}

const SETTINGS: Setting[] = [
  { id: "colour", label: "Colour by", group: "Picture", kind: "choice", initial: "cluster", options: [], key: "c" },
  { id: "bonds", label: "Contacts", group: "Picture", kind: "choice", initial: "plain", key: "b",
    options: [["off", "hidden"], ["plain", "plain"], ["load", "by normal force"], ["mode", "by limit reached"]] },
  { id: "plot", label: "Plot", group: "Picture", kind: "choice", initial: "", options: [], key: "p" },
  { id: "palette", label: "Colour scale", group: "Colour", kind: "choice", initial: "", options: [] },
  { id: "log", label: "Logarithmic", group: "Colour", kind: "toggle", initial: false, key: "q" },
  { id: "low", label: "Minimum", group: "Colour", kind: "number", initial: NaN },
  { id: "high", label: "Maximum", group: "Colour", kind: "number", initial: NaN },
  { id: "theme", label: "Theme", group: "Colour", kind: "choice", initial: "auto", key: "d",
    options: [["auto", "system"], ["light", "light"], ["dark", "dark"]] },
  { id: "size", label: "Grain size", group: "Show", kind: "range", initial: 1, from: 0.1, to: 1.5, by: 0.05,
    key: "]", down: "[" },
  { id: "arrows", label: "Magnetic moments", group: "Show", kind: "toggle", initial: true, key: "m" },
  { id: "box", label: "Box", group: "Show", kind: "toggle", initial: true, key: "x" },
  { id: "field", label: "Axes and field", group: "Show", kind: "toggle", initial: true, key: "f" },
  { id: "whole", label: "Unwrap clusters", group: "Show", kind: "toggle", initial: true, key: "w" },
  { id: "isolate", label: "Only the selected cluster", group: "Show", kind: "toggle", initial: false, key: "i" },
  { id: "trails", label: "Trails (frames)", group: "Show", kind: "range", initial: 0, from: 0, to: 40, by: 1,
    key: "t", down: "T" },
  { id: "shade", label: "Shading and haze", group: "Show", kind: "range", initial: 0.5, from: 0, to: 1, by: 0.1,
    key: "h", down: "H" },
  { id: "bar", label: "Contact thickness", group: "Show", kind: "range", initial: 0.45, from: 0.05, to: 0.8, by: 0.05,
    key: "}", down: "{" },
  { id: "ortho", label: "Orthographic", group: "Camera", kind: "toggle", initial: false, key: "o" },
  { id: "follow", label: "Follow the selected cluster", group: "Camera", kind: "toggle", initial: false, key: "g" },
  { id: "measure", label: "Measure distances", group: "Camera", kind: "toggle", initial: false, key: "u" },
  { id: "speed", label: "Frames per second", group: "Time", kind: "range", initial: 20, from: 1, to: 60, by: 1,
    key: "+", down: "-" },
  { id: "loop", label: "Loop", group: "Time", kind: "toggle", initial: false, key: "l" },
  { id: "live", label: "Advance with the run", group: "Time", kind: "toggle", initial: true, key: "a" },
  { id: "frame", label: "Frame", group: "", kind: "hidden", initial: 0, from: 0 },
  { id: "grain", label: "Selected grain", group: "", kind: "hidden", initial: -1, from: -1 },
  // "i-j": both grains; one or two grains; ten numbers (scene/look.ts)
  { id: "contact", label: "Selected contact", group: "", kind: "hidden", initial: "", form: /^(\d+-\d+)?$/ },
  { id: "ends", label: "Measured", group: "", kind: "hidden", initial: "", form: /^(\d+(-\d+)?)?$/ },
  { id: "look", label: "Camera", group: "", kind: "hidden", initial: "", form: /^([-+.\de]+(,[-+.\de]+){9})?$/ },
];

const equal = (a: Value, b: Value): boolean => a === b || (Number.isNaN(a) && Number.isNaN(b));

/** Read access to the values of settings. */
export interface SettingValues {
  get<T extends Value>(id: string): T;
  number(id: string): number;
}

/** Read and write access to the values of settings. */
export interface Settings extends SettingValues {
  /** Set a value, limited to the allowed range; invalid values are ignored. */
  set(id: string, value: Value): void;
}

/** Values of all settings; listeners are called with the name of each setting that changes. */
export class State implements Settings {
  readonly settings: Setting[] = SETTINGS.map((setting) => ({ ...setting }));
  private readonly values = new Map<string, Value>(this.settings.map((s) => [s.id, s.initial]));
  private readonly listeners: ((id: string) => void)[] = [];

  setting(id: string): Setting {
    const found = this.settings.find((s) => s.id === id);
    if (!found) throw new Error(`there is no setting “${id}”`);
    return found;
  }

  /** Set the options of a choice, which depend on the data; the first one becomes the initial value. */
  offer(id: string, options: [value: string, label: string][]): void {
    const setting = this.setting(id);
    setting.options = options;
    if (options.some(([value]) => value === setting.initial)) return;
    setting.initial = options[0]?.[0] ?? "";
    this.values.set(id, setting.initial);
  }

  get<T extends Value>(id: string): T {
    return this.values.get(id) as T;
  }

  number(id: string): number {
    return this.values.get(id) as number;
  }

  set(id: string, value: Value): void {
    const setting = this.setting(id);
    const valid = validated(setting, value);
    if (valid === undefined || equal(valid, this.values.get(id) as Value)) return;
    this.values.set(id, valid);
    for (const listener of this.listeners) listener(id);
  }

  /** Change a setting to its next (1) or previous (−1) value. */
  step(id: string, direction: 1 | -1): void {
    const s = this.setting(id);
    if (s.kind === "toggle") this.set(id, !this.get<boolean>(id));
    if (s.kind === "range") this.set(id, Number((this.number(id) + direction * (s.by ?? 1)).toFixed(6)));
    if (s.kind === "choice" && s.options?.length) {
      const index = s.options.findIndex(([value]) => value === this.get(id));
      this.set(id, s.options[(index + direction + s.options.length) % s.options.length][0]);
    }
  }

  onChange(listener: (id: string) => void): void {
    this.listeners.push(listener);
  }

  /** All values that differ from their initial value, for the address of the page. */
  toAddress(): string {
    const parts = new URLSearchParams();
    for (const s of this.settings) {
      const value = this.values.get(s.id) as Value;
      if (!equal(value, s.initial)) parts.set(s.id, typeof value === "boolean" ? (value ? "1" : "0") : String(value));
    }
    return parts.toString();
  }

  /** Set the values of an address; all other settings get their initial value. */
  fromAddress(address: string): void {
    const parts = new URLSearchParams(address.replace(/^#/, ""));
    for (const s of this.settings) {
      const text = parts.get(s.id);
      if (text === null) this.set(s.id, s.initial);
      else if (typeof s.initial === "boolean") this.set(s.id, text === "1");
      else if (typeof s.initial === "number") this.set(s.id, Number(text));
      else this.set(s.id, text);
    }
  }
}

/** A value limited to the range of its setting; undefined if it is invalid. */
function validated(setting: Setting, value: Value): Value | undefined {
  if (setting.kind === "choice") return setting.options?.some(([v]) => v === value) ? value : undefined;
  if (setting.kind === "number") return typeof value === "number" && Math.abs(value) !== Infinity ? value : undefined;
  if (typeof value !== typeof setting.initial) return undefined;
  if (typeof value === "number") {
    if (Number.isNaN(value)) return undefined;
    const { from = -Infinity, to = Infinity, by = 1 } = setting;
    if (setting.id === "grain" && (value < from || value > to)) return setting.initial; // no such grain
    const limited = Math.min(Math.max(value, from), to);
    if (setting.kind !== "range") return Math.round(limited);
    return Number((from + Math.round((limited - from) / by) * by).toFixed(6));
  }
  if (typeof value === "string" && setting.form && !setting.form.test(value)) return undefined;
  return value;
}
