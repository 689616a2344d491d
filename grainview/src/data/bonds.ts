// Contacts as they are drawn: halves where they cross a face, so that they show at both; coloured by what they bear.

import { nearest } from "./clusters";
import { colourAt, rgb, type Scale } from "./colours";
import type { Colour3, Frame, Manifest } from "./types";

/** Modes, as the columns of a frame's `share`. */
export const MODES = ["stretch", "slide", "roll", "twist"] as const;

/** From here on a mode counts as at its limit: what is stored is rounded. */
export const AT_LIMIT = 0.999;

export interface Bonds {
  from: Float32Array; // (P, 3)
  to: Float32Array;
  colour: Uint8Array; // (P, 4)
  contact: Uint32Array; // (P,) which contact a piece belongs to
}

/** Force along the line of centres of a contact [N]: above 0 it pushes, below it pulls. */
export function normalForce(frame: Frame, contact: number, periodic: boolean[]): number {
  const [i, j] = [frame.pair[2 * contact], frame.pair[2 * contact + 1]];
  const d = [0, 1, 2].map((a) =>
    nearest(frame.position[3 * i + a] - frame.position[3 * j + a], frame.box[a], periodic[a]),
  );
  const size = Math.hypot(...d);
  return [0, 1, 2].reduce((sum, a) => sum + (frame.force[3 * contact + a] * d[a]) / size, 0);
}

/** The mode that is nearest its limit, and its share; −1 where nothing is known. */
export function worstMode(frame: Frame, contact: number): [number, number] {
  let [mode, most] = [-1, -Infinity];
  for (let m = 0; m < 4; m++) {
    // shifts and turns go both ways; of stretching, only that by a pull comes to a limit
    const share = m ? Math.abs(frame.share[4 * contact + m]) : frame.share[4 * contact];
    if (share > most) [mode, most] = [m, share];
  }
  return [mode, most];
}

export type BondPaint = (contact: number) => Colour3;

/** How contacts are coloured: "plain", "load" (normal force, pull to push) or "mode" (at its limit). */
export function bondPaint(kind: string, frame: Frame, manifest: Manifest, scale: Scale): BondPaint {
  if (kind === "load") return (c) => colourAt(scale, normalForce(frame, c, manifest.periodic));
  if (kind === "mode") {
    const colours = [manifest.colours.within, ...manifest.colours.modes].map(rgb);
    return (c) => {
      const [mode, share] = worstMode(frame, c);
      return colours[share >= AT_LIMIT ? mode + 1 : 0];
    };
  }
  const plain = rgb(manifest.colours.within);
  return () => plain;
}

/** Loads from the largest pull to the largest push, alike on both sides of none. */
export function loadScale(manifest: Manifest, frame: Frame): Scale {
  let top = manifest.ranges.load?.[1] ?? 0;
  if (!(top > 0)) for (const f of frame.force) top = Math.max(top, Math.abs(f) || 0);
  top ||= 1;
  return { low: -top, high: top, log: false, palette: manifest.palettes.diverging };
}

/** Pieces of all contacts between shown grains, at the places where these are drawn. */
export function bondPieces(
  frame: Frame,
  place: Float32Array,
  shown: Uint8Array | null,
  manifest: Manifest,
  paint: BondPaint,
): Bonds {
  const { pair, box } = frame;
  const most = pair.length; // two pieces for each contact at most
  const from = new Float32Array(3 * most);
  const to = new Float32Array(3 * most);
  const colours = new Uint8Array(4 * most);
  const contact = new Uint32Array(most);
  const d = new Float64Array(3);
  let used = 0;
  const put = (c: number, at: number, share: number, colour: Colour3): void => {
    for (let a = 0; a < 3; a++) {
      from[3 * used + a] = place[3 * at + a];
      to[3 * used + a] = place[3 * at + a] + share * d[a];
      colours[4 * used + a] = colour[a];
    }
    colours[4 * used + 3] = 255;
    contact[used++] = c;
  };
  for (let c = 0; 2 * c < pair.length; c++) {
    const [i, j] = [pair[2 * c], pair[2 * c + 1]];
    if (shown && !(shown[i] && shown[j])) continue;
    let wrapped = false;
    for (let a = 0; a < 3; a++) {
      const straight = place[3 * j + a] - place[3 * i + a];
      d[a] = nearest(straight, box[a], manifest.periodic[a]);
      wrapped ||= Math.abs(d[a] - straight) > 0.5 * box[a];
    }
    const colour = paint(c);
    put(c, i, wrapped ? 0.5 : 1, colour);
    if (wrapped) put(c, j, -0.5, colour);
  }
  return {
    from: from.subarray(0, 3 * used),
    to: to.subarray(0, 3 * used),
    colour: colours.subarray(0, 4 * used),
    contact: contact.subarray(0, used),
  };
}
