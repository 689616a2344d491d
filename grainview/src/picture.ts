// From a frame and the settings to what is on the stage: places, colours, contacts, arrows, trails.

import * as three from "three";
import { bondPaint, bondPieces, loadScale } from "./data/bonds";
import { maskOf, wholePositions } from "./data/clusters";
import { paint, type Painted, type Scale } from "./data/colours";
import type { Frames } from "./data/frames";
import { type KeyPart, keyOf } from "./data/key";
import { coverOf } from "./data/openness";
import { type Known, QUANTITIES, type Quantity } from "./data/quantities";
import { type Frame, SINGLE } from "./data/types";
import { ARROW } from "./scene/arrows";
import { MOST_TRAILS, trailSegments } from "./scene/lines";
import type { World } from "./scene/world";
import type { State } from "./state";

/** With more grains, shade from neighbours waits until there is time. */
const MANY = 30_000;

export class Picture {
  frame: Frame | null = null;
  whole: Float32Array = new Float32Array();
  painted: Painted | null = null;
  bondScale: Scale | null = null;
  patient = false; // frames are saved: each shall be complete, however long it takes
  private later = 0;
  private readonly middle: number; // radius of the middle one of the grains

  constructor(
    private readonly world: World,
    private readonly state: State,
    private readonly frames: Frames,
    private readonly known: Known,
  ) {
    const radii = Float32Array.from(known.grains.radius).sort();
    this.middle = radii[radii.length >> 1] ?? 1;
  }

  get quantity(): Quantity {
    return QUANTITIES.find((q) => q.id === this.state.get("colour")) ?? QUANTITIES[0];
  }

  /** Places at which grains are drawn. */
  get place(): Float32Array {
    const whole = ["whole", "isolate", "follow"].some((id) => this.state.get<boolean>(id));
    return whole ? this.whole : this.frame?.position ?? this.whole;
  }

  /** Which grains are shown; null: all. */
  get shown(): Uint8Array | null {
    return this.world.shown;
  }

  /** What its colours mean. */
  get key(): KeyPart[] {
    const { painted, bondScale: scale } = this;
    return painted && scale ? keyOf(this.quantity, painted, this.known, { kind: this.state.get("bonds"), scale }) : [];
  }

  setFrame(frame: Frame): void {
    this.frame = frame;
    this.whole = wholePositions(frame, this.known.manifest.periodic);
  }

  /** Everything anew, of this frame and these settings. */
  dress(playing: boolean): void {
    const { frame, state, world, known } = this;
    if (!frame) return;
    this.painted = paint(this.quantity, frame, known, {
      low: state.number("low"), high: state.number("high"), log: state.get("log"), palette: state.get("palette"),
    });
    world.shown = this.shownGrains(frame);
    const colour = this.painted.colour;
    if (world.shown) world.shown.forEach((on, i) => on || (colour[4 * i + 3] = 0));
    world.setGrains(this.place, known.grains.radius, colour);
    this.shadeSoon(playing);
    this.dressBonds();
    world.setArrows(state.get<boolean>("arrows") ? frame.moment : null);
    const boxed = state.get<boolean>("box") && !world.shown && known.manifest.periodic.some(Boolean);
    world.setBox(boxed ? frame.box : null);
    void this.dressTrails();
  }

  /** Shade from neighbours; in a crowd, once nothing else is to be done: until then that of the frame before stays. */
  private shadeSoon(playing: boolean): void {
    window.clearTimeout(this.later);
    const shade = (): void => {
      const much = Math.min(1, 2 * this.state.number("shade"));
      this.world.setCover(much > 0 ? coverOf(this.place, 5 * this.middle).map((c) => c * much) : null);
    };
    if (this.known.manifest.grains <= MANY || this.patient) shade();
    else if (!playing) this.later = window.setTimeout(shade, 250);
  }

  dressBonds(): void {
    const { frame, state, world, known } = this;
    if (!frame) return;
    const kind = state.get<string>("bonds");
    this.bondScale = loadScale(known.manifest, frame);
    const brush = bondPaint(kind, frame, known.manifest, this.bondScale);
    const pieces = kind === "off" ? null : bondPieces(frame, this.place, world.shown, known.manifest, brush);
    world.setBonds(pieces, state.number("bar") * this.middle);
  }

  private shownGrains(frame: Frame): Uint8Array | null {
    const grain = this.state.number("grain");
    return this.state.get<boolean>("isolate") && grain >= 0 ? maskOf(frame, grain) : null;
  }

  /** Trails come when their frames have come. */
  private async dressTrails(): Promise<void> {
    const { frame, state, world, known } = this;
    const length = state.number("trails");
    world.trails.lines.visible = length > 0;
    if (!frame || !length || !this.painted) return;
    const first = Math.max(frame.frame - length, 0);
    const numbers = Array.from({ length: frame.frame - first + 1 }, (_, k) => first + k);
    const asked = await Promise.allSettled(numbers.map((k) => this.frames.get(k)));
    const earlier = asked.flatMap((one) => (one.status === "fulfilled" ? [one.value] : [])); // without unreadable ones
    if (this.frame !== frame || state.number("trails") !== length) return; // it is too late for these
    const who: number[] = [];
    const grain = state.number("grain");
    const name = grain >= 0 ? frame.cluster[grain] : -1;
    for (let i = 0; i < known.manifest.grains && who.length < MOST_TRAILS; i++) {
      if (grain < 0 || i === grain || (name !== SINGLE && frame.cluster[i] === name)) who.push(i);
    }
    const box = frame.box.map((l, a) => (known.manifest.periodic[a] ? l : Infinity));
    const shift = this.place.map((x, e) => x - frame.position[e]); // by boxes, where clusters are kept whole
    const { ends, colours } = trailSegments(earlier.map((f) => f.position), who, this.painted.colour, box, shift);
    world.trails.set(ends, colours);
    world.stage.redraw();
  }

  /** Lengths of the box, 0 where it is not drawn. */
  private get boxed(): number[] {
    const boxed = this.frame && !this.shown && this.known.manifest.periodic.some(Boolean);
    return boxed && this.frame ? this.frame.box : [0, 0, 0];
  }

  /** Radius about a place within which all there is lies. */
  reachFrom(target: number[]): number {
    return Math.max(this.world.reachFrom(target), Math.hypot(...this.boxed) / 2 + Math.hypot(...target));
  }

  /**
   * Height of the picture that holds the grains of a mask (null: all there is, the box too), its middle a target; of
   * both cameras, whichever needs more.
   */
  heightFor(target: number[], from: number[], up: number[], aspect: number, mask: Uint8Array | null): number {
    const away = new three.Vector3(...from).normalize();
    const side = new three.Vector3(...up).cross(away).normalize();
    const upwards = new three.Vector3().crossVectors(away, side);
    const v = new three.Vector3();
    let most = 0;
    const hold = (x: number, y: number, z: number, radius: number): void => {
      v.set(x - target[0], y - target[1], z - target[2]);
      const half = Math.max(Math.abs(v.dot(upwards)) + radius, (Math.abs(v.dot(side)) + radius) / aspect);
      // the eye is two heights away: what is nearer than the target looks larger
      const height = 2 * half + Math.max(v.dot(away), 0) / 2;
      if (height > most) most = height; // what is nowhere is held by none
    };
    const { place } = this;
    this.known.grains.radius.forEach((r, i) => {
      if (!mask || mask[i]) hold(place[3 * i], place[3 * i + 1], place[3 * i + 2], (ARROW / 2) * r);
    });
    const [a, b, c] = mask ? [0, 0, 0] : this.boxed.map((length) => length / 2);
    if (a) for (const x of [-a, a]) for (const y of [-b, b]) for (const z of [-c, c]) hold(x, y, z, 0);
    return most || 1;
  }

  /** The number of the contact between two grains, told as "i-j"; −1: they do not touch. */
  contactOf(pair: string): number {
    const match = /^(\d+)-(\d+)$/.exec(pair);
    if (!match || !this.frame) return -1;
    const [i, j] = [Number(match[1]), Number(match[2])];
    const { pair: all } = this.frame;
    for (let c = 0; 2 * c < all.length; c++) {
      if ((all[2 * c] === i && all[2 * c + 1] === j) || (all[2 * c] === j && all[2 * c + 1] === i)) return c;
    }
    return -1;
  }
}
