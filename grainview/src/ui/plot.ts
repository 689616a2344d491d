// Plots over time below the time line; a cursor marks the time of the frame shown.

import uPlot from "uplot";
import type { Plot, Series } from "../data/types";
import { digits, prefixed } from "../data/units";
import { h } from "./dom";

/** Values of the lines; on a logarithmic axis magnitudes without zeros. */
function drawable(plot: Plot): (number | null)[][] {
  return plot.lines.map((line) => (plot.log ? line.values.map((v) => (v ? Math.abs(v) : null)) : line.values));
}

function largest(lines: (number | null)[][]): number {
  let max = 0;
  for (const line of lines) for (const v of line) max = Math.max(max, Math.abs(v ?? 0));
  return max;
}

/** Labels of an axis; on a logarithmic one at most six powers of ten, with multiples of 2 and 5 below three powers. */
function labels(ticks: number[], log: boolean): string[] {
  if (!log) return ticks.map((v) => digits(v, 3));
  const power = (v: number): number | null => {
    const exponent = Math.log10(v);
    return v > 0 && Math.abs(exponent - Math.round(exponent)) < 1e-6 ? Math.round(exponent) : null;
  };
  if (ticks.filter((v) => power(v) !== null).length < 3) {
    const round = (v: number): boolean => /^[125]e/.test(Number(v.toPrecision(6)).toExponential());
    return ticks.map((v) => (v && round(v) ? digits(v, 3) : "")); // uPlot sets some of the values to null
  }
  const step = Math.ceil(ticks.filter((v) => power(v) !== null).length / 6);
  return ticks.map((v) => ((power(v) ?? 0.5) % step === 0 ? digits(v, 3) : ""));
}

export class LinkedPlot {
  readonly element = h("div", { class: "gv-plot", role: "img", "aria-label": "Plot" });
  private chart: uPlot | null = null;
  private time = 0;
  private content: { plot: Plot; series: Series; dark: boolean } | null = null;
  private readonly cursorLine = h("div", { class: "gv-cursor" });

  constructor(private readonly seek: (time: number) => void) {
    new ResizeObserver(() => this.redraw()).observe(this.element);
    this.element.addEventListener("pointerdown", (event) => this.drag(event));
    this.element.addEventListener("pointermove", (event) => event.buttons && this.drag(event));
  }

  /** Show one of the plots. */
  show(series: Series, plot: Plot, dark: boolean): void {
    this.content = { series, plot, dark };
    const lines = plot.lines.map((line) => line.label).join(", ");
    this.element.setAttribute("aria-label", `${plot.title} over time: ${lines}`);
    this.redraw();
  }

  private redraw(): void {
    const width = this.element.clientWidth;
    const height = this.element.clientHeight;
    if (!this.content || width < 80 || height < 50) return;
    const { series, plot, dark } = this.content;
    const ink = dark ? "#c9c7c1" : "#4a4f57";
    const grid = { stroke: dark ? "#2a2f3a" : "#e4e2dc", width: 1 };
    const [factor, unit] = this.timeUnit();
    const lines = drawable(plot);
    const [size, name] = plot.log ? [1, plot.unit] : prefixed(largest(lines), plot.unit);
    const scaled = lines.map((line) => line.map((v) => (v === null ? null : v / size)));
    const data = [series.time.map((t) => t / factor), ...scaled] as uPlot.AlignedData;
    const label = name ? `${plot.title} (${name})` : plot.title;
    const style = { stroke: ink, grid, ticks: grid, font: "11px system-ui", labelFont: "11px system-ui" };
    this.chart?.destroy();
    this.chart = new uPlot(
      {
        width,
        height,
        legend: { show: true, live: false },
        hooks: { ready: [() => this.moveTo(this.time)] }, // only then the chart has a size
        cursor: { show: false },
        scales: { x: { time: false }, y: { distr: plot.log ? 3 : 1 } },
        axes: [
          { ...style, label: `time (${unit})`, size: 32, labelSize: 16 },
          { ...style, label, size: 64, labelSize: 18, values: (_: uPlot, ticks: number[]) => labels(ticks, plot.log) },
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
    this.element.append(this.cursorLine);
  }

  private timeUnit(): [number, string] {
    const times = this.content?.series.time ?? [];
    return prefixed(Math.max(...times.slice(-1), 0), "s");
  }

  /** Move the cursor to a time [s]. */
  moveTo(time: number): void {
    this.time = time;
    if (!this.chart) return;
    const [outer, box] = [this.element.getBoundingClientRect(), this.chart.over.getBoundingClientRect()];
    const x = this.chart.valToPos(time / this.timeUnit()[0], "x");
    this.cursorLine.style.left = `${box.left - outer.left + x}px`;
    this.cursorLine.style.top = `${box.top - outer.top}px`;
    this.cursorLine.style.height = `${box.height}px`;
    this.cursorLine.hidden = !(x >= -1 && x <= box.width + 1);
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
