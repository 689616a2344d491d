// Light that reaches a grain: neighbours that crowd one side of it shade that side.  A look, not a measurement.

/** The 13 of 26 neighbours of a cell that come after it; the others see it from their side. */
const AFTER: number[][] = [];
for (const x of [-1, 0, 1]) {
  for (const y of [-1, 0, 1]) {
    for (const z of [-1, 0, 1]) if (x * 9 + y * 3 + z > 0) AFTER.push([x, y, z]);
  }
}

interface Cells {
  of: Uint32Array; // cell of each grain
  own: Float64Array; // sum of places and number of grains of each cell: x, y, z, n
  all: Float64Array; // the same with the 26 cells around it
}

function cellsOf(place: Float32Array, reach: number): Cells {
  const count = place.length / 3;
  const number = new Map<number, number>();
  const keys: number[] = [];
  const of = new Uint32Array(count);
  const own = new Float64Array(4 * count);
  const [wide, middle] = [4096, 2048];
  for (let i = 0; i < count; i++) {
    let key = 0;
    for (let a = 0; a < 3; a++) key = key * wide + Math.floor(place[3 * i + a] / reach) + middle;
    let cell = number.get(key);
    if (cell === undefined) {
      number.set(key, (cell = keys.length));
      keys.push(key);
    }
    of[i] = cell;
    for (let a = 0; a < 3; a++) own[4 * cell + a] += place[3 * i + a];
    own[4 * cell + 3]++;
  }
  const all = own.slice(0, 4 * keys.length);
  keys.forEach((key, cell) => {
    for (const [x, y, z] of AFTER) {
      const other = number.get(key + (x * wide + y) * wide + z);
      if (other === undefined) continue;
      for (let a = 0; a < 4; a++) {
        all[4 * cell + a] += own[4 * other + a];
        all[4 * other + a] += own[4 * cell + a];
      }
    }
  });
  return { of, own, all };
}

/** Neighbours within reach from which on a side is as dark as it gets. */
const CROWD = 7;

/** Directions (N, 3) in which each grain is covered, as long as it is much, below 1; 0 in the open. */
export function coverOf(place: Float32Array, reach: number): Float32Array {
  const count = place.length / 3;
  const cover = new Float32Array(3 * count);
  if (!count || !(reach > 0)) return cover;
  const cells = cellsOf(place, reach);
  for (let i = 0; i < count; i++) {
    const cell = 4 * cells.of[i];
    const others = cells.all[cell + 3] - 1;
    if (others < 1) continue;
    const much = Math.min(1, others / CROWD) / (0.6 * reach);
    let size = 0;
    for (let a = 0; a < 3; a++) {
      const mean = (cells.all[cell + a] - place[3 * i + a]) / others;
      cover[3 * i + a] = much * (mean - place[3 * i + a]);
      size += cover[3 * i + a] ** 2;
    }
    size = Math.sqrt(size);
    if (size > 0.95) for (let a = 0; a < 3; a++) cover[3 * i + a] *= 0.95 / size;
  }
  return cover;
}
