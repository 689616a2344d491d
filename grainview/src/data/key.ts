// Content of the legend, on the page and on saved pictures.

import { MODES } from "./bonds";
import { colourOfMaterial, colourOfCluster, colourOfRest, css, type Painted, type Scale } from "./colours";
import type { Dataset, Quantity } from "./quantities";
import { digits, prefixed } from "./units";

/** A row of the legend: colour (null: text only) and text; for a cluster, one of its grains. */
export interface Swatch {
  colour: string | null;
  text: string;
  grain?: number;
  /** A further explanation, shown as a tooltip. */
  hint?: string;
}

/** A colour bar; numbers below its ends and its middle. */
export interface Bar {
  title: string;
  hint?: string;
  bar: string[];
  numbers: string[];
}

/** A bar divided into shares of a whole; what they leave is empty. */
export interface Shares {
  title: string;
  hint?: string;
  shares: { colour: string; share: number }[];
  rows: Swatch[];
}

export type KeyPart = Bar | { title: string; hint?: string; rows: Swatch[] };

const MAX_CLUSTERS = 6; // rows for clusters

function bar(scale: Scale, label: string, unit: string, limits: [number, number]): KeyPart {
  const size = Math.max(Math.abs(scale.low), Math.abs(scale.high));
  const [factor, name] = prefixed(size, unit);
  const middle = scale.log ? Math.sqrt(scale.low * scale.high) : (scale.low + scale.high) / 2;
  const numbers = [scale.low, middle, scale.high].map((v) => digits(v / factor, 3));
  const title = name ? `${label} (${name})` : label;
  const colours = { bar: scale.palette.map(css), numbers };
  if (!scale.clipped) return { title, ...colours };
  // a scale from −x to x has the magnitudes up to x
  const [low, high] = scale.low === -scale.high ? [0, limits[1]] : limits;
  const hint = `Of the values that are not zero, in frames spread over the run, ${high - low} % are in this range; `
    + "those beyond have the colours of its ends.";
  return { title: `${title}, ${high - low} % of values`, hint, ...colours };
}

function clusters(painted: Painted, position: Float32Array, { manifest }: Dataset): KeyPart {
  const sizes = new Map<number, [count: number, grain: number]>();
  let single = 0;
  painted.values.forEach((name, grain) => {
    if (Number.isNaN(name)) single += Number(!Number.isNaN(position[3 * grain])); // not the absent ones
    else sizes.set(name, [(sizes.get(name)?.[0] ?? 0) + 1, sizes.get(name)?.[1] ?? grain]);
  });
  const largest = [...sizes].sort((a, b) => b[1][0] - a[1][0] || a[0] - b[0]);
  const rows: Swatch[] = largest.slice(0, MAX_CLUSTERS).map(([name, [count, grain]]) => (
    { colour: css(colourOfCluster(name, manifest)), text: `${count} grains`, grain }
  ));
  const rest = largest.length - MAX_CLUSTERS;
  if (rest > 0) rows.push({ colour: null, text: `and ${rest} more` });
  if (single) rows.push({ colour: manifest.colours.single, text: `${single} single` });
  return { title: "clusters", rows };
}

function materials({ manifest }: Dataset): KeyPart {
  const rows = manifest.materials.map((text, i) => ({ colour: css(colourOfMaterial(i, manifest)), text }));
  return { title: "material", rows };
}

function rest({ values }: Painted, position: Float32Array, { manifest }: Dataset): KeyPart {
  const present = values.filter((_, i) => !Number.isNaN(position[3 * i])); // without absent grains
  const rows: Swatch[] = ["awake (contact steps)", "at rest (rigid)"].map((name, value) => {
    const count = present.filter((v) => v === value).length;
    return { colour: css(colourOfRest(value, manifest)), text: `${count} ${name}` };
  });
  const unknown = present.filter((v) => Number.isNaN(v)).length;
  if (unknown) rows.push({ colour: manifest.colours.single, text: `${unknown} not known` });
  return { title: "grains of clusters that are", rows };
}

/** The legend of a frame as it is drawn. */
export function keyOf(
  quantity: Quantity,
  painted: Painted,
  position: Float32Array, // of the frame; NaN for grains that are absent
  dataset: Dataset,
  bonds: { kind: string; scale: Scale },
): KeyPart[] {
  const parts: KeyPart[] = [];
  const { limits } = dataset.manifest.percentiles;
  if (painted.scale) parts.push(bar(painted.scale, quantity.label, quantity.unit, limits));
  else if (quantity.id === "material") parts.push(materials(dataset));
  else parts.push((quantity.id === "at_rest" ? rest : clusters)(painted, position, dataset));
  if (bonds.kind === "load") parts.push(bar(bonds.scale, "normal force, + repulsive", "N", limits));
  if (bonds.kind === "mode") {
    const { modes, within } = dataset.manifest.colours;
    const rows = MODES.map((mode, m) => ({ colour: modes[m], text: mode as string }));
    parts.push({ title: "contacts at the limit of", rows: [...rows, { colour: within, text: "within all limits" }] });
  }
  return parts;
}
