// Colours of values: scales with a range for quantities, tables for names of clusters and materials.

import { extent, type Dataset, type Quantity } from "./quantities";
import type { Colour3, Frame, Manifest } from "./types";

/** Red, green and blue, 0–255, of "#rrggbb". */
export function rgb(hex: string): Colour3 {
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16)) as Colour3;
}

export function css(colour: Colour3): string {
  return `rgb(${colour.map(Math.round).join(",")})`;
}

/** A colour made lighter (amount > 0) or darker. */
function shaded(colour: Colour3, amount: number): Colour3 {
  const limit = amount > 0 ? 255 : 0;
  return colour.map((c) => c + (limit - c) * Math.abs(amount)) as Colour3;
}

/** The colour of a cluster, which depends on its name only. */
export function colourOfCluster(name: number, manifest: Manifest): Colour3 {
  if (Number.isNaN(name)) return rgb(manifest.colours.single);
  const { big, small, named } = manifest.colours;
  const slot = named[String(name)];
  if (slot !== undefined && slot < big.length) return rgb(big[slot]); // of the largest clusters at the end
  // clusters that form together have consecutive names: multiplicative hashing (golden ratio) separates their colours
  const hash = Math.imul(name + 1, 0x9e3779b1) >>> 0;
  return shaded(rgb(small[hash % small.length]), [0, 0.25, -0.2][Math.floor(hash / small.length) % 3]);
}

export function colourOfMaterial(index: number, manifest: Manifest): Colour3 {
  const { materials } = manifest.colours;
  return rgb(materials[index % materials.length]);
}

/** The colour of a value of `at_rest`. */
export function colourOfRest(value: number, manifest: Manifest): Colour3 {
  return rgb(manifest.colours.rest[value] ?? manifest.colours.single);
}

/** Colours of names of clusters, and of the other quantities that are no numbers. */
const NAMED: Record<string, (value: number, manifest: Manifest) => Colour3> = {
  cluster: colourOfCluster, material: colourOfMaterial, at_rest: colourOfRest,
};

export interface Scale {
  low: number;
  high: number;
  log: boolean;
  palette: Colour3[];
  /** Whether the ends are percentiles of the run, so that some values lie beyond. */
  clipped: boolean;
}

/** Position of a value on a scale, from 0 to 1; NaN for NaN. */
function fraction(scale: Scale, value: number): number {
  const x = scale.log
    ? Math.log(Math.max(value, scale.low) / scale.low) / Math.log(scale.high / scale.low)
    : (value - scale.low) / (scale.high - scale.low);
  return Math.min(Math.max(x, 0), 1);
}

export function colourAt(scale: Scale, value: number): Colour3 {
  const x = fraction(scale, value);
  if (Number.isNaN(x)) return [150, 150, 150];
  return scale.palette[Math.min(Math.floor(x * scale.palette.length), scale.palette.length - 1)];
}

export interface ScaleSettings {
  low: number; // NaN: from the data
  high: number;
  log: boolean;
  palette: string;
}

/** Whether the range of a quantity has percentiles as its ends. */
export function isClipped(id: string, { ranges, percentiles }: Manifest): boolean {
  return percentiles.of.includes(id) && ranges[id]?.[1] > 0;
}

/** The scale of a quantity: the range from the settings, else from the manifest, else from this frame. */
function scaleOf(quantity: Quantity, values: Float32Array, settings: ScaleSettings, manifest: Manifest): Scale {
  if (quantity.kind === "diverging") {
    const reach = (quantity.unit && manifest.ranges[quantity.id]?.[1]) || 1;
    const clipped = isClipped(quantity.id, manifest);
    return { low: -reach, high: reach, log: false, palette: manifest.palettes.diverging, clipped };
  }
  const range = manifest.ranges[quantity.id];
  const ofRun = range !== undefined && range[1] > range[0];
  const given = !Number.isNaN(settings.low) || !Number.isNaN(settings.high); // by the user
  let [low, high] = (ofRun ? range : extent(values)) ?? [0, 1];
  if (!Number.isNaN(settings.low)) low = settings.low;
  if (!Number.isNaN(settings.high)) high = settings.high;
  if (low > high) [low, high] = [high, low];
  if (!(high > low)) high = low + (Math.abs(low) || 1) * 1e-3;
  const log = settings.log && high > 0;
  if (log && !(low > 0)) low = high * 1e-4;
  const palette = manifest.palettes[settings.palette] ?? Object.values(manifest.palettes)[0];
  return { low, high, log, palette, clipped: ofRun && !given && isClipped(quantity.id, manifest) };
}

export interface Painted {
  colour: Uint8Array; // (N, 4); the fourth is 255 where a grain is shown, else 0
  values: Float32Array;
  scale: Scale | null; // null for names
}

/** Colours of all grains of a frame. */
export function paint(quantity: Quantity, frame: Frame, dataset: Dataset, settings: ScaleSettings): Painted {
  const values = quantity.values(frame, dataset);
  const scale = quantity.kind === "names" ? null : scaleOf(quantity, values, settings, dataset.manifest);
  const colourOfName = NAMED[quantity.id] ?? colourOfCluster;
  const cache = new Map<number, Colour3>();
  const colour = new Uint8Array(values.length * 4);
  for (let i = 0; i < values.length; i++) {
    const value = values[i];
    let c: Colour3 | undefined;
    if (scale) {
      c = colourAt(scale, value);
    } else {
      c = cache.get(value);
      if (!c) cache.set(value, (c = colourOfName(value, dataset.manifest)));
    }
    colour[4 * i] = c[0];
    colour[4 * i + 1] = c[1];
    colour[4 * i + 2] = c[2];
    colour[4 * i + 3] = 255;
  }
  return { colour, values, scale };
}
