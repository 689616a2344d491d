// What the frame shown holds as a whole: energy lost by each mechanism, net moment, field, clusters at rest.

import type { Shares } from "./key";
import { type Dataset, fieldDirection, fieldSize } from "./quantities";
import { type Frame, SINGLE, type Series } from "./types";
import { digits, quantity } from "./units";

/** Rows of mechanisms; the others are summed up in one. */
const MAX_ROWS = 6;

const percent = (share: number): string => (share > 0 && share < 0.01 ? "< 1 %" : `${Math.round(100 * share)} %`);

/** The last row of the series not after a time; −1 before the first one. */
function rowAt(times: number[], time: number): number {
  let [low, high] = [-1, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time * (1 + 1e-9)) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** Energy lost by each mechanism since the start, by the ledger at the time of the frame; gains have no share. */
function losses(series: Series, time: number, dark: boolean): Shares[] {
  const plot = series.plots.find((p) => p.id === "losses");
  const row = rowAt(series.time, time);
  if (!plot?.lines.length || row < 0) return [];
  const all = plot.lines.map((line) => (
    { text: line.label, hint: line.hint, colour: dark ? line.dark : line.light, size: line.values[row] ?? 0 }
  ));
  const found = all.filter((one) => one.size > 0).sort((a, b) => b.size - a.size);
  const gains = all.filter((one) => one.size < 0).map(({ text, hint, colour, size }) => (
    { colour, hint, text: `${text}: gained ${quantity(-size, plot.unit, 2)}` }
  ));
  const total = found.reduce((sum, one) => sum + one.size, 0);
  const rows = found.slice(0, MAX_ROWS).map(({ text, hint, colour, size }) => (
    { colour, hint, text: `${text} ${percent(size / total)}` }
  ));
  const others = found.slice(MAX_ROWS).reduce((sum, one) => sum + one.size, 0);
  return [{
    title: `energy lost: ${quantity(total, plot.unit, 3)}`,
    shares: found.map(({ colour, size }) => ({ colour, share: size / total })),
    rows: [...rows, ...(others ? [{ colour: null, text: `others ${percent(others / total)}` }] : []), ...gains],
  }];
}

/** The sum Σμ of the moments over Σ|μ|; null if there are none. */
export function netMoment(frame: Frame): [number, number, number] | null {
  const sum: [number, number, number] = [0, 0, 0];
  const { moment, position } = frame;
  let size = 0;
  for (let i = 0; i < moment.length; i += 3) {
    if (Number.isNaN(position[i])) continue; // an absent grain
    for (let a = 0; a < 3; a++) sum[a] += moment[i + a];
    size += Math.hypot(moment[i], moment[i + 1], moment[i + 2]);
  }
  return size > 0 ? (sum.map((x) => x / size) as [number, number, number]) : null;
}

/** Colours of the arrows of the field and of the net moment, light and dark; style.css has them, too. */
export const [FIELD, MOMENT] = [["#d55e00", "#e69f00"], ["#0072b2", "#56b4e9"]];

function moments(frame: Frame, field: number[] | null, dark: boolean): Shares[] {
  const net = netMoment(frame);
  if (!net) return [];
  const size = Math.hypot(...net);
  const strength = field ? Math.hypot(...field) : 0;
  const along = strength ? net.reduce((sum, m, a) => sum + (m * (field?.[a] ?? 0)) / strength, 0) : null;
  const colour = MOMENT[Number(dark)];
  const rows = [{ colour, text: along === null ? "net moment" : `${digits(100 * along, 2)} % along the field` }];
  return [{ title: `net moment: ${percent(size)} of Σ|μ|`, shares: [{ colour, share: size }], rows }];
}

function field({ manifest }: Dataset, frame: Frame, dark: boolean): Shares[] {
  const size = fieldSize(manifest, frame.frame);
  if (size === null || !manifest.field) return [];
  const { sizes, directions, text } = manifest.field;
  const rows = [{ colour: FIELD[Number(dark)], text: sizes || directions ? text : "constant" }];
  return [{ title: `field: B = ${quantity(size, "T", 3)}`, shares: [], rows }];
}

function rest({ manifest }: Dataset, { at_rest: flags, cluster, position }: Frame): Shares[] {
  if (!flags) return [];
  const counts = [0, 0, 0]; // grains of awake clusters, of clusters at rest, single ones
  const awake = new Map<number, boolean>();
  cluster.forEach((name, i) => {
    if (Number.isNaN(position[3 * i])) return;
    counts[name === SINGLE ? 2 : flags[i]]++;
    if (name !== SINGLE) awake.set(name, flags[i] === 0);
  });
  const grains = counts[0] + counts[1] + counts[2];
  const resting = [...awake.values()].filter((on) => !on).length;
  const colours = [...manifest.colours.rest, null];
  const words = ["awake (contact steps)", "at rest (rigid)", "single, not counted"];
  return [{
    title: `rigid clusters (at rest): ${resting} of ${awake.size}`,
    hint: "Clusters of two grains and more; single grains are not counted. Clusters at rest move as rigid bodies.",
    shares: manifest.colours.rest.map((colour, k) => ({ colour, share: counts[k] / grains })),
    rows: counts.map((count, k) => ({ colour: colours[k], text: `${count} ${words[k]}` })),
  }];
}

/** What is told of a frame as a whole: bars in the order in which they are shown, and directions as arrows. */
export interface Told {
  glance: Shares[];
  directions: { field: number[] | null; moment: number[] | null };
}

export function toldOf(dataset: Dataset, series: Series, frame: Frame | null, dark: boolean): Told {
  if (!frame) return { glance: [], directions: { field: null, moment: null } };
  const direction = fieldDirection(dataset.manifest, frame.frame);
  const glance = [
    ...losses(series, frame.time, dark), ...field(dataset, frame, dark), ...moments(frame, direction, dark),
    ...rest(dataset, frame),
  ];
  return { glance, directions: { field: direction, moment: netMoment(frame) } };
}
