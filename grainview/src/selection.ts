// Selection of grains, contacts and clusters, and its effects: tables of values, marks, a camera that follows.

import { clusterMask, clusterSizes, measureCluster, membersOf, nearestImage } from "./data/clusters";
import type { Dataset } from "./data/quantities";
import { type Dimension, type Frame, SINGLE, type Source } from "./data/types";
import { quantity } from "./data/units";
import type { Look } from "./scene/look";
import type { Hit } from "./scene/pick";
import type { Settings } from "./state";
import { clusterRows, contactRows, distanceRows, grainRows, isSingle, type Table } from "./ui/inspector";

/** The frame that is shown. */
export interface ShownFrame {
  readonly frame: Frame | null;
  readonly positions: Float32Array; // as drawn
  readonly unwrapped: Float32Array; // with clusters unwrapped
  contactIndex(pair: string): number;
}

/** Picking and marking of grains. */
export interface PickableScene {
  pick(x: number, y: number): Hit | null;
  setMarks(marks: Map<number, number>): void;
}

export interface SelectionContext {
  settings: Settings;
  picture: ShownFrame;
  scene: PickableScene;
  camera: { look: Look };
  inspector: { show(tables: Table[]): void };
  ruler: { measured: [number[], number[], string] | null };
  dataset: Dataset;
  source: Pick<Source, "dimension">;
  isPlaying: () => boolean;
}

const indicesIn = (text: string): number[] => (/^\d+(-\d+)*$/.test(text) ? text.split("-").map(Number) : []);

/** Marks of grains, as the scene draws them. */
const SELECTED = 1;
const MEASURED = 2;

export class Selection {
  private dimension: { frame: number; grain: number; result: Dimension | null } | null = null;
  private followed: number[] | null = null; // centre of the followed cluster when the camera was last moved

  constructor(private readonly context: SelectionContext) {}

  /** Grains between which the distance is measured: none, one or two. */
  private get measured(): number[] {
    const { settings, dataset } = this.context;
    return indicesIn(settings.get("ends")).filter((i) => i < dataset.manifest.grains);
  }

  /** Both grains of the selected contact; empty without a selected contact, or if there are no such grains. */
  private get contactPair(): number[] {
    const { settings, dataset } = this.context;
    const pair = indicesIn(settings.get("contact"));
    return pair.every((i) => i < dataset.manifest.grains) ? pair : [];
  }

  private get grain(): number {
    return this.context.settings.number("grain");
  }

  /** Handle a click at a pixel of the canvas. */
  clickAt(x: number, y: number): void {
    const { settings, picture, scene } = this.context;
    const hit = scene.pick(x, y);
    if (settings.get<boolean>("measure")) {
      if (hit?.kind === "grain") this.measure(hit.index);
      return;
    }
    if (hit?.kind === "contact" && picture.frame) {
      const [i, j] = picture.frame.pair.subarray(2 * hit.index, 2 * hit.index + 2);
      this.selectContact(i, j);
    } else {
      settings.set("contact", "");
      this.selectGrain(hit ? hit.index : -1);
    }
  }

  selectGrain(grain: number): void {
    const { settings, dataset } = this.context;
    if (grain < 0 && settings.get<boolean>("isolate")) return; // a click beside an isolated cluster keeps it
    settings.set("contact", "");
    settings.set("grain", grain < dataset.manifest.grains ? grain : -1);
  }

  private measure(grain: number): void {
    const grains = this.measured.length < 2 ? this.measured.filter((i) => i !== grain) : [];
    this.context.settings.set("ends", [...grains, grain].join("-"));
  }

  /** Select the next grain by index (1), or the previous one (−1). */
  stepGrain(by: 1 | -1): void {
    const [count, now] = [this.context.dataset.manifest.grains, this.grain];
    this.selectGrain(now < 0 ? (by > 0 ? 0 : count - 1) : (now + by + count) % count);
  }

  /** Select the next contact in the order of the file (1), or the previous one (−1). */
  stepContact(by: 1 | -1): void {
    const { settings, picture } = this.context;
    const pair = picture.frame?.pair;
    if (!pair?.length) return;
    const now = picture.contactIndex(settings.get("contact"));
    const next = now < 0 ? 0 : (now + by + pair.length / 2) % (pair.length / 2);
    this.selectContact(pair[2 * next], pair[2 * next + 1]);
  }

  /** Select a contact by its grains; while a cluster is isolated, that of the contact becomes the isolated one. */
  private selectContact(i: number, j: number): void {
    const { settings } = this.context;
    settings.set("grain", settings.get<boolean>("isolate") ? i : -1);
    settings.set("contact", `${i}-${j}`);
  }

  selectLargestCluster(): void {
    const grain = this.largestCluster()?.indexOf(1) ?? -1;
    if (grain >= 0) this.selectGrain(grain);
  }

  /** The grains of the largest cluster of the frame; null if there is none. */
  largestCluster(): Uint8Array | null {
    const { frame } = this.context.picture;
    if (!frame) return null;
    const [name] = [...clusterSizes(frame)].sort((a, b) => b[1] - a[1] || a[0] - b[0])[0] ?? [SINGLE];
    return name === SINGLE ? null : Uint8Array.from(frame.cluster, (own) => Number(own === name));
  }

  measureFromSelected(): void {
    if (this.grain >= 0) this.measure(this.grain);
  }

  clear(): void {
    const { settings } = this.context;
    settings.set("isolate", false);
    settings.set("follow", false);
    settings.set("ends", "");
    settings.set("contact", "");
    settings.set("grain", -1);
  }

  /** Mask of the selected cluster; null if none is selected, or a single grain. */
  cluster(): Uint8Array | null {
    const { frame } = this.context.picture;
    return frame && this.grain >= 0 && !isSingle(frame, this.grain) ? clusterMask(frame, this.grain) : null;
  }

  /** Centre of mass of the selected cluster, or midpoint of the selected contact; null without a selection. */
  centre(): number[] | null {
    const { picture: { frame, positions }, dataset } = this.context;
    if (!frame) return null;
    if (this.grain >= 0) {
      return measureCluster(frame, dataset.grains, positions, membersOf(frame, this.grain)).centre;
    }
    const pair = this.contactPair;
    if (pair.length !== 2) return null;
    const [from, to] = this.line(pair[0], pair[1]);
    return from.map((x, a) => (x + to[a]) / 2);
  }

  /** Follow the selected cluster from its present position in the view, without moving the camera. */
  anchor(): void {
    this.followed = this.context.settings.get<boolean>("follow") ? this.centre() : null;
  }

  /** Follow another cluster: the camera moves to its centre. */
  followSelected(): void {
    this.followed = null;
    this.follow();
  }

  /** Move the camera by the displacement of the followed cluster. */
  follow(): void {
    const { settings, picture, camera } = this.context;
    const centre = settings.get<boolean>("follow") ? this.centre() : null;
    const { followed } = this;
    if (centre) {
      const { look } = camera;
      const target = followed && picture.frame ? look.target.map((t, a) => t + (centre[a] - followed[a])) : centre;
      camera.look = { ...look, target: target as Look["target"] };
    }
    this.followed = centre;
  }

  /** Update marks, tables and the ruler to the present frame. */
  show(): void {
    const { settings, picture, scene, inspector, ruler, dataset } = this.context;
    const { frame, unwrapped } = picture;
    if (!frame) return;
    const marks = new Map<number, number>();
    const tables: Table[] = [];
    if (this.contactPair.length) {
      for (const i of this.contactPair) marks.set(i, SELECTED);
      const contact = picture.contactIndex(settings.get("contact"));
      const title = `contact ${settings.get("contact").toString().replace("-", "–")}`;
      tables.push([title, contact < 0 ? [["", "not in contact in this frame"]] : contactRows(contact, frame, dataset)]);
    }
    const { grain } = this;
    if (grain >= 0 && grain < dataset.manifest.grains) {
      marks.set(grain, SELECTED);
      tables.push([`grain ${grain}`, grainRows(grain, frame, dataset)]);
      if (!isSingle(frame, grain)) {
        tables.push(["cluster", clusterRows(grain, frame, dataset, unwrapped, this.dimensionOf(grain))]);
      }
    }
    const { measured } = this;
    for (const i of measured) marks.set(i, MEASURED);
    ruler.measured = null;
    if (measured.length === 2) {
      tables.push(["distance", distanceRows(measured[0], measured[1], frame, dataset)]);
      ruler.measured = this.line(measured[0], measured[1]);
    } else if (settings.get<boolean>("measure")) {
      tables.push(["distance", [["", measured.length ? "select the second grain" : "select two grains"]]]);
    }
    scene.setMarks(marks);
    inspector.show(tables);
  }

  /** Both ends and the length of the line from a grain to the nearest image of another. */
  private line(i: number, j: number): [number[], number[], string] {
    const { picture: { frame, positions }, dataset: { manifest } } = this.context;
    const a = [0, 1, 2].map((k) => positions[3 * i + k]);
    const apart = [0, 1, 2].map((k) => positions[3 * j + k] - a[k]);
    const d = nearestImage(apart, frame ?? { box: [1, 1, 1] }, manifest.periodic);
    return [a, a.map((v, k) => v + d[k]), quantity(Math.hypot(...d) * manifest.unit, "m", 4)];
  }

  /** Fractal dimension of the cluster of a grain; null while it is being requested. */
  private dimensionOf(grain: number): Dimension | null {
    const { picture, source, isPlaying } = this.context;
    const frame = picture.frame?.frame ?? 0;
    if (this.dimension?.frame === frame && this.dimension.grain === grain) return this.dimension.result;
    if (isPlaying()) return null; // it would take longer than the frame is shown
    const request = { frame, grain, result: null as Dimension | null };
    this.dimension = request;
    source
      .dimension(frame, grain)
      .catch((error: Error) => ({ reason: error.message }))
      .then((result) => {
        request.result = result;
        if (this.dimension === request) this.show();
      });
    return null;
  }
}
