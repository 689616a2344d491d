// Directions beside the scene: the axes, the magnetic field and the net moment, as lines in pixels.

import * as three from "three";

const ARM = 26; // length of the axes [pixels]
const FULL = 1.2; // length of the arrows of the field, and of a net moment of all moments in line, over that of an axis
const HEAD = 8; // length of an arrow head [pixels]
const GAP = 10; // from the end of a line to the middle of its name [pixels]

export interface DirectedView {
  readonly height: number;
  readonly camera: { readonly matrixWorldInverse: three.Matrix4 };
}

/** What is shown besides the axes; the length of the moment is its share of the sum of magnitudes. */
export interface Directions {
  field: number[] | null;
  moment: number[] | null;
}

export interface Arm {
  kind: "" | "field" | "moment";
  name: string;
  from: [number, number];
  to: [number, number];
  label: [number, number];
  head: [number, number][]; // corners of the arrow head; empty: none
}

/** Lines and names near the lower left corner, in pixels; `scale`: size relative to the page. */
export function armsOf(view: DirectedView, { field, moment }: Directions, scale = 1): Arm[] {
  const arm = (x: number, direction: number[], name: string, kind: Arm["kind"]): Arm => {
    const size = Math.hypot(...direction);
    const v = new three.Vector3(...direction).transformDirection(view.camera.matrixWorldInverse);
    const [dx, dy] = [ARM * scale * size * v.x, -ARM * scale * size * v.y];
    const length = Math.hypot(dx, dy);
    const [ux, uy] = length > 1e-9 ? [dx / length, dy / length] : [0, -1];
    const from: [number, number] = [scale * x, view.height - 44 * scale];
    const at = (along: number, side = 0): [number, number] => (
      [from[0] + dx + scale * (along * ux - side * uy), from[1] + dy + scale * (along * uy + side * ux)]
    );
    const head = kind && length > scale ? [at(2), at(-HEAD, 0.45 * HEAD), at(-HEAD, -0.45 * HEAD)] : [];
    return { kind, name, from, to: at(0), label: at(GAP), head };
  };
  const arms = ["x", "y", "z"].map((name, a) => arm(44, [0, 1, 2].map((b) => Number(a === b)), name, ""));
  const beside = [[field, "B", "field"], [moment, "Σμ", "moment"]] as const;
  for (const [direction, name, kind] of beside) {
    const x = 116 + 72 * (arms.length - 3);
    if (direction && Math.hypot(...direction)) arms.push(arm(x, direction.map((v) => FULL * v), name, kind));
  }
  return arms;
}
