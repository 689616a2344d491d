// Many squares in one geometry, each with its own numbers: what grains, contacts and arrows are drawn with.
//
// Every number is there four times, once for each corner.  Instancing would save that, but software that draws without
// a graphics card takes each instance for a drawing of its own, which at 100 000 grains is seconds.

import * as three from "three";

type Kind = typeof Float32Array | typeof Uint8Array;
type Column = [name: string, size: number, kind: Kind];

/** What vertex shaders begin with: the corner, (±1, ±1), of the vertex at hand. */
export const CORNER = /* glsl */ `
vec2 cornerOf(int vertex) {
  int k = vertex & 3;
  return vec2(k == 1 || k == 2 ? 1.0 : -1.0, k >= 2 ? 1.0 : -1.0);
}
`;

/** A mesh of squares; `set` gives each of them its numbers. */
export class Squares {
  readonly mesh: three.Mesh<three.BufferGeometry, three.RawShaderMaterial>;
  count = 0;
  private room = 0;

  private readonly fine: three.RawShaderMaterial;
  private readonly plain: three.RawShaderMaterial;

  /**
   * @param vertexShader both for what is seen from near, ray-cast, and (with PLAIN defined) for what is small: a few
   *   pixels wide, its depth that of the square, so that nothing is asked for each pixel
   * @param smooth the canvas has several samples for a pixel, so edges can be between
   */
  constructor(
    vertexShader: string,
    fragmentShader: string,
    readonly uniforms: Record<string, three.IUniform>,
    private readonly columns: Column[],
    smooth: boolean,
  ) {
    const common = { uniforms, glslVersion: three.GLSL3, side: three.DoubleSide };
    this.fine = new three.RawShaderMaterial({
      ...common, vertexShader, fragmentShader, alphaToCoverage: smooth, defines: smooth ? { SMOOTH: "" } : {},
      // an edge that covers half a pixel must not make the canvas half transparent there
      blending: three.CustomBlending, blendSrc: three.OneFactor, blendDst: three.ZeroFactor,
      blendSrcAlpha: three.OneFactor, blendDstAlpha: three.OneFactor, blendEquationAlpha: three.MaxEquation,
    });
    this.plain = new three.RawShaderMaterial({ ...common, vertexShader, fragmentShader, defines: { PLAIN: "" } });
    this.mesh = new three.Mesh(new three.BufferGeometry(), this.fine);
    this.mesh.frustumCulled = false;
  }

  set isPlain(on: boolean) {
    this.mesh.material = on ? this.plain : this.fine;
  }

  set visible(on: boolean) {
    this.mesh.visible = on;
  }

  /** Numbers of every square by column; columns left out stay as they are, if there are as many squares as before. */
  set(count: number, values: Record<string, Float32Array | Uint8Array>): void {
    if (count > this.room || !this.room) this.grow(Math.ceil(count * 1.25) + 16);
    for (const [name, size] of this.columns) {
      if (!(name in values)) continue;
      const attribute = this.mesh.geometry.getAttribute(name) as three.BufferAttribute;
      fourTimes(values[name], size, attribute.array as Float32Array, count);
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, 4 * size * count);
      attribute.needsUpdate = true;
    }
    this.count = count;
    this.mesh.geometry.setDrawRange(0, 6 * count);
  }

  private grow(room: number): void {
    const old = this.mesh.geometry;
    const geometry = new three.BufferGeometry();
    for (const [name, size, Numbers] of this.columns) {
      const array = new Numbers(4 * room * size);
      if (this.room) array.set(old.getAttribute(name).array as Float32Array);
      const attribute = new three.BufferAttribute(array, size, Numbers === Uint8Array);
      attribute.setUsage(three.DynamicDrawUsage);
      geometry.setAttribute(name, attribute);
    }
    const corners = new Uint32Array(6 * room);
    for (let k = 0; k < room; k++) corners.set([4 * k, 4 * k + 1, 4 * k + 2, 4 * k, 4 * k + 2, 4 * k + 3], 6 * k);
    geometry.setIndex(new three.BufferAttribute(corners, 1));
    old.dispose();
    this.mesh.geometry = geometry;
    this.room = room;
  }
}

function fourTimes(from: ArrayLike<number>, size: number, to: Float32Array | Uint8Array, count: number): void {
  for (let k = 0, at = 0; k < count; k++) {
    for (let c = 0; c < 4; c++) for (let a = 0; a < size; a++) to[at++] = from[size * k + a];
  }
}
