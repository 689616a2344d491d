// What the colours of a picture mean, as numbers and words: for the legend of the page and pictures that are saved.

import { MODES } from "./bonds";
import { colourOfMaterial, colourOfName, css, type Painted, type Scale } from "./colours";
import type { Known, Quantity } from "./quantities";
import { digits, prefixed } from "./units";

/** A row of a key: a colour and what it stands for; `grain`: one of those it stands for; no colour: only words. */
export interface Swatch {
  colour: string | null;
  text: string;
  grain?: number;
}

/** A bar of colours, numbers under its ends and middle. */
export interface Bar {
  title: string;
  bar: string[];
  numbers: string[];
}

export type KeyPart = Bar | { title: string; rows: Swatch[] };

const NAMED = 6; // clusters that are named

function bar(scale: Scale, label: string, unit: string): KeyPart {
  const size = Math.max(Math.abs(scale.low), Math.abs(scale.high));
  const [one, name] = prefixed(size, unit);
  const middle = scale.log ? Math.sqrt(scale.low * scale.high) : (scale.low + scale.high) / 2;
  const numbers = [scale.low, middle, scale.high].map((v) => digits(v / one, 3));
  return { title: name ? `${label} (${name})` : label, bar: scale.palette.map(css), numbers };
}

function clusters(painted: Painted, { manifest }: Known): KeyPart {
  const sizes = new Map<number, [count: number, grain: number]>();
  let single = 0;
  painted.values.forEach((name, grain) => {
    if (Number.isNaN(name)) single++;
    else sizes.set(name, [(sizes.get(name)?.[0] ?? 0) + 1, sizes.get(name)?.[1] ?? grain]);
  });
  const largest = [...sizes].sort((a, b) => b[1][0] - a[1][0] || a[0] - b[0]);
  const rows: Swatch[] = largest.slice(0, NAMED).map(([name, [count, grain]]) => (
    { colour: css(colourOfName(name, manifest)), text: `${count} grains`, grain }
  ));
  const rest = largest.length - NAMED;
  if (rest > 0) rows.push({ colour: null, text: `and ${rest} more` });
  if (single) rows.push({ colour: manifest.colours.single, text: `${single} single` });
  return { title: "clusters", rows };
}

function materials({ manifest }: Known): KeyPart {
  const rows = manifest.materials.map((text, i) => ({ colour: css(colourOfMaterial(i, manifest)), text }));
  return { title: "material", rows };
}

/** The key of a frame as it is drawn. */
export function keyOf(
  quantity: Quantity,
  painted: Painted,
  known: Known,
  bonds: { kind: string; scale: Scale },
): KeyPart[] {
  const parts: KeyPart[] = [];
  if (painted.scale) parts.push(bar(painted.scale, quantity.label, quantity.unit));
  else parts.push(quantity.id === "material" ? materials(known) : clusters(painted, known));
  if (bonds.kind === "load") parts.push(bar(bonds.scale, "normal force, + pushes", "N"));
  if (bonds.kind === "mode") {
    const { modes, within } = known.manifest.colours;
    const rows = MODES.map((mode, m) => ({ colour: modes[m], text: mode as string }));
    parts.push({ title: "contacts at the limit of", rows: [...rows, { colour: within, text: "within all limits" }] });
  }
  return parts;
}
