// Clusters of a frame: made whole across periodic faces, measured.

import { type Frame, type Grains, SINGLE } from "./types";

/** The shortest way from one place to another: x, y, z of `to − from`, by the nearest image. */
export function nearest(d: number, length: number, periodic: boolean): number {
  return periodic ? d - length * Math.round(d / length) : d;
}

/** Contacts of each grain: those of grain i are `other[first[i]] … other[first[i + 1] − 1]`. */
export function adjacency(count: number, pair: Uint32Array): { first: Uint32Array; other: Uint32Array } {
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

/** Positions in which clusters are not cut by faces: each is where its centre is in the box. */
export function wholePositions(frame: Frame, periodic: boolean[]): Float32Array {
  const count = frame.position.length / 3;
  const place = Float32Array.from(frame.position);
  if (!periodic.some(Boolean)) return place;
  const { first, other } = adjacency(count, frame.pair);
  const seen = new Uint8Array(count);
  const queue = new Uint32Array(count);
  for (let start = 0; start < count; start++) {
    if (seen[start] || first[start] === first[start + 1]) continue;
    let [head, tail] = [0, 1];
    queue[0] = start;
    seen[start] = 1;
    while (head < tail) {
      const i = queue[head++];
      for (let e = first[i]; e < first[i + 1]; e++) {
        const j = other[e];
        if (seen[j]) continue;
        seen[j] = 1;
        queue[tail++] = j;
        for (let a = 0; a < 3; a++) {
          place[3 * j + a] = place[3 * i + a] + nearest(place[3 * j + a] - place[3 * i + a], frame.box[a], periodic[a]);
        }
      }
    }
    centreInBox(place, queue.subarray(0, tail), frame.box, periodic);
  }
  return place;
}

function centreInBox(place: Float32Array, who: Uint32Array, box: number[], periodic: boolean[]): void {
  for (let a = 0; a < 3; a++) {
    if (!periodic[a]) continue;
    let middle = 0;
    for (const i of who) middle += place[3 * i + a] / who.length;
    const shift = box[a] * Math.round(middle / box[a]);
    if (shift) for (const i of who) place[3 * i + a] -= shift;
  }
}

/** Number of grains of each named cluster. */
export function clusterSizes(frame: Frame): Map<number, number> {
  const sizes = new Map<number, number>();
  for (const name of frame.cluster) if (name !== SINGLE) sizes.set(name, (sizes.get(name) ?? 0) + 1);
  return sizes;
}

/** Grains of the cluster that a grain is in; itself if it is single. */
export function membersOf(frame: Frame, grain: number): number[] {
  const name = frame.cluster[grain];
  if (name === SINGLE) return [grain];
  const who: number[] = [];
  frame.cluster.forEach((n, i) => n === name && who.push(i));
  return who;
}

/** 1 for the grains of the cluster that a grain is in, itself if it is single; 0 for all others. */
export function maskOf(frame: Frame, grain: number): Uint8Array {
  const name = frame.cluster[grain];
  return Uint8Array.from(frame.cluster, (n, i) => Number(name === SINGLE ? i === grain : n === name));
}

export interface ClusterSummary {
  grains: number;
  contacts: number;
  mass: number;
  centre: number[];
  velocity: number[];
  gyration: number;
  moment: number[];
  alignment: number;
}

/** A cluster's numbers; lengths in units of the manifest's `unit`, `place` from `wholePositions`. */
export function measureCluster(frame: Frame, grains: Grains, place: Float32Array, who: number[]): ClusterSummary {
  const centre = [0, 0, 0];
  const velocity = [0, 0, 0];
  const moment = [0, 0, 0];
  let [mass, sizes, squares] = [0, 0, 0];
  for (const i of who) {
    mass += grains.mass[i];
    sizes += Math.hypot(frame.moment[3 * i], frame.moment[3 * i + 1], frame.moment[3 * i + 2]);
    for (let a = 0; a < 3; a++) {
      centre[a] += grains.mass[i] * place[3 * i + a];
      velocity[a] += grains.mass[i] * frame.velocity[3 * i + a];
      moment[a] += frame.moment[3 * i + a];
    }
  }
  for (let a = 0; a < 3; a++) {
    centre[a] /= mass;
    velocity[a] /= mass;
  }
  for (const i of who) for (let a = 0; a < 3; a++) squares += grains.mass[i] * (place[3 * i + a] - centre[a]) ** 2;
  const inside = new Set(who);
  let contacts = 0;
  for (let e = 0; e < frame.pair.length; e += 2) if (inside.has(frame.pair[e])) contacts++;
  return {
    grains: who.length,
    contacts,
    mass,
    centre,
    velocity,
    gyration: Math.sqrt(squares / mass),
    moment,
    alignment: sizes > 0 ? Math.hypot(...moment) / sizes : NaN,
  };
}
