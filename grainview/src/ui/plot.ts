// Quantities over time, under the time line: the cursor is the frame that is looked at.

import uPlot from "uplot";
import type { Plot, Series } from "../data/types";
import { prefixed } from "../data/units";
import { h } from "./dom";

/** Zero and less have no place on a logarithmic axis; energies of both signs stay linear. */
function drawable(plot: Plot): (number | null)[][] {
  return plot.lines.map((line) => (plot.log ? line.values.map((v) => (v !== null && v > 0 ? v : null)) : line.values));
}

export class LinkedPlot {
  readonly element = h("div", { class: "gv-plot" });
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
    const data = [series.time.map((t) => t / one), ...drawable(plot)] as uPlot.AlignedData;
    const label = plot.unit ? `${plot.title} (${plot.unit})` : plot.title;
    const style = { stroke: ink, grid, ticks: grid, font: "11px system-ui", labelFont: "11px system-ui" };
    this.chart?.destroy();
    this.chart = new uPlot(
      {
        width,
        height,
        legend: { show: true, live: false },
        cursor: { show: false },
        scales: { x: { time: false }, y: { distr: plot.log ? 3 : 1 } },
        axes: [
          { ...style, label: `time (${unit})`, size: 32, labelSize: 16 },
          { ...style, label, size: 58, labelSize: 18 },
        ],
        series: [
          {},
          ...plot.lines.map((l) => ({ label: l.label, stroke: dark ? l.dark : l.light, width: 1.6, points: { show: false } })),
        ],
      },
      data,
      this.element,
    );
    this.element.append(this.line);
    this.moveTo(this.cursor);
  }

  private timeUnit(): [number, string] {
    const times = this.shown?.series.time ?? [];
    return prefixed(Math.max(...times.slice(-1), 0), "s");
  }

  /** Put the cursor at a time [s]. */
  moveTo(time: number): void {
    this.cursor = time;
    if (!this.chart) return;
    const box = this.chart.over;
    const x = this.chart.valToPos(time / this.timeUnit()[0], "x");
    this.line.style.left = `${box.offsetLeft + x}px`;
    this.line.style.top = `${box.offsetTop}px`;
    this.line.style.height = `${box.clientHeight}px`;
    this.line.hidden = !(x >= -1 && x <= box.clientWidth + 1);
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
