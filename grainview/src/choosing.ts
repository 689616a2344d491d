// Choosing grains, contacts and clusters, and what follows from it: rows of numbers, marks, a camera that goes along.

import { clusterSizes, maskOf, measureCluster, membersOf, nearest } from "./data/clusters";
import type { Known } from "./data/quantities";
import { type Dimension, SINGLE, type Source } from "./data/types";
import { quantity } from "./data/units";
import type { Picture } from "./picture";
import type { World } from "./scene/world";
import type { State } from "./state";
import { clusterRows, contactRows, distanceRows, grainRows, type Inspector, isSingle } from "./ui/inspector";
import type { Overlay } from "./ui/overlay";

const numbersOf = (text: string): number[] => (/^\d+(-\d+)*$/.test(text) ? text.split("-").map(Number) : []);

export class Choosing {
  private dimension: { frame: number; grain: number; told: Dimension | null } | null = null;
  private centre: number[] | null = null;

  constructor(
    private readonly state: State,
    private readonly picture: Picture,
    private readonly world: World,
    private readonly inspector: Inspector,
    private readonly overlay: Overlay,
    private readonly known: Known,
    private readonly source: Source,
    private readonly isPlaying: () => boolean,
  ) {}

  /** Grains being measured, those that there are. */
  get ends(): number[] {
    return numbersOf(this.state.get("ends")).filter((i) => i < this.known.manifest.grains);
  }

  /** Grains of the chosen contact, if there are such grains. */
  private get touching(): number[] {
    const pair = numbersOf(this.state.get("contact"));
    return pair.every((i) => i < this.known.manifest.grains) ? pair : [];
  }

  /** What a click at a pixel of the canvas does. */
  clickAt(x: number, y: number): void {
    const hit = this.world.pick(x, y);
    const { state } = this;
    if (state.get<boolean>("measure")) {
      if (hit?.kind === "grain") this.addEnd(hit.index);
      return;
    }
    if (hit?.kind === "contact" && this.picture.frame) {
      const [i, j] = this.picture.frame.pair.subarray(2 * hit.index, 2 * hit.index + 2);
      this.chooseContact(i, j);
    } else {
      state.set("contact", "");
      this.choose(hit ? hit.index : -1);
    }
  }

  choose(grain: number): void {
    if (grain < 0 && this.state.get<boolean>("isolate")) return; // a click beside what stands alone
    this.state.set("contact", "");
    this.state.set("grain", grain < this.known.manifest.grains ? grain : -1);
  }

  addEnd(grain: number): void {
    const ends = this.ends.length < 2 ? this.ends.filter((i) => i !== grain) : [];
    this.state.set("ends", [...ends, grain].join("-"));
  }

  /** The next grain by number, or the one before. */
  step(by: 1 | -1): void {
    const [count, now] = [this.known.manifest.grains, this.state.number("grain")];
    this.choose(now < 0 ? (by > 0 ? 0 : count - 1) : (now + by + count) % count);
  }

  /** The next contact in the order of the file, or the one before. */
  stepContact(by: 1 | -1): void {
    const pair = this.picture.frame?.pair;
    if (!pair?.length) return;
    const now = this.picture.contactOf(this.state.get("contact"));
    const next = now < 0 ? 0 : (now + by + pair.length / 2) % (pair.length / 2);
    this.chooseContact(pair[2 * next], pair[2 * next + 1]);
  }

  /** The contact of two grains; a cluster that stands alone goes on to do so, or gives its place to theirs. */
  private chooseContact(i: number, j: number): void {
    this.state.set("grain", this.state.get<boolean>("isolate") ? i : -1);
    this.state.set("contact", `${i}-${j}`);
  }

  /** A grain of the largest cluster. */
  chooseLargest(): void {
    const { frame } = this.picture;
    if (!frame) return;
    const [name] = [...clusterSizes(frame)].sort((a, b) => b[1] - a[1] || a[0] - b[0])[0] ?? [SINGLE];
    if (name !== SINGLE) this.choose(frame.cluster.indexOf(name));
  }

  measureFromChosen(): void {
    if (this.state.number("grain") >= 0) this.addEnd(this.state.number("grain"));
  }

  clear(): void {
    this.state.set("isolate", false);
    this.state.set("follow", false);
    this.state.set("ends", "");
    this.state.set("contact", "");
    this.state.set("grain", -1);
  }

  /** The chosen cluster as a mask; null: none is chosen, or a single grain. */
  cluster(): Uint8Array | null {
    const { frame } = this.picture;
    const grain = this.state.number("grain");
    return frame && grain >= 0 && !isSingle(frame, grain) ? maskOf(frame, grain) : null;
  }

  /** Middle of the chosen cluster, or of the contact, or null. */
  middle(): number[] | null {
    const { frame, place } = this.picture;
    const grain = this.state.number("grain");
    if (!frame) return null;
    if (grain >= 0) return measureCluster(frame, this.known.grains, place, membersOf(frame, grain)).centre;
    const pair = this.touching;
    if (pair.length !== 2) return null;
    const [from, to] = this.line(pair[0], pair[1], place);
    return from.map((x, a) => (x + to[a]) / 2);
  }

  /** What is followed is where it should be on the picture. */
  anchor(): void {
    this.centre = this.state.get<boolean>("follow") ? this.middle() : null;
  }

  /** Another cluster is followed from now on: the camera goes to it. */
  turnTo(): void {
    this.centre = null;
    this.follow();
  }

  /** The camera goes as far as the followed cluster has gone. */
  follow(): void {
    const middle = this.state.get<boolean>("follow") ? this.middle() : null;
    const { stage } = this.world;
    if (middle && this.centre && this.picture.frame) {
      const moved = middle.map((m, a) => m - (this.centre as number[])[a]);
      const { look } = stage;
      stage.look = { ...look, target: look.target.map((t, a) => t + moved[a]) as [number, number, number] };
    } else if (middle) {
      const { look } = stage;
      stage.look = { ...look, target: middle as [number, number, number] };
    }
    this.centre = middle;
  }

  /** Marks, rows and lines, of this frame. */
  show(): void {
    const { frame, whole, place } = this.picture;
    if (!frame) return;
    const { state, known } = this;
    const marks = new Map<number, number>();
    const parts: [string, [string, string][]][] = [];
    const contact = this.picture.contactOf(state.get("contact"));
    if (this.touching.length) {
      for (const i of this.touching) marks.set(i, 1);
      const name = `contact ${state.get("contact").toString().replace("-", "–")}`;
      const apart: [string, string][] = [["", "these grains do not touch in this frame"]];
      parts.push([name, contact < 0 ? apart : contactRows(contact, frame, known)]);
    }
    const grain = state.number("grain");
    if (grain >= 0 && grain < known.manifest.grains) {
      marks.set(grain, 1);
      parts.push([`grain ${grain}`, grainRows(grain, frame, known)]);
      if (!isSingle(frame, grain)) {
        parts.push(["its cluster", clusterRows(grain, frame, known, whole, this.dimensionOf(grain))]);
      }
    }
    const ends = this.ends;
    for (const i of ends) marks.set(i, 2);
    this.overlay.measured = null;
    if (ends.length === 2) {
      parts.push(["distance", distanceRows(ends[0], ends[1], frame, known)]);
      this.overlay.measured = this.line(ends[0], ends[1], place);
    } else if (state.get<boolean>("measure")) {
      parts.push(["distance", [["", ends.length ? "choose the other grain" : "choose two grains"]]]);
    }
    this.world.setMarks(marks);
    this.inspector.show(parts);
  }

  private line(i: number, j: number, place: Float32Array): [number[], number[], string] {
    const { manifest } = this.known;
    const box = this.picture.frame?.box ?? [1, 1, 1];
    const a = [0, 1, 2].map((k) => place[3 * i + k]);
    const d = [0, 1, 2].map((k) => nearest(place[3 * j + k] - a[k], box[k], manifest.periodic[k]));
    return [a, a.map((v, k) => v + d[k]), quantity(Math.hypot(...d) * manifest.unit, "m", 4)];
  }

  /** The fractal dimension of the cluster of a grain, once it has come; null: on its way. */
  private dimensionOf(grain: number): Dimension | null {
    const frame = this.picture.frame?.frame ?? 0;
    if (this.dimension?.frame === frame && this.dimension.grain === grain) return this.dimension.told;
    if (this.isPlaying()) return null; // there is no time for it before the next frame
    const asked = { frame, grain, told: null as Dimension | null };
    this.dimension = asked;
    this.source
      .dimension(frame, grain)
      .catch((error: Error) => ({ reason: error.message }))
      .then((told) => {
        asked.told = told;
        if (this.dimension === asked) this.show();
      });
    return null;
  }
}
