// Contacts as they are drawn: bars between grains, cut at the contact where it lies beyond a face, and their colours.

import { nearestImage } from "./clusters";
import { colourAt, isClipped, rgb, type Scale } from "./colours";
import type { Colour3, Frame, Manifest } from "./types";

/** Modes of deformation of a contact, the columns of `share`. */
export const MODES = ["stretch", "slide", "roll", "twist"] as const;

/** Share from which a mode counts as at its limit; shares are stored with rounding. */
const AT_LIMIT = 0.999;

export interface Bonds {
  from: Float32Array; // (P, 3)
  to: Float32Array;
  colour: Uint8Array; // (P, 4)
  radius: Float32Array; // (P,) of the smaller of the two grains
  contact: Uint32Array; // (P,) index of the contact
}

/** Force along the line of centres of a contact [N]; positive if repulsive. */
export function normalForce(frame: Frame, contact: number, periodic: boolean[]): number {
  const [i, j] = [frame.pair[2 * contact], frame.pair[2 * contact + 1]];
  const apart = [0, 1, 2].map((a) => frame.position[3 * i + a] - frame.position[3 * j + a]);
  const d = nearestImage(apart, frame, periodic);
  const size = Math.hypot(...d);
  return [0, 1, 2].reduce((sum, a) => sum + (frame.force[3 * contact + a] * d[a]) / size, 0);
}

/** The mode closest to its limit, and its share; −1 if no share is known. */
export function limitingMode(frame: Frame, contact: number): [number, number] {
  let [mode, max] = [-1, -Infinity];
  for (let m = 0; m < 4; m++) {
    // sliding, rolling and twisting have limits in both directions, stretching only under tension
    const share = m ? Math.abs(frame.share[4 * contact + m]) : frame.share[4 * contact];
    if (share > max) [mode, max] = [m, share];
  }
  return [mode, max];
}

export type BondColours = (contact: number) => Colour3;

/** Colours of contacts: "plain", "load" (normal force) or "mode" (the mode at its limit). */
export function bondColours(kind: string, frame: Frame, manifest: Manifest, scale: Scale): BondColours {
  if (kind === "load") return (c) => colourAt(scale, normalForce(frame, c, manifest.periodic));
  if (kind === "mode") {
    const colours = [manifest.colours.within, ...manifest.colours.modes].map(rgb);
    return (c) => {
      const [mode, share] = limitingMode(frame, c);
      return colours[share >= AT_LIMIT ? mode + 1 : 0];
    };
  }
  const plain = rgb(manifest.colours.within);
  return () => plain;
}

/** Colour scale of normal forces, symmetric about zero. */
export function loadScale(manifest: Manifest, frame: Frame): Scale {
  let top = manifest.ranges.load?.[1] ?? 0;
  if (!(top > 0)) for (const f of frame.force) top = Math.max(top, Math.abs(f) || 0);
  top ||= 1;
  const clipped = isClipped("load", manifest);
  return { low: -top, high: top, log: false, palette: manifest.palettes.diverging, clipped };
}

/**
 * Share of the way from the centre of a grain of radius r to that of another, of radius s, at which their spheres
 * intersect, or between their surfaces: the plane of equal powers, (d² + r² − s²) / (2 d²) for the squared distance d².
 */
function contactShare(squaredDistance: number, r: number, s: number): number {
  const share = 0.5 + (0.5 * (r * r - s * s)) / squaredDistance;
  return Math.min(Math.max(share, 0), 1); // NaN for absent grains
}

/** Bars of all contacts between shown grains, at the positions where these are drawn. */
export function bondPieces(
  frame: Frame,
  positions: Float32Array,
  radius: Float32Array,
  shown: Uint8Array | null,
  manifest: Manifest,
  colourOf: BondColours,
): Bonds {
  const { pair, box } = frame;
  const capacity = pair.length; // at most two bars per contact
  const from = new Float32Array(3 * capacity);
  const to = new Float32Array(3 * capacity);
  const colours = new Uint8Array(4 * capacity);
  const smaller = new Float32Array(capacity);
  const contact = new Uint32Array(capacity);
  let d = [0, 0, 0];
  let used = 0;
  const add = (c: number, grain: number, fraction: number, colour: Colour3): void => {
    for (let a = 0; a < 3; a++) {
      from[3 * used + a] = positions[3 * grain + a];
      to[3 * used + a] = positions[3 * grain + a] + fraction * d[a];
      colours[4 * used + a] = colour[a];
    }
    colours[4 * used + 3] = 255;
    smaller[used] = Math.min(radius[pair[2 * c]], radius[pair[2 * c + 1]]);
    contact[used++] = c;
  };
  for (let c = 0; 2 * c < pair.length; c++) {
    const [i, j] = [pair[2 * c], pair[2 * c + 1]];
    if (shown && !(shown[i] && shown[j])) continue;
    const straight = [0, 1, 2].map((a) => positions[3 * j + a] - positions[3 * i + a]);
    d = nearestImage(straight, frame, manifest.periodic);
    const wrapped = d.some((component, a) => Math.abs(component - straight[a]) > 0.5 * box[a]);
    const colour = colourOf(c);
    const share = wrapped ? contactShare(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], radius[i], radius[j]) : 1;
    add(c, i, share, colour);
    if (wrapped) add(c, j, share - 1, colour);
  }
  return {
    from: from.subarray(0, 3 * used),
    to: to.subarray(0, 3 * used),
    colour: colours.subarray(0, 4 * used),
    radius: smaller.subarray(0, used),
    contact: contact.subarray(0, used),
  };
}
