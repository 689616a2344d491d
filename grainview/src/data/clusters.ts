// Clusters of a frame: unwrapping across periodic faces, sizes, members, properties.

import { type Box, type Frame, type Grains, SINGLE } from "./types";

/** One component of a difference of positions, by the nearest image. */
function nearestAlong(d: number, length: number, periodic: boolean): number {
  return periodic ? d - length * Math.round(d / length) : d;
}

/** A difference of positions, by the nearest image; in a tilted box, images along z are displaced along x. */
export function nearestImage(d: number[], frame: Box, periodic: boolean[]): number[] {
  const { box, tilt = 0 } = frame;
  const along = tilt ? d[0] - tilt * Math.round(d[2] / box[2]) : d[0];
  return [along, d[1], d[2]].map((component, a) => nearestAlong(component, box[a], periodic[a]));
}

/** Neighbours in contact (compressed rows): those of grain i are `other[first[i]] … other[first[i + 1] − 1]`. */
function adjacency(count: number, pair: Uint32Array): { first: Uint32Array; other: Uint32Array } {
  const first = new Uint32Array(count + 1);
  for (let e = 0; e < pair.length; e++) first[pair[e] + 1]++;
  for (let i = 0; i < count; i++) first[i + 1] += first[i];
  const next = first.slice(0, count);
  const other = new Uint32Array(pair.length);
  for (let e = 0; e < pair.length; e += 2) {
    other[next[pair[e]]++] = pair[e + 1];
    other[next[pair[e + 1]]++] = pair[e];
  }
  return { first, other };
}

export function coordination(count: number, pair: Uint32Array): Float32Array {
  const contacts = new Float32Array(count);
  for (let e = 0; e < pair.length; e++) contacts[pair[e]]++;
  return contacts;
}

/** Positions with clusters unwrapped across periodic faces; the centre of each cluster is inside the box. */
export function unwrappedPositions(frame: Frame, periodic: boolean[]): Float32Array {
  const count = frame.position.length / 3;
  const positions = Float32Array.from(frame.position);
  if (!periodic.some(Boolean)) return positions;
  const { first, other } = adjacency(count, frame.pair);
  const visited = new Uint8Array(count);
  const queue = new Uint32Array(count);
  for (let start = 0; start < count; start++) {
    if (visited[start] || first[start] === first[start + 1]) continue;
    let [head, tail] = [0, 1];
    queue[0] = start;
    visited[start] = 1;
    while (head < tail) {
      const i = queue[head++];
      for (let e = first[i]; e < first[i + 1]; e++) {
        const j = other[e];
        if (visited[j]) continue;
        visited[j] = 1;
        queue[tail++] = j;
        const apart = nearestImage(
          [0, 1, 2].map((a) => positions[3 * j + a] - positions[3 * i + a]),
          frame,
          periodic,
        );
        for (let a = 0; a < 3; a++) positions[3 * j + a] = positions[3 * i + a] + apart[a];
      }
    }
    centreInBox(positions, queue.subarray(0, tail), frame, periodic);
  }
  return positions;
}

function centreInBox(positions: Float32Array, members: Uint32Array, frame: Box, periodic: boolean[]): void {
  const centre = [0, 0, 0];
  for (const i of members) for (let a = 0; a < 3; a++) centre[a] += positions[3 * i + a] / members.length;
  const inside = nearestImage(centre, frame, periodic);
  for (let a = 0; a < 3; a++) {
    if (inside[a] !== centre[a]) for (const i of members) positions[3 * i + a] += inside[a] - centre[a];
  }
}

/** Number of grains of each named cluster. */
export function clusterSizes(frame: Frame): Map<number, number> {
  const sizes = new Map<number, number>();
  for (const name of frame.cluster) if (name !== SINGLE) sizes.set(name, (sizes.get(name) ?? 0) + 1);
  return sizes;
}

/** Grains of the cluster of a grain; the grain alone if it is single. */
export function membersOf(frame: Frame, grain: number): number[] {
  const name = frame.cluster[grain];
  if (name === SINGLE) return [grain];
  const members: number[] = [];
  frame.cluster.forEach((n, i) => n === name && members.push(i));
  return members;
}

/** Mask (1 or 0) of the grains of the cluster of a grain; the grain alone if it is single. */
export function clusterMask(frame: Frame, grain: number): Uint8Array {
  const name = frame.cluster[grain];
  return Uint8Array.from(frame.cluster, (n, i) => Number(name === SINGLE ? i === grain : n === name));
}

export interface ClusterSummary {
  grains: number;
  contacts: number;
  mass: number;
  centre: number[];
  velocity: number[];
  gyration: number; // radius of gyration
  moment: number[];
  alignment: number; // |Σμ| / Σ|μ|
}

/** Properties of a cluster; lengths in the manifest's `unit`, positions from `unwrappedPositions`. */
export function measureCluster(
  frame: Frame,
  grains: Grains,
  positions: Float32Array,
  members: number[],
): ClusterSummary {
  const centre = [0, 0, 0];
  const velocity = [0, 0, 0];
  const moment = [0, 0, 0];
  let [mass, moments, squares] = [0, 0, 0];
  for (const i of members) {
    mass += grains.mass[i];
    moments += Math.hypot(frame.moment[3 * i], frame.moment[3 * i + 1], frame.moment[3 * i + 2]);
    for (let a = 0; a < 3; a++) {
      centre[a] += grains.mass[i] * positions[3 * i + a];
      velocity[a] += grains.mass[i] * frame.velocity[3 * i + a];
      moment[a] += frame.moment[3 * i + a];
    }
  }
  for (let a = 0; a < 3; a++) {
    centre[a] /= mass;
    velocity[a] /= mass;
  }
  for (const i of members) {
    for (let a = 0; a < 3; a++) squares += grains.mass[i] * (positions[3 * i + a] - centre[a]) ** 2;
  }
  const isMember = new Set(members);
  let contacts = 0;
  for (let e = 0; e < frame.pair.length; e += 2) if (isMember.has(frame.pair[e])) contacts++;
  return {
    grains: members.length,
    contacts,
    mass,
    centre,
    velocity,
    gyration: Math.sqrt(squares / mass),
    moment,
    alignment: moments > 0 ? Math.hypot(...moment) / moments : NaN,
  };
}

/**
 * Directions of the shortest, the middle and the longest axis of the grains of a mask: eigenvectors of
 * Σ (x − x̄)(x − x̄)ᵀ by Jacobi's rotations, which make one element off the diagonal zero after another.
 */
export function principalAxes(positions: Float32Array, mask: Uint8Array): [number, number, number][] {
  const members = [...mask.keys()].filter((i) => mask[i]);
  const centre = [0, 1, 2].map((a) => members.reduce((sum, i) => sum + positions[3 * i + a] / members.length, 0));
  const t = [0, 1, 2].map((a) => [0, 1, 2].map((b) => (
    members.reduce((sum, i) => sum + (positions[3 * i + a] - centre[a]) * (positions[3 * i + b] - centre[b]), 0)
  )));
  const axes: [number, number, number][] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 12; sweep++) { // the rest after a sweep is about the square of that before
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      const angle = 0.5 * Math.atan2(2 * t[p][q], t[q][q] - t[p][p]);
      const [c, s] = [Math.cos(angle), Math.sin(angle)];
      for (const rows of [t, axes]) {
        const [x, y] = [[...rows[p]], [...rows[q]]];
        for (let a = 0; a < 3; a++) [rows[p][a], rows[q][a]] = [c * x[a] - s * y[a], s * x[a] + c * y[a]];
      }
      for (const row of t) [row[p], row[q]] = [c * row[p] - s * row[q], s * row[p] + c * row[q]];
    }
  }
  return [0, 1, 2].sort((a, b) => t[a][a] - t[b][b]).map((a) => axes[a]);
}
