// Line segments: edges of the box, trails of grains.

import * as three from "three";

/** Coloured line segments. */
export class Segments {
  readonly lines: three.LineSegments<three.BufferGeometry, three.LineBasicMaterial>;

  constructor(colours: boolean) {
    const material = new three.LineBasicMaterial({ vertexColors: colours, transparent: true, depthWrite: false });
    this.lines = new three.LineSegments(new three.BufferGeometry(), material);
    this.lines.frustumCulled = false;
  }

  /** Ends of K segments (2 K, 3), and optionally their colours (2 K, 4). */
  set(ends: Float32Array, colours?: Uint8Array): void {
    this.lines.geometry.dispose();
    const geometry = new three.BufferGeometry();
    geometry.setAttribute("position", new three.BufferAttribute(ends, 3));
    if (colours) geometry.setAttribute("color", new three.BufferAttribute(colours, 4, true));
    geometry.boundingSphere = new three.Sphere(); // unused, but three.js would compute it otherwise
    this.lines.geometry = geometry;
  }
}

/** The twelve edges of a box centred at the origin. */
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

/** Maximum number of trails: more would hide the grains. */
export const MAX_TRAILS = 3000;

/**
 * Segments, and their fading colours, of the paths of some grains through frames, the oldest first. Steps across a
 * periodic face are left out. `shift` (N, 3) is the difference between drawn positions and positions in the box.
 */
export function trailSegments(
  positions: Float32Array[],
  grains: number[],
  colour: Uint8Array,
  box: number[],
  shift: Float32Array,
): { ends: Float32Array; colours: Uint8Array } {
  const capacity = Math.max(positions.length - 1, 0) * grains.length;
  const ends = new Float32Array(6 * capacity);
  const colours = new Uint8Array(8 * capacity);
  let used = 0;
  for (let k = 1; k < positions.length; k++) {
    const [before, now] = [positions[k - 1], positions[k]];
    const [tail, head] = [255 * ((k - 1) / (positions.length - 1)), 255 * (k / (positions.length - 1))];
    for (const i of grains) {
      let crosses = false;
      for (let a = 0; a < 3; a++) crosses ||= !(Math.abs(now[3 * i + a] - before[3 * i + a]) <= 0.5 * box[a]);
      if (crosses) continue;
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
