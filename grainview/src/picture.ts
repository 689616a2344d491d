// The picture of a frame: positions, colours, contacts, arrows and trails that the settings ask for.

import * as three from "three";
import { bondColours, bondPieces, loadScale } from "./data/bonds";
import { clusterMask, unwrappedPositions } from "./data/clusters";
import { paint, type Painted, type Scale } from "./data/colours";
import { type KeyPart, keyOf } from "./data/key";
import { occlusion } from "./data/occlusion";
import { type Dataset, quantitiesOf, type Quantity } from "./data/quantities";
import { type Frame, SINGLE } from "./data/types";
import { ARROW } from "./scene/arrows";
import { MAX_TRAILS, trailSegments } from "./scene/lines";
import type { World } from "./scene/world";
import type { SettingValues } from "./state";

/** Number of grains above which shading by neighbours is computed only while the page is idle. */
const DEFERRED_SHADING = 30_000;

/** Range of shading by neighbours, in median radii. */
const SHADING_RANGE = 5;

export class Picture {
  frame: Frame | null = null;
  unwrapped: Float32Array = new Float32Array();
  painted: Painted | null = null;
  bondScale: Scale | null = null;
  complete = false; // compute everything at once, as saved frames need it
  private timer = 0;
  private readonly medianRadius: number;

  constructor(
    private readonly world: World,
    private readonly settings: SettingValues,
    private readonly frames: { get(k: number): Promise<Frame> },
    private readonly dataset: Dataset,
  ) {
    const radii = Float32Array.from(dataset.grains.radius).sort();
    this.medianRadius = radii[radii.length >> 1] ?? 1;
  }

  get quantity(): Quantity {
    const quantities = quantitiesOf(this.dataset.manifest);
    return quantities.find((q) => q.id === this.settings.get("colour")) ?? quantities[0];
  }

  /** Positions at which grains are drawn. */
  get positions(): Float32Array {
    const unwrap = ["whole", "isolate", "follow"].some((id) => this.settings.get<boolean>(id));
    return unwrap ? this.unwrapped : this.frame?.position ?? this.unwrapped;
  }

  /** Which grains are shown; null: all. */
  get shown(): Uint8Array | null {
    return this.world.shown;
  }

  /** Content of the legend. */
  get key(): KeyPart[] {
    const { painted, bondScale: scale } = this;
    if (!painted || !scale || !this.frame) return [];
    const bonds = { kind: this.settings.get<string>("bonds"), scale };
    return keyOf(this.quantity, painted, this.frame.position, this.dataset, bonds);
  }

  /** The content in words, for screen readers. */
  get description(): string {
    const contacts = (this.frame?.pair.length ?? 0) / 2;
    const grains = this.frame?.position.filter((x, e) => e % 3 === 0 && !Number.isNaN(x)).length ?? 0;
    return `${grains} grains, ${contacts} contacts, coloured by ${this.quantity.label}`;
  }

  setFrame(frame: Frame): void {
    this.frame = frame;
    this.unwrapped = unwrappedPositions(frame, this.dataset.manifest.periodic);
  }

  /** Update the scene to the present frame and settings. */
  update(playing: boolean): void {
    const { frame, settings, world, dataset } = this;
    if (!frame) return;
    this.painted = paint(this.quantity, frame, dataset, {
      low: settings.number("low"), high: settings.number("high"), log: settings.get("log"),
      palette: settings.get("palette"),
    });
    world.shown = this.shownGrains(frame);
    const colour = this.painted.colour;
    if (world.shown) world.shown.forEach((on, i) => on || (colour[4 * i + 3] = 0));
    world.setGrains(this.positions, dataset.grains.radius, colour);
    this.updateShading(playing);
    this.updateBonds();
    world.setArrows(settings.get<boolean>("arrows") ? frame.moment : null);
    const drawBox = settings.get<boolean>("box") && !world.shown && dataset.manifest.periodic.some(Boolean);
    world.setBox(drawBox ? frame.box : null);
    void this.updateTrails();
  }

  /** Update shading by neighbours; with many grains after a delay, until which that of the previous frame is kept. */
  private updateShading(playing: boolean): void {
    window.clearTimeout(this.timer);
    const shade = (): void => {
      const strength = Math.min(1, 2 * this.settings.number("shade"));
      const range = SHADING_RANGE * this.medianRadius;
      this.world.setOcclusion(strength > 0 ? occlusion(this.positions, range).map((c) => c * strength) : null);
    };
    if (this.dataset.manifest.grains <= DEFERRED_SHADING || this.complete) shade();
    else if (!playing) this.timer = window.setTimeout(shade, 250);
  }

  private updateBonds(): void {
    const { frame, settings, world, dataset } = this;
    if (!frame) return;
    const kind = settings.get<string>("bonds");
    this.bondScale = loadScale(dataset.manifest, frame);
    const colourOf = bondColours(kind, frame, dataset.manifest, this.bondScale);
    const { radius } = dataset.grains;
    const { positions } = this;
    const pieces =
      kind === "off" ? null : bondPieces(frame, positions, radius, world.shown, dataset.manifest, colourOf);
    world.setBonds(pieces, settings.number("bar"));
  }

  private shownGrains(frame: Frame): Uint8Array | null {
    const grain = this.settings.number("grain");
    return this.settings.get<boolean>("isolate") && grain >= 0 ? clusterMask(frame, grain) : null;
  }

  /** Update the trails once the frames they need are loaded. */
  private async updateTrails(): Promise<void> {
    const { frame, settings, world, dataset } = this;
    const length = settings.number("trails");
    world.trails.lines.visible = length > 0;
    if (!frame || !length || !this.painted) return;
    const first = Math.max(frame.frame - length, 0);
    const numbers = Array.from({ length: frame.frame - first + 1 }, (_, k) => first + k);
    const results = await Promise.allSettled(numbers.map((k) => this.frames.get(k)));
    const earlier = results.flatMap((r) => (r.status === "fulfilled" ? [r.value] : [])); // without unreadable frames
    if (this.frame !== frame || settings.number("trails") !== length) return; // superseded
    const grains: number[] = [];
    const grain = settings.number("grain");
    const name = grain >= 0 ? frame.cluster[grain] : -1;
    for (let i = 0; i < dataset.manifest.grains && grains.length < MAX_TRAILS; i++) {
      if (grain < 0 || i === grain || (name !== SINGLE && frame.cluster[i] === name)) grains.push(i);
    }
    const box = frame.box.map((l, a) => (dataset.manifest.periodic[a] ? l : Infinity));
    const shift = this.positions.map((x, e) => x - frame.position[e]); // by box lengths, where clusters are unwrapped
    const { ends, colours } = trailSegments(earlier.map((f) => f.position), grains, this.painted.colour, box, shift);
    world.trails.set(ends, colours);
    world.stage.redraw();
  }

  /** Box lengths; zeros if no box is drawn. */
  private get boxLengths(): number[] {
    const visible = this.frame && !this.shown && this.dataset.manifest.periodic.some(Boolean);
    return visible && this.frame ? this.frame.box : [0, 0, 0];
  }

  /** Radius of the sphere about a target that contains all grains shown, and the box. */
  reachFrom(target: number[]): number {
    return Math.max(this.world.reachFrom(target), Math.hypot(...this.boxLengths) / 2 + Math.hypot(...target));
  }

  /**
   * Height of the view, centred at a target, that contains the grains of a mask (null: all grains and the box); the
   * larger of those of the perspective and the orthographic camera.
   */
  heightFor(target: number[], from: number[], up: number[], aspect: number, mask: Uint8Array | null): number {
    const forward = new three.Vector3(...from).normalize();
    const side = new three.Vector3(...up).cross(forward).normalize();
    const upwards = new three.Vector3().crossVectors(forward, side);
    const v = new three.Vector3();
    let max = 0;
    const include = (x: number, y: number, z: number, radius: number): void => {
      v.set(x - target[0], y - target[1], z - target[2]);
      const half = Math.max(Math.abs(v.dot(upwards)) + radius, (Math.abs(v.dot(side)) + radius) / aspect);
      // the eye is two heights away from the target: points in front of the target appear larger
      const height = 2 * half + Math.max(v.dot(forward), 0) / 2;
      if (height > max) max = height; // false for NaN positions
    };
    const { positions } = this;
    this.dataset.grains.radius.forEach((r, i) => {
      if (!mask || mask[i]) include(positions[3 * i], positions[3 * i + 1], positions[3 * i + 2], (ARROW / 2) * r);
    });
    const [a, b, c] = mask ? [0, 0, 0] : this.boxLengths.map((length) => length / 2);
    if (a) for (const x of [-a, a]) for (const y of [-b, b]) for (const z of [-c, c]) include(x, y, z, 0);
    return max || 1;
  }

  /** Index of the contact between two grains, given as "i-j"; −1 if they are not in contact. */
  contactIndex(pair: string): number {
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
