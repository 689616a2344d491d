// What the colours mean: a bar with its range and unit, or names.

import { MODES } from "../data/bonds";
import { colourOfMaterial, colourOfName, css, type Painted, type Scale } from "../data/colours";
import type { Known, Quantity } from "../data/quantities";
import { digits, prefixed } from "../data/units";
import { h } from "./dom";

const NAMED = 6; // clusters that the legend names

/** A bar of colours with numbers under it. */
function bar(scale: Scale, label: string, unit: string): HTMLElement {
  const size = Math.max(Math.abs(scale.low), Math.abs(scale.high));
  const [one, name] = prefixed(size, unit);
  const middle = scale.log ? Math.sqrt(scale.low * scale.high) : (scale.low + scale.high) / 2;
  const strip = h("div", { class: "gv-strip" });
  strip.style.background = `linear-gradient(to right, ${scale.palette.map(css).join(",")})`;
  const numbers = [scale.low, middle, scale.high].map((v) => h("span", {}, digits(v / one, 3)));
  const title = name ? `${label} (${name})` : label;
  return h("div", {}, h("div", { class: "gv-legend-title" }, title), strip, h("div", { class: "gv-ends" }, ...numbers));
}

function swatch(colour: string, text: string): HTMLElement {
  const dot = h("span", { class: "gv-dot" });
  dot.style.background = colour;
  return h("li", {}, dot, text);
}

function clusters(painted: Painted, known: Known, choose: (grain: number) => void): HTMLElement {
  const sizes = new Map<number, [count: number, grain: number]>();
  let single = 0;
  painted.values.forEach((name, grain) => {
    if (Number.isNaN(name)) single++;
    else sizes.set(name, [(sizes.get(name)?.[0] ?? 0) + 1, sizes.get(name)?.[1] ?? grain]);
  });
  const largest = [...sizes].sort((a, b) => b[1][0] - a[1][0] || a[0] - b[0]);
  const rows = largest.slice(0, NAMED).map(([name, [count, grain]]) => {
    const row = swatch(css(colourOfName(name, known.manifest)), "");
    const told = `${count} grains`;
    row.append(h("button", { type: "button", title: "choose this cluster", click: () => choose(grain) }, told));
    return row;
  });
  const rest = largest.length - NAMED;
  if (rest > 0) rows.push(h("li", { class: "gv-faint" }, `and ${rest} more`));
  if (single) rows.push(swatch(known.manifest.colours.single, `${single} single`));
  return h("div", {}, h("div", { class: "gv-legend-title" }, "clusters"), h("ul", {}, ...rows));
}

function materials(known: Known): HTMLElement {
  const rows = known.manifest.materials.map((name, i) => swatch(css(colourOfMaterial(i, known.manifest)), name));
  return h("div", {}, h("div", { class: "gv-legend-title" }, "material"), h("ul", {}, ...rows));
}

/** The legend of a frame as it is drawn. */
export function legend(
  quantity: Quantity,
  painted: Painted,
  known: Known,
  bonds: { kind: string; scale: Scale; count: number },
  choose: (grain: number) => void,
): HTMLElement[] {
  const parts: HTMLElement[] = [];
  if (painted.scale) parts.push(bar(painted.scale, quantity.label, quantity.unit));
  else parts.push(quantity.id === "material" ? materials(known) : clusters(painted, known, choose));
  if (bonds.kind === "load") parts.push(bar(bonds.scale, "normal force, + pushes", "N"));
  if (bonds.kind === "mode") {
    const rows = MODES.map((mode, m) => swatch(known.manifest.colours.modes[m], mode));
    rows.push(swatch(known.manifest.colours.within, "within all limits"));
    parts.push(h("div", {}, h("div", { class: "gv-legend-title" }, "contacts at the limit of"), h("ul", {}, ...rows)));
  }
  return parts;
}
