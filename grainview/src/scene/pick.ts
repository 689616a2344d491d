// Picking: the first grain or contact along the ray through a pixel, by testing all of them.

import type { Ray } from "three";
import type { Bonds } from "../data/bonds";

export interface Hit {
  kind: "grain" | "contact";
  index: number;
  distance: number;
}

/** The first grain along a ray. */
export function pickGrain(
  ray: Ray,
  positions: Float32Array,
  radius: Float32Array,
  size: number,
  shown: Uint8Array | null,
): Hit | null {
  const [ox, oy, oz] = ray.origin.toArray();
  const [dx, dy, dz] = ray.direction.toArray();
  let [best, nearest] = [-1, Infinity];
  for (let i = 0; i < radius.length; i++) {
    if (shown && !shown[i]) continue;
    const [x, y, z] = [positions[3 * i] - ox, positions[3 * i + 1] - oy, positions[3 * i + 2] - oz];
    const b = x * dx + y * dy + z * dz;
    const r = radius[i] * size;
    const discriminant = r * r - (x * x + y * y + z * z - b * b);
    if (discriminant < 0) continue;
    const t = b - Math.sqrt(discriminant);
    if (t > 0 && t < nearest) [best, nearest] = [i, t];
  }
  return best < 0 ? null : { kind: "grain", index: best, distance: nearest };
}

/** The first contact along a ray; bars are cylinders of `bar` times the radius of the smaller grain. */
export function pickContact(ray: Ray, bonds: Bonds, bar: number): Hit | null {
  const o = ray.origin.toArray();
  const d = ray.direction.toArray();
  let [best, nearest] = [-1, Infinity];
  const [axis, off] = [[0, 0, 0], [0, 0, 0]];
  for (let k = 0; k < bonds.contact.length; k++) {
    let [size, da, oa] = [0, 0, 0];
    for (let a = 0; a < 3; a++) {
      axis[a] = bonds.to[3 * k + a] - bonds.from[3 * k + a];
      off[a] = o[a] - bonds.from[3 * k + a];
      size += axis[a] * axis[a];
    }
    size = Math.sqrt(size);
    for (let a = 0; a < 3; a++) {
      axis[a] /= size;
      da += d[a] * axis[a];
      oa += off[a] * axis[a];
    }
    let [A, B, C] = [0, 0, -((bar * bonds.radius[k]) ** 2)];
    for (let a = 0; a < 3; a++) {
      const [dp, op] = [d[a] - da * axis[a], off[a] - oa * axis[a]];
      A += dp * dp;
      B += dp * op;
      C += op * op;
    }
    const discriminant = B * B - A * C;
    if (discriminant < 0) continue;
    let t = A < 1e-12 ? NaN : (-B - Math.sqrt(discriminant)) / A;
    const at = oa + t * da;
    if (!(at >= 0 && at <= size)) {
      t = ((da > 0 ? 0 : size) - oa) / da; // the flat end that faces the eye
      if (!(A * t * t + 2 * B * t + C <= 0)) continue;
    }
    if (t > 0 && t < nearest) [best, nearest] = [bonds.contact[k], t];
  }
  return best < 0 ? null : { kind: "contact", index: best, distance: nearest };
}
