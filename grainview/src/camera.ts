// Camera movements: reset, centring, rotation, panning and zoom.

import * as three from "three";
import { principalAxes } from "./data/clusters";
import type { Look } from "./scene/look";

type Vector3 = [number, number, number];

/** The camera that is moved. */
export interface Camera {
  look: Look;
  readonly aspect: number;
}

/** Grains that can be framed. */
export interface FramedGrains {
  readonly positions: Float32Array;
  readonly shown: Uint8Array | null;
  heightFor(target: number[], from: number[], up: number[], aspect: number, mask: Uint8Array | null): number;
}

/** The selection that can be centred. */
export interface CentredSelection {
  cluster(): Uint8Array | null;
  centre(): number[] | null;
}

/** What the page tells of a first view of the largest cluster. */
export const CLOSE_UP = "The largest cluster. Press r for the whole box.";
/** Height of a view relative to that of its content. */
const MARGIN = 1.08;
/** Height of a view broadside relative to that at which the cluster fills it: room for the legend beside it. */
const BESIDE = 1.15;
/** Height [pixels] of the largest cluster in the view of everything from which on that view shows its shape. */
const LEGIBLE = 12;

export class CameraController {
  constructor(
    private readonly camera: Camera,
    private readonly grains: FramedGrains,
    private readonly selection: CentredSelection,
  ) {}

  /** The view of the grains of a mask (null: all shown grains and the box); by default obliquely from above. */
  overview(from: Vector3 = [0.52, -0.74, 0.43], up: Vector3 = [0, 0, 1], mask = this.grains.shown): Look {
    const { positions } = this.grains;
    const min = [Infinity, Infinity, Infinity];
    const max = [-Infinity, -Infinity, -Infinity];
    for (let e = 0; e < positions.length; e++) {
      if ((mask && !mask[Math.floor(e / 3)]) || !Number.isFinite(positions[e])) continue;
      min[e % 3] = Math.min(min[e % 3], positions[e]);
      max[e % 3] = Math.max(max[e % 3], positions[e]);
    }
    const target = min.map((x, a) => (x + max[a]) / 2 || 0) as Vector3;
    return { target, from, up, height: MARGIN * this.grains.heightFor(target, from, up, this.camera.aspect, mask) };
  }

  reset(): void {
    this.camera.look = this.overview();
  }

  /**
   * Centre the selection. A cluster is scaled to fill the view; for a contact or a single grain the scale is kept, so
   * that its surroundings stay visible. Without a selection, everything is shown.
   */
  centre(): void {
    const { look } = this.camera;
    const [cluster, centre] = [this.selection.cluster(), this.selection.centre()];
    if (cluster || !centre) this.camera.look = this.overview(look.from, look.up, cluster ?? undefined);
    else this.camera.look = { ...look, target: centre as Vector3 };
  }

  /**
   * Aim at a cluster (a mask of its grains) from the overview's side, at twice the distance at which it fills the view,
   * so that its surroundings stay visible, and not from farther than the overview; without a cluster show everything.
   */
  showCluster(cluster: Uint8Array | null): void {
    const everything = this.overview();
    const near = cluster && this.overview(everything.from, everything.up, cluster);
    this.camera.look = near ? { ...near, height: Math.min(2 * near.height, everything.height) } : everything;
  }

  /** A cluster with its longest axis across the view and its shortest towards the eye; null: show everything. */
  showBroadside(cluster: Uint8Array | null): void {
    if (!cluster) return this.reset();
    const [from, up] = principalAxes(this.grains.positions, cluster)
      .map((axis) => (axis[2] < 0 ? axis.map((x) => -x) : axis) as Vector3);
    const look = this.overview(from, up, cluster);
    this.camera.look = { ...look, height: BESIDE * look.height };
  }

  /**
   * The first view: everything, or the cluster where it would be too small in that view to show its shape.
   *
   * @param pixels height of the picture
   * @returns whether the cluster is aimed at, so that the box may be cut off
   */
  showFirst(cluster: Uint8Array | null | false, pixels: number): boolean {
    const everything = this.overview();
    const near = cluster ? this.overview(everything.from, everything.up, cluster).height : Infinity;
    const aims = (near / everything.height) * pixels < LEGIBLE;
    this.showCluster(aims && cluster ? cluster : null);
    return aims;
  }

  /** Fit the isolated cluster to the view, if it differs from the grains shown before (a mask; null: all). */
  fitIsolated(before: Uint8Array | null): void {
    const { shown } = this.grains;
    if (!shown || (before && shown.every((on, i) => on === before[i]))) return;
    this.camera.look = this.overview(this.camera.look.from, this.camera.look.up);
  }

  lookAlong(from: Vector3, up: Vector3): void {
    this.camera.look = { ...this.camera.look, from, up };
  }

  /** Rotate the eye around the target, to the right and upwards [rad]. */
  turn(sideways: number, upwards: number): void {
    const { look } = this.camera;
    const up = new three.Vector3(...look.up);
    const from = new three.Vector3(...look.from).applyAxisAngle(up, sideways);
    const right = new three.Vector3().crossVectors(up, from).normalize();
    const turned = from.clone().applyAxisAngle(right, -upwards);
    if (Math.abs(turned.dot(up)) < 0.998) from.copy(turned); // not over the pole
    this.camera.look = { ...look, from: from.toArray() };
  }

  /** Move the target in the plane of the view, in units of the height of the view. */
  pan(toRight: number, upwards: number): void {
    const { look } = this.camera;
    const from = new three.Vector3(...look.from);
    const right = new three.Vector3().crossVectors(new three.Vector3(...look.up), from).normalize();
    const up = new three.Vector3().crossVectors(from, right).normalize();
    const target = new three.Vector3(...look.target);
    target.addScaledVector(right, toRight * look.height).addScaledVector(up, upwards * look.height);
    this.camera.look = { ...look, target: target.toArray() };
  }

  zoom(factor: number): void {
    const { look } = this.camera;
    this.camera.look = { ...look, height: look.height * factor };
  }
}
