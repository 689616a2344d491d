// The legend on the page: a colour bar with range and unit, or a list of names.

import type { KeyPart, Shares, Swatch } from "../data/key";
import { h } from "./dom";

function bar(colours: string[], numbers: string[]): HTMLElement[] {
  const strip = h("div", { class: "gv-strip" });
  strip.style.background = `linear-gradient(to right, ${colours.join(",")})`;
  return [strip, h("div", { class: "gv-ends" }, ...numbers.map((text) => h("span", {}, text)))];
}

function row({ colour, text, grain, hint }: Swatch, select: (grain: number) => void): HTMLElement {
  if (colour === null) return h("li", { class: "gv-faint", title: hint }, text);
  const dot = h("span", { class: "gv-dot" });
  dot.style.background = colour;
  const attributes = { type: "button", title: "select this cluster", click: () => select(grain ?? -1) };
  return h("li", { title: hint }, dot, grain === undefined ? text : h("button", attributes, text));
}

/** Elements of what is told of the frame as a whole: a title, a bar of shares, and rows. */
export function sharesOf(parts: Shares[]): HTMLElement[] {
  return parts.map(({ title, hint, shares, rows }) => {
    const bar = h("div", { class: "gv-shares" }, ...shares.map(({ colour, share }) => {
      const piece = h("span", {});
      piece.style.background = colour;
      piece.style.width = `${100 * share}%`;
      return piece;
    }));
    const list = h("ul", {}, ...rows.map((swatch) => row(swatch, () => undefined)));
    const head = h("div", { class: "gv-glance-title", title: hint }, title);
    return h("div", {}, head, ...(shares.length ? [bar] : []), list);
  });
}

/** Elements of the legend; a click on a row of a cluster selects it. */
export function legend(parts: KeyPart[], select: (grain: number) => void): HTMLElement[] {
  return parts.map((part) => {
    const content = "bar" in part
      ? bar(part.bar, part.numbers)
      : [h("ul", {}, ...part.rows.map((swatch) => row(swatch, select)))];
    return h("div", {}, h("div", { class: "gv-legend-title", title: part.hint }, part.title), ...content);
  });
}
