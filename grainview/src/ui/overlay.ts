// Overlay of the canvas: axes, direction of the magnetic field, scale bar, measured distance.

import { quantity } from "../data/units";
import { type Arm, armsOf, type DirectedView, type Directions } from "../scene/directions";
import { svg } from "./dom";

/** Scale of the view. */
export interface ViewScale {
  readonly pixelsPerLength: number;
  readonly isOrthographic: boolean;
}

/** Projection of the scene on the canvas. */
export interface Projection extends ViewScale, DirectedView {
  readonly width: number;
  screenOf(position: ArrayLike<number>): [number, number, number] | null;
}

/** The largest number of the form 1, 2 or 5 times a power of ten that is not above a maximum. */
function roundLength(max: number): number {
  const power = 10 ** Math.floor(Math.log10(max));
  return [5, 2, 1].map((m) => m * power).find((v) => v <= max * (1 + 1e-9)) ?? power;
}

/** A scale bar of a round length, and its label. */
export interface LengthBar {
  pixels: number;
  text: string;
}

/** The longest scale bar of at most `max` pixels; `unit` in metres; in perspective it holds at the centre. */
export function lengthBar(view: ViewScale, unit: number, max: number): LengthBar {
  const pixels = view.pixelsPerLength / unit; // per metre
  const length = roundLength(max / pixels);
  return { pixels: length * pixels, text: quantity(length, "m", 3) + (view.isOrthographic ? "" : " at the centre") };
}

export class Overlay {
  readonly element = svg("svg", { class: "gv-overlay", "aria-hidden": "true" });
  measured: [number[], number[], string] | null = null;
  directions: Directions = { field: null, moment: null };
  axes = true;

  constructor(
    private readonly view: Projection,
    private readonly unit: number,
  ) {}

  draw(): void {
    const elements: SVGElement[] = [];
    if (this.axes) elements.push(...armsOf(this.view, this.directions).flatMap((arm) => this.arm(arm)));
    elements.push(...this.scaleBar(), ...this.ruler());
    this.element.replaceChildren(...elements);
  }

  private arm({ kind, name, from, to, label, head }: Arm): SVGElement[] {
    const own = kind && `gv-${kind}`;
    const line = svg("line", { x1: from[0], y1: from[1], x2: to[0], y2: to[1], class: `gv-axis ${own}` });
    const text = svg("text", { x: label[0], y: label[1] + 4, class: `gv-axis-name ${own}` });
    text.textContent = name;
    if (!kind) return [line, text];
    const dot = svg("circle", { cx: from[0], cy: from[1], r: 2, class: `gv-head ${own}` });
    return [line, dot, svg("polygon", { points: head.flat().join(" "), class: `gv-head ${own}` }), text];
  }

  private scaleBar(): SVGElement[] {
    const { pixels: length, text: label } = lengthBar(this.view, this.unit, Math.min(140, 0.25 * this.view.width));
    const [x, y] = [this.view.width - 18 - length, this.view.height - 18];
    const bar = svg("path", { d: `M${x} ${y - 4}V${y}H${x + length}V${y - 4}`, class: "gv-bar" });
    const text = svg("text", { x: x + length, y: y - 7, class: "gv-bar-name" });
    text.textContent = label;
    return [bar, text];
  }

  private ruler(): SVGElement[] {
    if (!this.measured) return [];
    const [a, b] = [this.view.screenOf(this.measured[0]), this.view.screenOf(this.measured[1])];
    if (!a || !b) return [];
    const line = svg("line", { x1: a[0], y1: a[1], x2: b[0], y2: b[1], class: "gv-ruler" });
    const text = svg("text", { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2 - 8, class: "gv-ruler-name" });
    text.textContent = this.measured[2];
    return [line, text];
  }
}
