// The legend on the page: a colour bar with range and unit, or a list of names.

import type { KeyPart, Swatch } from "../data/key";
import { h } from "./dom";

function bar(colours: string[], numbers: string[]): HTMLElement[] {
  const strip = h("div", { class: "gv-strip" });
  strip.style.background = `linear-gradient(to right, ${colours.join(",")})`;
  return [strip, h("div", { class: "gv-ends" }, ...numbers.map((text) => h("span", {}, text)))];
}

function row({ colour, text, grain }: Swatch, select: (grain: number) => void): HTMLElement {
  if (colour === null) return h("li", { class: "gv-faint" }, text);
  const dot = h("span", { class: "gv-dot" });
  dot.style.background = colour;
  const attributes = { type: "button", title: "select this cluster", click: () => select(grain ?? -1) };
  return h("li", {}, dot, grain === undefined ? text : h("button", attributes, text));
}

/** Elements of the legend; a click on a row of a cluster selects it. */
export function legend(parts: KeyPart[], select: (grain: number) => void): HTMLElement[] {
  return parts.map((part) => {
    const content = "bar" in part
      ? bar(part.bar, part.numbers)
      : [h("ul", {}, ...part.rows.map((swatch) => row(swatch, select)))];
    return h("div", {}, h("div", { class: "gv-legend-title" }, part.title), ...content);
  });
}
