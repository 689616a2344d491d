// Ambient occlusion: neighbours on one side of a grain shade that side. For appearance only, not a measurement.

/** Half of the 26 neighbours of a cell: each pair of cells is visited once. */
const HALF: number[][] = [];
for (const x of [-1, 0, 1]) {
  for (const y of [-1, 0, 1]) {
    for (const z of [-1, 0, 1]) if (x * 9 + y * 3 + z > 0) HALF.push([x, y, z]);
  }
}

interface Cells {
  of: Uint32Array; // cell of each grain
  own: Float64Array; // sum of positions and number of grains of each cell: x, y, z, n
  block: Float64Array; // the same, including the 26 neighbour cells
}

function cellsOf(positions: Float32Array, range: number): Cells {
  const count = positions.length / 3;
  const number = new Map<number, number>();
  const keys: number[] = [];
  const of = new Uint32Array(count);
  const own = new Float64Array(4 * count);
  const [width, offset] = [4096, 2048]; // cells per axis, index of the cell at the origin
  for (let i = 0; i < count; i++) {
    let key = 0;
    for (let a = 0; a < 3; a++) key = key * width + Math.floor(positions[3 * i + a] / range) + offset;
    let cell = number.get(key);
    if (cell === undefined) {
      number.set(key, (cell = keys.length));
      keys.push(key);
    }
    of[i] = cell;
    for (let a = 0; a < 3; a++) own[4 * cell + a] += positions[3 * i + a];
    own[4 * cell + 3]++;
  }
  const block = own.slice(0, 4 * keys.length);
  keys.forEach((key, cell) => {
    for (const [x, y, z] of HALF) {
      const other = number.get(key + (x * width + y) * width + z);
      if (other === undefined) continue;
      for (let a = 0; a < 4; a++) {
        block[4 * cell + a] += own[4 * other + a];
        block[4 * other + a] += own[4 * cell + a];
      }
    }
  });
  return { of, own, block };
}

/** Number of neighbours at which shading saturates. */
const SATURATION = 7;

/** Vectors (N, 3) towards the side on which each grain is occluded; lengths from 0 (free) to below 1. */
export function occlusion(positions: Float32Array, range: number): Float32Array {
  const count = positions.length / 3;
  const occluded = new Float32Array(3 * count);
  if (!count || !(range > 0)) return occluded;
  const cells = cellsOf(positions, range);
  for (let i = 0; i < count; i++) {
    const cell = 4 * cells.of[i];
    const others = cells.block[cell + 3] - 1;
    if (others < 1) continue;
    const strength = Math.min(1, others / SATURATION) / (0.6 * range);
    let length = 0;
    for (let a = 0; a < 3; a++) {
      const mean = (cells.block[cell + a] - positions[3 * i + a]) / others;
      occluded[3 * i + a] = strength * (mean - positions[3 * i + a]);
      length += occluded[3 * i + a] ** 2;
    }
    length = Math.sqrt(length);
    if (length > 0.95) for (let a = 0; a < 3; a++) occluded[3 * i + a] *= 0.95 / length;
  }
  return occluded;
}
