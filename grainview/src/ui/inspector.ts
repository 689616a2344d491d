// Tables of values of the selection: a grain, a contact, a cluster, a distance.

import { MODES, limitingMode, normalForce } from "../data/bonds";
import { measureCluster, membersOf, nearestImage } from "../data/clusters";
import { type Dataset, quantitiesOf } from "../data/quantities";
import { type Dimension, type Frame, SINGLE } from "../data/types";
import { digits, prefixed, quantity } from "../data/units";
import { h } from "./dom";
import { button } from "./icons";

type Row = [name: string, value: string, hint?: string];

export type Table = [title: string, rows: Row[]];

const vector = (v: Float32Array, i: number, scale = 1): number[] => [0, 1, 2].map((a) => v[3 * i + a] * scale);

/** Components of a vector, with the unit prefix for its magnitude. */
function components(v: number[], unit: string, count?: number): string {
  const [factor, name] = prefixed(Math.hypot(...v), unit);
  return `${v.map((x) => digits(x / factor, count)).join(", ")} ${name}`;
}

/** Magnitude and components of a vector. */
function magnitudeAndComponents(v: number[], unit: string): string {
  return `${quantity(Math.hypot(...v), unit)}\n${components(v, unit, 3)}`;
}

export function grainRows(i: number, frame: Frame, dataset: Dataset): Row[] {
  const { manifest, grains } = dataset;
  const own = manifest.own.map((q) => q.id);
  const names = ["coordination", "kinetic_energy", "pressure", "alignment", "field_alignment", ...own];
  const others = quantitiesOf(manifest).filter((q) => names.includes(q.id));
  const rows: Row[] = [
    ["position", components(vector(frame.position, i, manifest.unit), "m", 5)],
    ["radius", quantity(grains.radius[i] * manifest.unit, "m")],
    ["material", manifest.materials[grains.material[i]] ?? "not known"],
    ["mass", quantity(grains.mass[i], "kg")],
    ["velocity", magnitudeAndComponents(vector(frame.velocity, i), "m/s")],
    ["spin", magnitudeAndComponents(vector(frame.spin, i), "rad/s")],
    ["moment", magnitudeAndComponents(vector(frame.moment, i), "A m²")],
  ];
  if (frame.at_rest) rows.push(["moves", frame.at_rest[i] ? "at rest, as a rigid body" : "awake, by contact steps"]);
  if (frame.charge?.[i]) rows.push(["charge", quantity(frame.charge[i], "C")]);
  for (const q of others.filter((other) => other.available?.(dataset) ?? true)) {
    rows.push([q.label, quantity(q.values(frame, dataset)[i], q.unit)]);
  }
  return rows;
}

export function contactRows(c: number, frame: Frame, dataset: Dataset): Row[] {
  const { hints } = dataset.manifest;
  const [i, j] = [frame.pair[2 * c], frame.pair[2 * c + 1]];
  const normal = normalForce(frame, c, dataset.manifest.periodic);
  const [mode, share] = limitingMode(frame, c);
  const rows: Row[] = [
    ["grains", `${i} and ${j}`],
    ["overlap", quantity(frame.overlap[c], "m"), hints.overlap],
    ["first touch", quantity(frame.formed[c], "s")],
    ["normal force", `${quantity(normal, "N")}${normal < 0 ? " (pull)" : normal > 0 ? " (push)" : ""}`],
    ["force", magnitudeAndComponents(vector(frame.force, c), "N")],
  ];
  MODES.forEach((name, m) => rows.push([`${name} / limit`, digits(frame.share[4 * c + m], 3), hints[`${name}_share`]]));
  if (mode >= 0) rows.push(["closest to limit", `${MODES[mode]}, ${digits(share, 3)}`]);
  return rows;
}

/** D ± error, or the reason why there is none; null while it is being requested. */
function fractalDimension(dimension: Dimension | null): string {
  if (dimension === null) return "…";
  if ("reason" in dimension) return dimension.reason;
  const value = digits(dimension.value, 3);
  return dimension.value === null ? value : `${value} ± ${digits(dimension.error, 1)}`;
}

export function clusterRows(
  i: number,
  frame: Frame,
  dataset: Dataset,
  whole: Float32Array,
  dimension: Dimension | null,
): Row[] {
  const { manifest, grains } = dataset;
  const cluster = measureCluster(frame, grains, whole, membersOf(frame, i));
  return [
    ["grains N", String(cluster.grains)],
    ["contacts", String(cluster.contacts)],
    ["mass", quantity(cluster.mass, "kg")],
    ["centre", components(cluster.centre.map((x) => x * manifest.unit), "m")],
    ["velocity", magnitudeAndComponents(cluster.velocity, "m/s")],
    ["radius of gyration", quantity(cluster.gyration * manifest.unit, "m")],
    ["moment", magnitudeAndComponents(cluster.moment, "A m²")],
    ["|Σμ| / Σ|μ|", digits(cluster.alignment)],
    ["fractal dimension", fractalDimension(dimension)],
  ];
}

/** Distances of centres and surfaces of two grains, by the nearest image. */
export function distanceRows(i: number, j: number, frame: Frame, dataset: Dataset): Row[] {
  const { manifest, grains } = dataset;
  const apart = [0, 1, 2].map((a) => frame.position[3 * j + a] - frame.position[3 * i + a]);
  const d = nearestImage(apart, frame, manifest.periodic);
  const distance = Math.hypot(...d) * manifest.unit;
  const gap = distance - (grains.radius[i] + grains.radius[j]) * manifest.unit;
  return [
    ["grains", `${i} and ${j}`],
    ["between centres", quantity(distance, "m", 5)],
    [gap < 0 ? "overlap" : "between surfaces", quantity(Math.abs(gap), "m")],
    ["along x, y, z", components(d.map((x) => x * manifest.unit), "m")],
  ];
}

export function isSingle(frame: Frame, grain: number): boolean {
  return frame.cluster[grain] === SINGLE;
}

/** Shows the tables of the selection. */
export class Inspector {
  readonly element = h("section", { class: "gv-inspector", "aria-label": "Selection", hidden: true });

  private readonly content = h("div", {});

  constructor(clear: () => void) {
    const close = button("close", "Clear selection", clear, "Esc");
    close.classList.add("gv-close");
    this.element.append(close, this.content); // the button persists and keeps the focus
  }

  show(tables: Table[]): void {
    this.element.hidden = tables.length === 0;
    const elements = tables.map(([title, rows]) => {
      const body = rows.map(([name, value, title]) => (
        h("tr", { title }, h("th", { scope: "row" }, name), h("td", {}, value))
      ));
      return h("table", {}, h("caption", {}, title), h("tbody", {}, ...body));
    });
    this.content.replaceChildren(...elements);
  }
}
