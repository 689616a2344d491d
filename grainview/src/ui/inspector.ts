// Rows of numbers of what is chosen: a grain, a contact, a cluster, a distance.

import { MODES, normalForce, worstMode } from "../data/bonds";
import { measureCluster, membersOf, nearest } from "../data/clusters";
import { type Known, QUANTITIES } from "../data/quantities";
import { type Dimension, type Frame, SINGLE } from "../data/types";
import { digits, prefixed, quantity } from "../data/units";
import { h } from "./dom";
import { button } from "./icons";

type Row = [name: string, value: string];

const vector = (v: Float32Array, i: number, scale = 1): number[] => [0, 1, 2].map((a) => v[3 * i + a] * scale);

/** Components of a vector, in the unit that suits its size. */
function components(v: number[], unit: string, count?: number): string {
  const [one, name] = prefixed(Math.hypot(...v), unit);
  return `${v.map((x) => digits(x / one, count)).join(", ")} ${name}`;
}

/** Size and components of a vector. */
function told(v: number[], unit: string): string {
  return `${quantity(Math.hypot(...v), unit)}\n${components(v, unit, 3)}`;
}

export function grainRows(i: number, frame: Frame, known: Known): Row[] {
  const { manifest, grains } = known;
  const names = ["coordination", "kinetic_energy", "alignment", "field_alignment"];
  const own = QUANTITIES.filter((q) => names.includes(q.id));
  const rows: Row[] = [
    ["position", components(vector(frame.position, i, manifest.unit), "m", 5)],
    ["radius", quantity(grains.radius[i] * manifest.unit, "m")],
    ["material", manifest.materials[grains.material[i]] ?? "not known"],
    ["mass", quantity(grains.mass[i], "kg")],
    ["velocity", told(vector(frame.velocity, i), "m/s")],
    ["spin", told(vector(frame.spin, i), "rad/s")],
    ["moment", told(vector(frame.moment, i), "A m²")],
  ];
  if (grains.charge[i]) rows.push(["charge", quantity(grains.charge[i], "C")]);
  for (const one of own.filter((q) => q.available?.(known) ?? true)) {
    rows.push([one.label, quantity(one.values(frame, known)[i], one.unit)]);
  }
  return rows;
}

export function contactRows(c: number, frame: Frame, known: Known): Row[] {
  const [i, j] = [frame.pair[2 * c], frame.pair[2 * c + 1]];
  const normal = normalForce(frame, c, known.manifest.periodic);
  const [mode, most] = worstMode(frame, c);
  const rows: Row[] = [
    ["grains", `${i} and ${j}`],
    ["overlap", quantity(frame.overlap[c], "m")],
    ["first touch", quantity(frame.formed[c], "s")],
    ["normal force", `${quantity(normal, "N")}${normal < 0 ? " (pull)" : normal > 0 ? " (push)" : ""}`],
    ["force", told(vector(frame.force, c), "N")],
  ];
  MODES.forEach((name, m) => rows.push([`${name}, of its limit`, digits(frame.share[4 * c + m], 3)]));
  if (mode >= 0) rows.push(["nearest its limit", `${MODES[mode]}, ${digits(most, 3)}`]);
  return rows;
}

/** D ± its error, or why there is none; null: on its way. */
function fractal(found: Dimension | null): string {
  if (found === null) return "…";
  if ("reason" in found) return found.reason;
  const value = digits(found.value, 3);
  return found.value === null ? value : `${value} ± ${digits(found.error, 1)}`;
}

export function clusterRows(
  i: number,
  frame: Frame,
  known: Known,
  whole: Float32Array,
  dimension: Dimension | null,
): Row[] {
  const { manifest, grains } = known;
  const one = measureCluster(frame, grains, whole, membersOf(frame, i));
  return [
    ["grains N", String(one.grains)],
    ["contacts", String(one.contacts)],
    ["mass", quantity(one.mass, "kg")],
    ["centre", components(one.centre.map((x) => x * manifest.unit), "m")],
    ["velocity", told(one.velocity, "m/s")],
    ["radius of gyration", quantity(one.gyration * manifest.unit, "m")],
    ["moment", told(one.moment, "A m²")],
    ["over the sum of sizes", digits(one.alignment)],
    ["fractal dimension", fractal(dimension)],
  ];
}

/** Distance between two grains [m], by the nearest image: of centres, and of surfaces. */
export function distanceRows(i: number, j: number, frame: Frame, known: Known): Row[] {
  const { manifest, grains } = known;
  const d = [0, 1, 2].map((a) =>
    nearest(frame.position[3 * j + a] - frame.position[3 * i + a], frame.box[a], manifest.periodic[a]),
  );
  const size = Math.hypot(...d) * manifest.unit;
  const gap = size - (grains.radius[i] + grains.radius[j]) * manifest.unit;
  return [
    ["grains", `${i} and ${j}`],
    ["between centres", quantity(size, "m", 5)],
    [gap < 0 ? "overlap" : "between surfaces", quantity(Math.abs(gap), "m")],
    ["along x, y, z", components(d.map((x) => x * manifest.unit), "m")],
  ];
}

export function isSingle(frame: Frame, grain: number): boolean {
  return frame.cluster[grain] === SINGLE;
}

/** The box that shows rows of what is chosen. */
export class Inspector {
  readonly element = h("section", { class: "gv-inspector", "aria-label": "What is chosen", hidden: true });

  private readonly tables = h("div", {});

  constructor(clear: () => void) {
    const close = button("close", "Choose nothing", clear, "Esc");
    close.classList.add("gv-close");
    this.element.append(close, this.tables); // the button stays, and the focus with it
  }

  show(parts: [title: string, rows: Row[]][]): void {
    this.element.hidden = parts.length === 0;
    const tables = parts.map(([title, rows]) => {
      const body = rows.map(([name, value]) => h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, value)));
      return h("table", {}, h("caption", {}, title), h("tbody", {}, ...body));
    });
    this.tables.replaceChildren(...tables);
  }
}
