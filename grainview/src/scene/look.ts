// Camera parameters, and their text form in the address of the page.

/** Target, unit vector from the target to the eye, up vector, and height of the visible plane through the target. */
export interface Look {
  target: [number, number, number];
  from: [number, number, number];
  up: [number, number, number];
  height: number;
}

/** Ten numbers with six digits each: target, from, up, height. */
export function lookToText({ target, from, up, height }: Look): string {
  return [...target, ...from, ...up, height].map((v) => Number(v.toPrecision(6))).join(",");
}

/** Parse camera parameters; null if the text is invalid or the up vector is parallel to the line of sight. */
export function lookFromText(text: string): Look | null {
  const v = text.split(",").map(Number);
  if (v.length !== 10 || !v.every((x) => Math.abs(x) < 1e9) || !(v[9] > 1e-6)) return null;
  const [target, from, up] = [0, 3, 6].map((k) => v.slice(k, k + 3) as [number, number, number]);
  const cross = [0, 1, 2].map((a) => from[(a + 1) % 3] * up[(a + 2) % 3] - from[(a + 2) % 3] * up[(a + 1) % 3]);
  const parallel = !(Math.hypot(...cross) > 1e-6 * Math.hypot(...from) * Math.hypot(...up));
  return parallel ? null : { target, from, up, height: v[9] };
}
