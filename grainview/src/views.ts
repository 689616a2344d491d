// Where the camera goes: all in sight, the middle of what is chosen, a turn, a step nearer.

import * as three from "three";
import type { Choosing } from "./choosing";
import type { Picture } from "./picture";
import type { Look, Stage } from "./scene/stage";

type Place = [number, number, number];

/** Height of a picture over that of what is in it. */
const MARGIN = 1.08;

export class Views {
  constructor(
    private readonly stage: Stage,
    private readonly picture: Picture,
    private readonly choosing: Choosing,
  ) {}

  /** The grains of a mask, or all that is shown and the box; from above a corner if not told otherwise. */
  whole(from: Place = [0.52, -0.74, 0.43], up: Place = [0, 0, 1], mask = this.picture.shown): Look {
    const { place } = this.picture;
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let e = 0; e < place.length; e++) {
      if ((mask && !mask[Math.floor(e / 3)]) || !Number.isFinite(place[e])) continue;
      low[e % 3] = Math.min(low[e % 3], place[e]);
      high[e % 3] = Math.max(high[e % 3], place[e]);
    }
    const target = low.map((l, a) => (l + high[a]) / 2 || 0) as Place;
    return { target, from, up, height: MARGIN * this.picture.heightFor(target, from, up, this.stage.aspect, mask) };
  }

  reset(): void {
    this.stage.look = this.whole();
  }

  /**
   * What is chosen comes into the middle of the picture, a cluster as large as it fits; a contact or a single grain
   * keeps its size, so that one sees where it is.  Without anything chosen, all is in sight.
   */
  centre(): void {
    const { look } = this.stage;
    const [cluster, middle] = [this.choosing.cluster(), this.choosing.middle()];
    if (cluster || !middle) this.stage.look = this.whole(look.from, look.up, cluster ?? undefined);
    else this.stage.look = { ...look, target: middle as Place };
  }

  /** Another cluster than before (a mask, null: all were shown) stands alone: it is as large as it fits. */
  turnToAlone(before: Uint8Array | null): void {
    const { shown } = this.picture;
    if (!shown || (before && shown.every((on, i) => on === before[i]))) return;
    this.stage.look = this.whole(this.stage.look.from, this.stage.look.up);
  }

  /** Go around the target: to the right and upwards [rad]. */
  turn(across: number, upwards: number): void {
    const { look } = this.stage;
    const up = new three.Vector3(...look.up);
    const from = new three.Vector3(...look.from).applyAxisAngle(up, across);
    const side = new three.Vector3().crossVectors(up, from).normalize();
    const turned = from.clone().applyAxisAngle(side, -upwards);
    if (Math.abs(turned.dot(up)) < 0.998) from.copy(turned); // not over the pole
    this.stage.look = { ...look, from: from.toArray() };
  }

  /** Move across the picture, in heights of it. */
  pan(right: number, upwards: number): void {
    const { look } = this.stage;
    const away = new three.Vector3(...look.from);
    const side = new three.Vector3().crossVectors(new three.Vector3(...look.up), away).normalize();
    const up = new three.Vector3().crossVectors(away, side).normalize();
    const target = new three.Vector3(...look.target);
    target.addScaledVector(side, right * look.height).addScaledVector(up, upwards * look.height);
    this.stage.look = { ...look, target: target.toArray() };
  }

  zoom(factor: number): void {
    const { look } = this.stage;
    this.stage.look = { ...look, height: look.height * factor };
  }
}
