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

  /** All that is shown and the box, from above a corner if not told otherwise. */
  whole(from: Place = [0.52, -0.74, 0.43], up: Place = [0, 0, 1]): Look {
    const { place, shown } = this.picture;
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (let e = 0; e < place.length; e++) {
      if ((shown && !shown[Math.floor(e / 3)]) || !Number.isFinite(place[e])) continue;
      low[e % 3] = Math.min(low[e % 3], place[e]);
      high[e % 3] = Math.max(high[e % 3], place[e]);
    }
    const target = low.map((l, a) => (l + high[a]) / 2 || 0) as Place;
    return { target, from, up, height: MARGIN * this.picture.heightFor(target, from, up, this.stage.aspect) };
  }

  reset(): void {
    this.stage.look = this.whole();
  }

  /** The middle of what is chosen becomes that of the picture; without anything chosen, all is in sight. */
  centre(): void {
    const middle = this.choosing.middle();
    if (middle) this.stage.look = { ...this.stage.look, target: middle as Place };
    else this.stage.look = this.whole(this.stage.look.from, this.stage.look.up);
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
