// From numbers to colours: scales with a range, names with a table.

import { extent, type Known, type Quantity } from "./quantities";
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
  const goal = amount > 0 ? 255 : 0;
  return colour.map((c) => c + (goal - c) * Math.abs(amount)) as Colour3;
}

/** The colour of a cluster's name; the same for as long as the cluster keeps its name. */
export function colourOfName(name: number, manifest: Manifest): Colour3 {
  if (Number.isNaN(name)) return rgb(manifest.colours.single);
  const { big, small, named } = manifest.colours;
  const slot = named[String(name)];
  if (slot !== undefined && slot < big.length) return rgb(big[slot]); // those that will be the largest
  // names of clusters that are born together are neighbours: a golden step sets their colours apart
  const spread = Math.imul(name + 1, 0x9e3779b1) >>> 0;
  return shaded(rgb(small[spread % small.length]), [0, 0.25, -0.2][Math.floor(spread / small.length) % 3]);
}

export function colourOfMaterial(index: number, manifest: Manifest): Colour3 {
  const all = manifest.colours.materials;
  return rgb(all[index % all.length]);
}

export interface Scale {
  low: number;
  high: number;
  log: boolean;
  palette: Colour3[];
}

/** Where a value lies on a scale, 0 to 1; NaN stays. */
export function along(scale: Scale, value: number): number {
  const share = scale.log
    ? Math.log(Math.max(value, scale.low) / scale.low) / Math.log(scale.high / scale.low)
    : (value - scale.low) / (scale.high - scale.low);
  return Math.min(Math.max(share, 0), 1);
}

export function colourAt(scale: Scale, value: number): Colour3 {
  const at = along(scale, value);
  if (Number.isNaN(at)) return [150, 150, 150];
  return scale.palette[Math.min(Math.floor(at * scale.palette.length), scale.palette.length - 1)];
}

export interface ScaleWish {
  low: number; // NaN: as the data have it
  high: number;
  log: boolean;
  palette: string;
}

/** The scale of a quantity: what the user wants, or else the range in the manifest, or else this frame's. */
export function scaleOf(quantity: Quantity, values: Float32Array, wish: ScaleWish, manifest: Manifest): Scale {
  if (quantity.kind === "diverging") {
    return { low: -1, high: 1, log: false, palette: manifest.palettes.diverging };
  }
  const range = manifest.ranges[quantity.id];
  let [low, high] = (range && range[1] > range[0] ? range : extent(values)) ?? [0, 1];
  if (!Number.isNaN(wish.low)) low = wish.low;
  if (!Number.isNaN(wish.high)) high = wish.high;
  if (low > high) [low, high] = [high, low];
  if (!(high > low)) high = low + (Math.abs(low) || 1) * 1e-3;
  const log = wish.log && high > 0;
  if (log && !(low > 0)) low = high * 1e-4;
  return { low, high, log, palette: manifest.palettes[wish.palette] ?? Object.values(manifest.palettes)[0] };
}

export interface Painted {
  colour: Uint8Array; // (N, 4); the last is 255 where a grain is shown
  values: Float32Array;
  scale: Scale | null; // null: names
}

/** Colours of all grains of a frame. */
export function paint(quantity: Quantity, frame: Frame, known: Known, wish: ScaleWish): Painted {
  const values = quantity.values(frame, known);
  const scale = quantity.kind === "names" ? null : scaleOf(quantity, values, wish, known.manifest);
  const ofName = quantity.id === "material" ? colourOfMaterial : colourOfName;
  const memory = new Map<number, Colour3>();
  const colour = new Uint8Array(values.length * 4);
  for (let i = 0; i < values.length; i++) {
    const value = values[i];
    let c: Colour3 | undefined;
    if (scale) {
      c = colourAt(scale, value);
    } else {
      c = memory.get(value);
      if (!c) memory.set(value, (c = ofName(value, known.manifest)));
    }
    colour[4 * i] = c[0];
    colour[4 * i + 1] = c[1];
    colour[4 * i + 2] = c[2];
    colour[4 * i + 3] = 255;
  }
  return { colour, values, scale };
}
