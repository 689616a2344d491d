// Quantities of grains: one table, from which controls, legends and tables of values are generated.

import { clusterSizes, coordination, nearestImage } from "./clusters";
import { type Frame, type Grains, type Manifest, SINGLE } from "./types";

export interface Dataset {
  manifest: Manifest;
  grains: Grains;
}

export interface Quantity {
  id: string;
  label: string;
  unit: string;
  kind: "names" | "sequential" | "diverging";
  available?: (dataset: Dataset) => boolean;
  values: (frame: Frame, dataset: Dataset) => Float32Array;
}

function magnitudes(vectors: Float32Array): Float32Array {
  const out = new Float32Array(vectors.length / 3);
  for (let i = 0; i < out.length; i++) out[i] = Math.hypot(vectors[3 * i], vectors[3 * i + 1], vectors[3 * i + 2]);
  return out;
}

/** |Σμ| / Σ|μ| up to which the moments of a cluster cancel. */
const CANCELLED = 1e-9;

/** Total moments of clusters by name; zero where the moments cancel. */
function clusterMoments(frame: Frame): Map<number, [number, number, number]> {
  const sums = new Map<number, [number, number, number]>();
  const magnitudeSums = new Map<number, number>();
  frame.cluster.forEach((name, i) => {
    if (name === SINGLE) return;
    const sum = sums.get(name) ?? [0, 0, 0];
    for (let a = 0; a < 3; a++) sum[a] += frame.moment[3 * i + a];
    sums.set(name, sum);
    const magnitude = Math.hypot(frame.moment[3 * i], frame.moment[3 * i + 1], frame.moment[3 * i + 2]);
    magnitudeSums.set(name, (magnitudeSums.get(name) ?? 0) + magnitude);
  });
  for (const [name, sum] of sums) {
    if (Math.hypot(...sum) <= CANCELLED * (magnitudeSums.get(name) ?? 0)) sum.fill(0);
  }
  return sums;
}

/** Cosine of the angle between a vector of an array and another vector; NaN if either is zero. */
function cosine(m: Float32Array, i: number, b: ArrayLike<number>): number {
  const [x, y, z] = [m[3 * i], m[3 * i + 1], m[3 * i + 2]];
  const size = Math.hypot(x, y, z) * Math.hypot(b[0], b[1], b[2]);
  return size > 0 ? (x * b[0] + y * b[1] + z * b[2]) / size : NaN;
}

/** The direction of the magnetic field in a frame, or null. */
export function fieldDirection(manifest: Manifest, frame: number): number[] | null {
  const field = manifest.field;
  return field?.directions?.[frame] ?? field?.direction ?? null;
}

/** The flux density of the magnetic field in a frame [T], or null. */
export function fieldSize({ field }: Manifest, frame: number): number | null {
  return field?.sizes?.[frame] ?? field?.size ?? null;
}

function kineticEnergy(frame: Frame, { grains, manifest }: Dataset): Float32Array {
  const out = new Float32Array(grains.mass.length);
  for (let i = 0; i < out.length; i++) {
    const [v, w] = [frame.velocity, frame.spin];
    const speed2 = v[3 * i] ** 2 + v[3 * i + 1] ** 2 + v[3 * i + 2] ** 2;
    const spin2 = w[3 * i] ** 2 + w[3 * i + 1] ** 2 + w[3 * i + 2] ** 2;
    const radius = grains.radius[i] * manifest.unit;
    out[i] = 0.5 * grains.mass[i] * (speed2 + 0.4 * radius * radius * spin2);
  }
  return out;
}

/**
 * Mean pressure in each grain, Σ l·f r/(r1 + r2) / 3V over its contacts, with l from the centre of grain 2 to that of
 * grain 1 and the force f on grain 1.
 */
function pressure(frame: Frame, { grains, manifest }: Dataset): Float32Array {
  if (frame.pressure) return frame.pressure;
  const out = new Float32Array(manifest.grains);
  for (let c = 0; 2 * c < frame.pair.length; c++) {
    const [i, j] = [frame.pair[2 * c], frame.pair[2 * c + 1]];
    const apart = [0, 1, 2].map((a) => frame.position[3 * i + a] - frame.position[3 * j + a]);
    const branch = nearestImage(apart, frame, manifest.periodic);
    let product = 0;
    for (let a = 0; a < 3; a++) product += branch[a] * manifest.unit * frame.force[3 * c + a];
    for (const k of [i, j]) out[k] += (product * grains.radius[k]) / (grains.radius[i] + grains.radius[j]);
  }
  return out.map((virial, i) => virial / (4 * Math.PI * (grains.radius[i] * manifest.unit) ** 3));
}

const hasMoments = ({ manifest }: Dataset): boolean => !manifest.ranges.moment || manifest.ranges.moment[1] > 0;

export const QUANTITIES: Quantity[] = [
  {
    id: "cluster", label: "cluster", unit: "", kind: "names",
    values: (frame) => Float32Array.from(frame.cluster, (n) => (n === SINGLE ? NaN : n)),
  },
  {
    id: "size", label: "cluster size", unit: "grains", kind: "sequential",
    values: (frame) => {
      const sizes = clusterSizes(frame);
      return Float32Array.from(frame.cluster, (n) => sizes.get(n) ?? 1);
    },
  },
  {
    id: "radius", label: "radius", unit: "m", kind: "sequential",
    values: (_, { grains, manifest }) => grains.radius.map((r) => r * manifest.unit),
  },
  {
    id: "coordination", label: "contacts", unit: "", kind: "sequential",
    values: (frame, { manifest }) => coordination(manifest.grains, frame.pair),
  },
  { id: "speed", label: "speed", unit: "m/s", kind: "sequential", values: (frame) => magnitudes(frame.velocity) },
  { id: "spin", label: "spin", unit: "rad/s", kind: "sequential", values: (frame) => magnitudes(frame.spin) },
  { id: "kinetic_energy", label: "kinetic energy", unit: "J", kind: "sequential", values: kineticEnergy },
  { id: "pressure", label: "pressure by contacts", unit: "Pa", kind: "diverging", values: pressure },
  {
    id: "alignment", label: "alignment in cluster", unit: "", kind: "diverging",
    available: hasMoments,
    values: (frame) => {
      const sums = clusterMoments(frame);
      return Float32Array.from(frame.cluster, (n, i) => cosine(frame.moment, i, sums.get(n) ?? [0, 0, 0]));
    },
  },
  {
    id: "field_alignment", label: "alignment with field", unit: "", kind: "diverging",
    available: (dataset) => dataset.manifest.field !== null && hasMoments(dataset),
    values: (frame, { manifest }) => {
      const b = fieldDirection(manifest, frame.frame) ?? [0, 0, 0];
      return Float32Array.from(frame.cluster, (_, i) => cosine(frame.moment, i, b));
    },
  },
  {
    id: "material", label: "material", unit: "", kind: "names",
    values: (_, { grains }) => Float32Array.from(grains.material),
  },
  {
    id: "at_rest", label: "awake / rest", unit: "", kind: "names",
    available: ({ manifest }) => manifest.at_rest,
    values: (frame, { manifest }) => (
      frame.at_rest ? Float32Array.from(frame.at_rest) : new Float32Array(manifest.grains).fill(NaN)
    ),
  },
];

/** All quantities of a run: the table and the own quantities of the user. */
export function quantitiesOf(manifest: Manifest): Quantity[] {
  const own = manifest.own.map(({ id, label, unit }): Quantity => ({
    id, label, unit, kind: "sequential",
    values: (frame) => frame.own.get(id) ?? new Float32Array(manifest.grains).fill(NaN),
  }));
  return [...QUANTITIES, ...own];
}

/** Number of grains of awake clusters in a frame; null if the frame does not say it. */
export function awakeGrains({ at_rest: rest, position }: Frame): number | null {
  if (!rest) return null;
  let count = 0;
  for (let i = 0; i < rest.length; i++) count += Number(rest[i] === 0 && !Number.isNaN(position[3 * i]));
  return count;
}

/** The smallest and largest finite number, or null. */
export function extent(values: ArrayLike<number>): [number, number] | null {
  let [low, high] = [Infinity, -Infinity];
  for (let i = 0; i < values.length; i++) {
    if (values[i] < low) low = values[i];
    if (values[i] > high && values[i] < Infinity) high = values[i];
  }
  return low <= high ? [low, high] : null;
}
