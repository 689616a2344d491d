// The objects of the scene: grains, contacts, arrows, box, trails.

import * as three from "three";
import type { Bonds } from "../data/bonds";
import { rgb } from "../data/colours";
import { ARROW, ArrowsMesh } from "./arrows";
import { BondsMesh } from "./bonds";
import { GrainsMesh } from "./grains";
import { boxEdges, Segments } from "./lines";
import { type Hit, pickContact, pickGrain } from "./pick";
import type { Stage } from "./stage";

export interface Theme {
  background: string;
  ink: string;
  tip: string;
  line: string;
  dark: boolean;
}

export const LIGHT: Theme = { background: "#fbfaf7", ink: "#22262b", tip: "#16181c", line: "#9aa0a6", dark: false };
export const DARK: Theme = { background: "#10131a", ink: "#e8e6df", tip: "#ffffff", line: "#5b626d", dark: true };

const linear = (hex: string): three.Vector3 => new three.Vector3(...rgb(hex).map((c) => c / 255));

export class World {
  readonly uniforms = {
    uBackground: { value: new three.Vector3(1, 1, 1) },
    uInk: { value: new three.Vector3() },
    uTip: { value: new three.Vector3() },
    uDepth: { value: new three.Vector2(0, 1) },
    uHaze: { value: 0 },
    uAmbient: { value: 0.5 },
    uSize: { value: 1 },
    uPixel: { value: 1 },
    uMinLength: { value: 14 },
  };
  readonly grains: GrainsMesh;
  readonly bonds: BondsMesh;
  readonly arrows: ArrowsMesh;
  readonly box = new Segments(false);
  readonly trails = new Segments(true);
  positions: Float32Array = new Float32Array();
  radius: Float32Array = new Float32Array();
  shown: Uint8Array | null = null;
  pieces: Bonds | null = null;
  haze = 0.5;
  private bar = 1; // radius of contacts over that of the smaller grain
  private medianRadius = 1;

  constructor(readonly stage: Stage) {
    this.grains = new GrainsMesh(this.uniforms, !stage.slow);
    this.bonds = new BondsMesh(this.uniforms, !stage.slow);
    this.arrows = new ArrowsMesh(this.uniforms, this.grains.position.uniform, !stage.slow);
    const objects = [this.trails.lines, this.box.lines, this.grains.mesh, this.bonds.mesh, this.arrows.mesh];
    stage.scene.add(...objects);
    stage.onDraw = () => this.beforeDraw();
  }

  setTheme(theme: Theme, transparent = false): void {
    this.uniforms.uBackground.value.copy(linear(theme.background));
    this.uniforms.uInk.value.copy(linear(theme.ink));
    this.uniforms.uTip.value.copy(linear(theme.tip));
    this.uniforms.uAmbient.value = theme.dark ? 0.52 : 0.68;
    this.box.lines.material.color.setStyle(theme.line, three.LinearSRGBColorSpace);
    this.stage.renderer.outputColorSpace = three.LinearSRGBColorSpace; // colours are used without conversion
    const colour = new three.Color().setStyle(theme.background, three.LinearSRGBColorSpace);
    this.stage.renderer.setClearColor(colour, transparent ? 0 : 1);
    this.stage.redraw();
  }

  setGrains(positions: Float32Array, radius: Float32Array, colour: Uint8Array): void {
    if (radius !== this.radius) this.medianRadius = Float32Array.from(radius).sort()[radius.length >> 1] ?? 1;
    [this.positions, this.radius] = [positions, radius];
    this.grains.set(positions, radius, colour);
    this.stage.redraw();
  }

  /** Set the occlusion of grains by others (N, 3), see data/occlusion.ts; null: none. */
  setOcclusion(occlusion: Float32Array | null): void {
    this.grains.setOcclusion(this.radius.length, occlusion);
    this.stage.redraw();
  }

  /** Mark grains: 1 selected, 2 measured. */
  setMarks(marks: Map<number, number>): void {
    this.grains.setMarks(this.radius.length, marks);
    this.stage.redraw();
  }

  setBonds(pieces: Bonds | null, bar: number): void {
    [this.pieces, this.bar] = [pieces, bar];
    this.bonds.visible = pieces !== null;
    if (pieces) this.bonds.set(pieces, bar);
    this.stage.redraw();
  }

  /** Draw arrows along the moments (N, 3); null: none. */
  setArrows(moment: Float32Array | null): void {
    this.arrows.visible = moment !== null;
    if (moment) this.arrows.set(moment, this.radius, this.shown);
    this.stage.redraw();
  }

  setBox(lengths: number[] | null): void {
    this.box.lines.visible = lengths !== null;
    if (lengths) this.box.set(boxEdges(lengths));
    this.stage.redraw();
  }

  /** Radius of the sphere about a target that contains all shown grains and their arrows. */
  reachFrom(target: number[]): number {
    let max = 0;
    for (let i = 0; i < this.radius.length; i++) {
      if (this.shown && !this.shown[i]) continue;
      const x = this.positions[3 * i] - target[0];
      const y = this.positions[3 * i + 1] - target[1];
      const z = this.positions[3 * i + 2] - target[2];
      const distance = Math.sqrt(x * x + y * y + z * z) + ARROW * this.radius[i];
      if (distance > max && distance < Infinity) max = distance; // positions may be NaN
    }
    return max || 1;
  }

  private beforeDraw(): void {
    const { stage, uniforms } = this;
    const distance = stage.camera.position.distanceTo(stage.controls.target);
    const depth = Math.min(stage.reach, 1.5 * stage.look.height);
    uniforms.uDepth.value.set(distance - 0.35 * depth, distance + depth);
    uniforms.uHaze.value = this.haze;
    uniforms.uPixel.value = stage.pixelsPerLength * (stage.isOrthographic ? 1 : distance);
    // objects a few pixels wide are drawn without ray-casting
    const pixels = this.medianRadius * stage.pixelsPerLength * stage.renderer.getPixelRatio();
    for (const squares of [this.grains, this.bonds, this.arrows]) squares.isSimplified = pixels < (stage.slow ? 7 : 3);
  }

  /** The grain or contact at a pixel of the canvas. */
  pick(x: number, y: number): Hit | null {
    const ray = this.stage.rayAt(x, y);
    const grain = pickGrain(ray, this.positions, this.radius, this.uniforms.uSize.value, this.shown);
    const contact = this.pieces ? pickContact(ray, this.pieces, this.bar) : null;
    return contact && (!grain || contact.distance < grain.distance) ? contact : grain;
  }
}
