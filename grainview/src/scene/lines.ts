// Thin lines: edges of the box, trails of grains.

import * as three from "three";

/** Coloured line segments. */
export class Segments {
  readonly lines: three.LineSegments<three.BufferGeometry, three.LineBasicMaterial>;

  constructor(colours: boolean) {
    const material = new three.LineBasicMaterial({ vertexColors: colours, transparent: true, depthWrite: false });
    this.lines = new three.LineSegments(new three.BufferGeometry(), material);
    this.lines.frustumCulled = false;
  }

  /** Ends of segments (2 K, 3), and colours (2 K, 4) where there are any. */
  set(ends: Float32Array, colours?: Uint8Array): void {
    this.lines.geometry.dispose();
    const geometry = new three.BufferGeometry();
    geometry.setAttribute("position", new three.BufferAttribute(ends, 3));
    if (colours) geometry.setAttribute("color", new three.BufferAttribute(colours, 4, true));
    geometry.boundingSphere = new three.Sphere(); // is not looked at, but would be worked out each time
    this.lines.geometry = geometry;
  }
}

/** The twelve edges of a box about the origin. */
export function boxEdges(lengths: number[]): Float32Array {
  const ends: number[] = [];
  for (let axis = 0; axis < 3; axis++) {
    const [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
    for (const sb of [-1, 1]) {
      for (const sc of [-1, 1]) {
        for (const sa of [-1, 1]) {
          const corner = [0, 0, 0];
          corner[axis] = (sa * lengths[axis]) / 2;
          corner[b] = (sb * lengths[b]) / 2;
          corner[c] = (sc * lengths[c]) / 2;
          ends.push(...corner);
        }
      }
    }
  }
  return new Float32Array(ends);
}

/** Grains that leave a trail at most: more would hide everything. */
export const MOST_TRAILS = 3000;

/**
 * Ways of grains through frames, the oldest first, fading: segments and their colours.  A grain that left the box on
 * one side and came in on the other is not followed through it.  `shift` (N, 3) is from places in the box to those at
 * which grains are drawn.
 */
export function trailSegments(
  places: Float32Array[],
  who: number[],
  colour: Uint8Array,
  box: number[],
  shift: Float32Array,
): { ends: Float32Array; colours: Uint8Array } {
  const most = Math.max(places.length - 1, 0) * who.length;
  const ends = new Float32Array(6 * most);
  const colours = new Uint8Array(8 * most);
  let used = 0;
  for (let k = 1; k < places.length; k++) {
    const [before, now] = [places[k - 1], places[k]];
    const [tail, head] = [255 * ((k - 1) / (places.length - 1)), 255 * (k / (places.length - 1))];
    for (const i of who) {
      let jump = false;
      for (let a = 0; a < 3; a++) jump ||= !(Math.abs(now[3 * i + a] - before[3 * i + a]) <= 0.5 * box[a]);
      if (jump) continue;
      for (let a = 0; a < 3; a++) {
        ends[6 * used + a] = before[3 * i + a] + shift[3 * i + a];
        ends[6 * used + 3 + a] = now[3 * i + a] + shift[3 * i + a];
      }
      const rgb = colour.subarray(4 * i, 4 * i + 3);
      colours.set([...rgb, 0.8 * tail], 8 * used);
      colours.set([...rgb, 0.8 * head], 8 * used + 4);
      used++;
    }
  }
  return { ends: ends.subarray(0, 6 * used), colours: colours.subarray(0, 8 * used) };
}
