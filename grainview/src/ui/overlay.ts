// Overlay of the canvas: axes, direction of the magnetic field, scale bar, measured distance.

import * as three from "three";
import { quantity } from "../data/units";
import { svg } from "./dom";

const ARM = 26; // length of the axes [pixels]

/** Scale of the view. */
export interface ViewScale {
  readonly pixelsPerLength: number;
  readonly isOrthographic: boolean;
}

/** Projection of the scene on the canvas. */
export interface Projection extends ViewScale {
  readonly width: number;
  readonly height: number;
  readonly camera: { readonly matrixWorldInverse: three.Matrix4 };
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
  field: number[] | null = null;
  axes = true;

  constructor(
    private readonly view: Projection,
    private readonly unit: number,
  ) {}

  draw(): void {
    const elements: SVGElement[] = [];
    if (this.axes) elements.push(...this.triad());
    elements.push(...this.scaleBar(), ...this.ruler());
    this.element.replaceChildren(...elements);
  }

  /** Projection of a direction: components to the right and down. */
  private projected(direction: number[]): [number, number] {
    const size = Math.hypot(...direction);
    const v = new three.Vector3(...direction).transformDirection(this.view.camera.matrixWorldInverse);
    return [size * v.x, -size * v.y];
  }

  private axis(x: number, y: number, direction: number[], name: string, kind: string): SVGElement[] {
    const [dx, dy] = this.projected(direction);
    const line = svg("line", { x1: x, y1: y, x2: x + ARM * dx, y2: y + ARM * dy, class: `gv-axis ${kind}` });
    const text = svg("text", { x: x + (ARM + 9) * dx, y: y + (ARM + 9) * dy + 4, class: `gv-axis-name ${kind}` });
    text.textContent = name;
    return [line, text];
  }

  private triad(): SVGElement[] {
    const [x, y] = [44, this.view.height - 44];
    const axes = ["x", "y", "z"].flatMap((name, a) => this.axis(x, y, [0, 1, 2].map((b) => Number(a === b)), name, ""));
    if (this.field) axes.push(...this.axis(x, y, this.field.map((v) => 1.6 * v), "B", "gv-field"));
    return axes;
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
