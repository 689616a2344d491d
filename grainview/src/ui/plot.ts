// Quantities over time, under the time line: the cursor is the frame that is looked at.

import uPlot from "uplot";
import type { Plot, Series } from "../data/types";
import { digits, prefixed } from "../data/units";
import { h } from "./dom";

/** Zero and less have no place on a logarithmic axis; energies of both signs stay linear. */
function drawable(plot: Plot): (number | null)[][] {
  return plot.lines.map((line) => (plot.log ? line.values.map((v) => (v !== null && v > 0 ? v : null)) : line.values));
}

function largest(lines: (number | null)[][]): number {
  let most = 0;
  for (const line of lines) for (const v of line) most = Math.max(most, Math.abs(v ?? 0));
  return most;
}

/** Numbers at an axis; of a logarithmic one of powers of ten, at most six, with 2 and 5 where these are few. */
function numbers(at: number[], log: boolean): string[] {
  if (!log) return at.map((v) => digits(v, 3));
  const power = (v: number): number | null => {
    const exponent = Math.log10(v);
    return v > 0 && Math.abs(exponent - Math.round(exponent)) < 1e-6 ? Math.round(exponent) : null;
  };
  if (at.filter((v) => power(v) !== null).length < 3) {
    const round = (v: number): boolean => /^[125]e/.test(Number(v.toPrecision(6)).toExponential());
    return at.map((v) => (v && round(v) ? digits(v, 3) : "")); // uPlot takes some of them away itself: null
  }
  const step = Math.ceil(at.filter((v) => power(v) !== null).length / 6);
  return at.map((v) => ((power(v) ?? 0.5) % step === 0 ? digits(v, 3) : ""));
}

export class LinkedPlot {
  readonly element = h("div", { class: "gv-plot", role: "img", "aria-label": "Plot" });
  private chart: uPlot | null = null;
  private cursor = 0;
  private shown: { plot: Plot; series: Series; dark: boolean } | null = null;
  private readonly line = h("div", { class: "gv-cursor" });

  constructor(private readonly seek: (time: number) => void) {
    new ResizeObserver(() => this.redraw()).observe(this.element);
    this.element.addEventListener("pointerdown", (event) => this.drag(event));
    this.element.addEventListener("pointermove", (event) => event.buttons && this.drag(event));
  }

  /** Draw one of the plots. */
  show(series: Series, plot: Plot, dark: boolean): void {
    this.shown = { series, plot, dark };
    const lines = plot.lines.map((line) => line.label).join(", ");
    this.element.setAttribute("aria-label", `${plot.title} over time: ${lines}`);
    this.redraw();
  }

  private redraw(): void {
    const width = this.element.clientWidth;
    const height = this.element.clientHeight;
    if (!this.shown || width < 80 || height < 50) return;
    const { series, plot, dark } = this.shown;
    const ink = dark ? "#c9c7c1" : "#4a4f57";
    const grid = { stroke: dark ? "#2a2f3a" : "#e4e2dc", width: 1 };
    const [one, unit] = this.timeUnit();
    const lines = drawable(plot);
    const [size, name] = plot.log ? [1, plot.unit] : prefixed(largest(lines), plot.unit);
    const scaled = lines.map((line) => line.map((v) => (v === null ? null : v / size)));
    const data = [series.time.map((t) => t / one), ...scaled] as uPlot.AlignedData;
    const label = name ? `${plot.title} (${name})` : plot.title;
    const style = { stroke: ink, grid, ticks: grid, font: "11px system-ui", labelFont: "11px system-ui" };
    this.chart?.destroy();
    this.chart = new uPlot(
      {
        width,
        height,
        legend: { show: true, live: false },
        hooks: { ready: [() => this.moveTo(this.cursor)] }, // before that it has no size
        cursor: { show: false },
        scales: { x: { time: false }, y: { distr: plot.log ? 3 : 1 } },
        axes: [
          { ...style, label: `time (${unit})`, size: 32, labelSize: 16 },
          { ...style, label, size: 64, labelSize: 18, values: (_: uPlot, at: number[]) => numbers(at, plot.log) },
        ],
        series: [
          {},
          ...plot.lines.map((line) => ({
            label: line.label,
            stroke: dark ? line.dark : line.light,
            width: 1.6,
            points: { show: series.time.length < 3 },
          })),
        ],
      },
      data,
      this.element,
    );
    this.element.append(this.line);
  }

  private timeUnit(): [number, string] {
    const times = this.shown?.series.time ?? [];
    return prefixed(Math.max(...times.slice(-1), 0), "s");
  }

  /** Put the cursor at a time [s]. */
  moveTo(time: number): void {
    this.cursor = time;
    if (!this.chart) return;
    const [outer, box] = [this.element.getBoundingClientRect(), this.chart.over.getBoundingClientRect()];
    const x = this.chart.valToPos(time / this.timeUnit()[0], "x");
    this.line.style.left = `${box.left - outer.left + x}px`;
    this.line.style.top = `${box.top - outer.top}px`;
    this.line.style.height = `${box.height}px`;
    this.line.hidden = !(x >= -1 && x <= box.width + 1);
  }

  private drag(event: PointerEvent): void {
    if (!this.chart || !(event.target as HTMLElement).closest(".u-over, .gv-cursor")) return;
    const x = event.clientX - this.chart.over.getBoundingClientRect().left;
    this.seek(this.chart.posToVal(x, "x") * this.timeUnit()[0]);
  }

  dispose(): void {
    this.chart?.destroy();
  }
}
