// Plots over time below the time line; a cursor marks the time of the frame shown.

import uPlot from "uplot";
import { type Axis, axisOf } from "../data/axis";
import type { Line, Plot, Series } from "../data/types";
import { prefixed } from "../data/units";
import { h } from "./dom";

/** Pixels between ticks of the vertical axis, about; height of what lies below the plotted area. */
const [SPACING, BELOW] = [20, 44];

/** The largest magnitude of all values. */
function largest({ lines }: Plot): number {
  return lines.reduce((max, line) => line.values.reduce<number>((top, v) => Math.max(top, Math.abs(v ?? 0)), max), 0);
}

export class LinkedPlot {
  readonly element = h("div", { class: "gv-plot", role: "img", "aria-label": "Plot" });
  private chart: uPlot | null = null;
  /** The vertical axis of the plot shown. */
  axis: Axis | null = null;
  /** Title and legend, above the chart. */
  private readonly head = h("div", { class: "gv-plot-head" });
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
    const colourOf = (line: Line): string => (dark ? line.dark : line.light);
    const [factor, unit] = this.timeUnit();
    const [size, name] = plot.axis === "linear" ? prefixed(largest(plot), plot.unit) : [1, plot.unit];
    const lines = plot.lines.map((line) => ({ ...line, values: line.values.map((v) => (v === null ? v : v / size)) }));
    this.head.replaceChildren(h("span", { class: "gv-plot-title" }, name ? `${plot.title} (${name})` : plot.title));
    this.element.append(this.head);
    const tall = height - this.head.offsetHeight;
    const axis = (this.axis = axisOf({ ...plot, lines }, Math.max((tall - BELOW) / SPACING, 2)));
    // uPlot is told places from 0 to 1: its own ticks of small numbers do not end (of 1.0000000000000001e-24, say)
    const span = axis.high / 2 - axis.low / 2;
    const share = (place: number | null): number | null => (place === null ? null : (place / 2 - axis.low / 2) / span);
    const shares = lines.map((line) => line.values.map((v) => share(axis.place(v))));
    const data = [series.time.map((t) => t / factor), ...shares] as uPlot.AlignedData;
    const style = { stroke: ink, grid, ticks: grid, font: "11px system-ui", labelFont: "11px system-ui" };
    const ticks = { splits: axis.ticks.map((tick) => share(tick.place) ?? 0), values: axis.ticks.map((t) => t.label) };
    this.chart?.destroy();
    this.chart = new uPlot(
      {
        width,
        height: tall,
        padding: [8, 14, 0, 0],
        legend: {
          show: true, live: false, mount: (_, table) => this.head.append(table),
          markers: { width: 0, fill: (_, k) => colourOf(plot.lines[k - 1]) },
        },
        hooks: { ready: [() => this.moveTo(this.time)] }, // only then the chart has a size
        cursor: { show: false },
        scales: { x: { time: false }, y: { range: [0, 1] } },
        axes: [
          { ...style, label: `time (${unit})`, size: 28, labelSize: 16 },
          { ...style, size: 64, splits: () => ticks.splits, values: () => ticks.values },
        ],
        series: [
          {},
          ...plot.lines.map((line) => ({
            label: line.label,
            stroke: colourOf(line),
            width: 1.6,
            points: { show: series.time.length < 3 },
          })),
        ],
      },
      data,
      this.element,
    );
    this.head.querySelectorAll<HTMLElement>(".u-series").forEach((row, k) => {
      row.title = [plot.lines[k].hint, "click: show or hide"].filter(Boolean).join("; ");
    });
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
