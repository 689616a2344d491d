// What is drawn over the picture: axes, direction of the field, bar of length, line of a measured distance.

import * as three from "three";
import { quantity } from "../data/units";
import type { Stage } from "../scene/stage";
import { svg } from "./dom";

const ARM = 26; // pixels

/** The largest 1, 2 or 5 times a power of ten not above a number. */
export function roundLength(most: number): number {
  const power = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].map((m) => m * power).find((v) => v <= most * (1 + 1e-9)) ?? power;
}

/** A bar of a round length, and what is written at it. */
export interface LengthBar {
  pixels: number;
  text: string;
}

/** The longest bar of a round length not above `most` pixels; `unit` in metres; in perspective true at its centre. */
export function lengthBar(stage: Stage, unit: number, most: number): LengthBar {
  const pixels = stage.pixelsPerLength / unit; // for a metre
  const length = roundLength(most / pixels);
  return { pixels: length * pixels, text: quantity(length, "m", 3) + (stage.isOrthographic ? "" : " at the centre") };
}

export class Overlay {
  readonly element = svg("svg", { class: "gv-overlay", "aria-hidden": "true" });
  measured: [number[], number[], string] | null = null;
  field: number[] | null = null;
  axes = true;

  constructor(
    private readonly stage: Stage,
    private readonly unit: number,
  ) {}

  draw(): void {
    const parts: SVGElement[] = [];
    if (this.axes) parts.push(...this.triad());
    parts.push(...this.scaleBar(), ...this.ruler());
    this.element.replaceChildren(...parts);
  }

  /** A direction of the world as it is seen: pixels to the right and down, for a length of one. */
  private seen(direction: number[]): [number, number] {
    const size = Math.hypot(...direction);
    const v = new three.Vector3(...direction).transformDirection(this.stage.camera.matrixWorldInverse);
    return [size * v.x, -size * v.y];
  }

  private arm(x: number, y: number, direction: number[], name: string, kind: string): SVGElement[] {
    const [dx, dy] = this.seen(direction);
    const line = svg("line", { x1: x, y1: y, x2: x + ARM * dx, y2: y + ARM * dy, class: `gv-axis ${kind}` });
    const text = svg("text", { x: x + (ARM + 9) * dx, y: y + (ARM + 9) * dy + 4, class: `gv-axis-name ${kind}` });
    text.textContent = name;
    return [line, text];
  }

  private triad(): SVGElement[] {
    const [x, y] = [44, this.stage.height - 44];
    const arms = ["x", "y", "z"].flatMap((name, a) => this.arm(x, y, [0, 1, 2].map((b) => Number(a === b)), name, ""));
    if (this.field) arms.push(...this.arm(x, y, this.field.map((v) => 1.6 * v), "B", "gv-field"));
    return arms;
  }

  private scaleBar(): SVGElement[] {
    const { pixels: wide, text: told } = lengthBar(this.stage, this.unit, Math.min(140, 0.25 * this.stage.width));
    const [x, y] = [this.stage.width - 18 - wide, this.stage.height - 18];
    const bar = svg("path", { d: `M${x} ${y - 4}V${y}H${x + wide}V${y - 4}`, class: "gv-bar" });
    const text = svg("text", { x: x + wide, y: y - 7, class: "gv-bar-name" });
    text.textContent = told;
    return [bar, text];
  }

  private ruler(): SVGElement[] {
    if (!this.measured) return [];
    const [a, b] = [this.stage.screenOf(this.measured[0]), this.stage.screenOf(this.measured[1])];
    if (!a || !b) return [];
    const line = svg("line", { x1: a[0], y1: a[1], x2: b[0], y2: b[1], class: "gv-ruler" });
    const text = svg("text", { x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2 - 8, class: "gv-ruler-name" });
    text.textContent = this.measured[2];
    return [line, text];
  }
}
