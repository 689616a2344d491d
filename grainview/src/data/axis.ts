// The vertical axis of a plot: where a value lies, the range, ticks and their labels. Every loop is limited by the
// number of ticks, whatever the values are.

import { extent } from "./quantities";
import type { Plot } from "./types";
import { digits } from "./units";

export interface Axis {
  /** Place of a value on the axis; null if it has none, as for 0 on a logarithmic axis. */
  place(value: number | null): number | null;
  /** Places of the ends. */
  low: number;
  high: number;
  ticks: { place: number; label: string }[];
}

/** Share of the range that is left free beyond the values. */
const MARGIN = 0.06;
/** Relative differences up to which values count as one, so that labels of twelve digits differ. */
const ROUNDING = 1e-9;
/** Powers of ten on an axis up to which ticks are also at multiples of them, the first of these that have room. */
const FEW = 2.5;
const FACTORS = [[1, 2, 3, 4, 5, 6, 8], [1, 2, 3, 5], [1, 2, 5], [1, 3], [1]];

/** Multiples of a round number between two values, at most `room` + 1 of them. */
function multiples(low: number, high: number, room: number): number[] {
  const least = high / room - low / room; // the difference of huge numbers may be infinite
  if (!(least > 0)) return [];
  const power = 10 ** Math.floor(Math.log10(least));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= least * (1 - 1e-9)) ?? NaN;
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - first;
  if (!(step > 0) || !(count >= 0)) return [];
  return Array.from({ length: Math.min(count, room) + 1 }, (_, k) => Number(((first + k) * step).toPrecision(15)));
}

/** Digits by which neighbouring multiples differ. */
function labelsOf(values: number[]): string[] {
  const size = Math.max(...values.map(Math.abs), 0);
  const step = values.length > 1 ? Math.abs(values[1] - values[0]) : size;
  const count = Math.min(Math.max(Math.floor(Math.log10(size / step)) + 2, 3) || 3, 12);
  return values.map((v) => digits(v, count));
}

/** A power of ten: "1000", "10⁻¹⁸". */
const powerText = (value: number): string => digits(value, 3).replace(/^(−?)1×/, "$1");

/** Integers between two places, evenly, at most `room` + 1 of them: exponents of ten. */
function exponents(low: number, high: number, room: number): number[] {
  if (!(high >= low)) return [];
  const step = Math.max(Math.ceil((high - low) / Math.max(room, 1)), 1);
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - first;
  return count >= 0 ? Array.from({ length: count + 1 }, (_, k) => (first + k) * step) : [];
}

function linear(values: number[], room: number): Axis {
  let [low, high] = extent(values) ?? [0, 1];
  const isFlat = !(high - low > ROUNDING * Math.max(Math.abs(low), Math.abs(high)));
  const margin = isFlat ? 0.1 * Math.abs(low) || 1 : MARGIN * high - MARGIN * low;
  [low, high] = [low - margin, high + margin];
  const ticks = multiples(low, high, room);
  const labels = labelsOf(ticks);
  return { place: (v) => v, low, high, ticks: ticks.map((place, k) => ({ place, label: labels[k] })) };
}

/** Of magnitudes; those below `least` lie beyond the lower end. */
function logarithmic(values: number[], least: number, room: number): Axis {
  const sizes = values.map(Math.abs).filter((v) => v >= least && v > 0);
  const place = (v: number | null): number | null => (v ? Math.log10(Math.abs(v)) : null);
  if (!sizes.length) return { place, low: 0, high: 1, ticks: [] };
  let [low, high] = (extent(sizes) ?? [1, 10]).map(Math.log10);
  const margin = Math.max(MARGIN * (high - low), 0.05);
  [low, high] = [low - margin, high + margin];
  if (high - low > FEW) {
    let places = exponents(low, high, room);
    for (let more = room + 1; places.length < 2 && more < room + 4; more++) places = exponents(low, high, more);
    return { place, low, high, ticks: places.map((n) => ({ place: n, label: powerText(10 ** n) })) };
  }
  const [from, to] = [10 ** low, 10 ** high];
  const sets = FACTORS.map((factors) => (
    exponents(low - 1, high, 8).flatMap((n) => factors.map((m) => Number((m * 10 ** n).toPrecision(6))))
      .filter((v) => v >= from && v <= to)
  ));
  const round = sets.find((set) => set.length <= room) ?? [];
  const ticks = round.length > 1 ? round : multiples(from, to, room).filter((v) => v > 0);
  const labels = labelsOf(ticks);
  return { place, low, high, ticks: ticks.map((v, k) => ({ place: Math.log10(v), label: labels[k] })) };
}

/** Linear from −`least` to `least`, a part as long as two powers of ten, and logarithmic on both sides. */
function symmetric(values: number[], least: number, room: number): Axis {
  const at = (v: number): number => (
    Math.abs(v) <= least ? v / least : Math.sign(v) * (1 + Math.log10(Math.abs(v)) - Math.log10(least))
  );
  const places = [0, ...values.map(at)];
  const [lowest, highest] = [places.reduce((a, b) => Math.min(a, b)), places.reduce((a, b) => Math.max(a, b))];
  const margin = Math.max(MARGIN * (highest - lowest), 0.2);
  const [low, high] = [lowest - margin, highest + margin];
  const step = Math.max(Math.ceil((high - low) / room), 1);
  const side = (sign: number, end: number): Axis["ticks"] => (
    exponents(0, end - 1, (end - 1) / step)
      .map((n) => ({ place: sign * (n + 1), label: powerText(sign * 10 ** (Math.log10(least) + n)) }))
  );
  const ticks = [...side(-1, -low).reverse(), { place: 0, label: "0" }, ...side(1, high)];
  return { place: (v) => (v === null ? null : at(v)), low, high, ticks };
}

/** The axis for all values of a plot; `room`: about how many ticks there shall be. */
export function axisOf({ axis, least, lines }: Pick<Plot, "axis" | "least" | "lines">, room: number): Axis {
  const values = lines.flatMap((line) => line.values.filter((v): v is number => v !== null && Number.isFinite(v)));
  if (axis === "log") return logarithmic(values, least ?? 0, room);
  if (axis === "symlog" && least !== null && least > 0) return symmetric(values, least, room);
  return linear(values, room);
}
