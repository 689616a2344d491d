// What the colours mean, on the page: a bar with its range and unit, or names.

import type { KeyPart, Swatch } from "../data/key";
import { h } from "./dom";

function bar(colours: string[], numbers: string[]): HTMLElement[] {
  const strip = h("div", { class: "gv-strip" });
  strip.style.background = `linear-gradient(to right, ${colours.join(",")})`;
  return [strip, h("div", { class: "gv-ends" }, ...numbers.map((text) => h("span", {}, text)))];
}

function row({ colour, text, grain }: Swatch, choose: (grain: number) => void): HTMLElement {
  if (colour === null) return h("li", { class: "gv-faint" }, text);
  const dot = h("span", { class: "gv-dot" });
  dot.style.background = colour;
  const press = { type: "button", title: "choose this cluster", click: () => choose(grain ?? -1) };
  return h("li", {}, dot, grain === undefined ? text : h("button", press, text));
}

/** The key of a frame; rows of clusters choose them. */
export function legend(parts: KeyPart[], choose: (grain: number) => void): HTMLElement[] {
  return parts.map((part) => {
    const content = "bar" in part
      ? bar(part.bar, part.numbers)
      : [h("ul", {}, ...part.rows.map((one) => row(one, choose)))];
    return h("div", {}, h("div", { class: "gv-legend-title" }, part.title), ...content);
  });
}
