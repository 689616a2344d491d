// Many squares in one geometry, each with its own numbers: what grains, contacts and arrows are drawn with.
//
// The numbers are in textures, one texel for a square, and every vertex fetches those of its square.  Instancing would
// do the same, but software that draws without a graphics card takes each instance for a drawing of its own, which at
// 100 000 grains is seconds; and numbers repeated at each corner would be four times as much to hand over.

import * as three from "three";

const WIDE = 2048; // texels in a row

/** What vertex shaders begin with: corner (±1, ±1) and number of the square of the vertex at hand, its numbers. */
export const SQUARE = /* glsl */ `
vec2 cornerOf(int vertex) {
  int k = vertex & 3;
  return vec2(k == 1 || k == 2 ? 1.0 : -1.0, k >= 2 ? 1.0 : -1.0);
}

vec4 fetched(highp sampler2D column, int vertex) {
  int square = vertex >> 2;
  return texelFetch(column, ivec2(square & ${WIDE - 1}, square / ${WIDE}), 0);
}
`;

/** Four numbers for each square, in a texture that grows. */
export class Column<Numbers extends Float32Array | Uint8Array> {
  readonly uniform: three.IUniform<three.DataTexture>;

  constructor(private readonly Kind: new (length: number) => Numbers) {
    this.uniform = { value: this.texture(1) };
  }

  private texture(rows: number): three.DataTexture {
    const bytes = (this.Kind as unknown) === Uint8Array;
    const data = new this.Kind(4 * WIDE * rows) as Uint8Array<ArrayBuffer> | Float32Array<ArrayBuffer>;
    const type = bytes ? three.UnsignedByteType : three.FloatType;
    return new three.DataTexture(data, WIDE, rows, three.RGBAFormat, type);
  }

  /** The array of numbers with room for so many squares, to be written; it is handed over at the next drawing. */
  write(count: number): Numbers {
    const rows = Math.max(Math.ceil(count / WIDE), 1);
    const old = this.uniform.value;
    if (rows > old.image.height) {
      this.uniform.value = this.texture(Math.ceil(rows * 1.1));
      (this.uniform.value.image.data as Float32Array).set(old.image.data as Float32Array);
      old.dispose();
    }
    this.uniform.value.needsUpdate = true;
    return this.uniform.value.image.data as unknown as Numbers;
  }
}

/** A mesh of squares. */
export class Squares {
  readonly mesh: three.Mesh<three.BufferGeometry, three.RawShaderMaterial>;
  private room = 0;
  private readonly fine: three.RawShaderMaterial;
  private readonly plain: three.RawShaderMaterial;

  /**
   * @param vertexShader both for what is seen from near, ray-cast, and (with PLAIN defined) for what is small: a few
   *   pixels wide, its depth that of the square, so that nothing is asked for each pixel
   * @param uniforms columns of numbers are among them
   * @param smooth the canvas has several samples for a pixel, so edges can be between
   */
  constructor(
    vertexShader: string,
    fragmentShader: string,
    readonly uniforms: Record<string, three.IUniform>,
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

  /** How many squares there are. */
  set count(count: number) {
    if (count > this.room || !this.room) this.grow(Math.ceil(count * 1.25) + 16);
    this.mesh.geometry.setDrawRange(0, 6 * count);
  }

  private grow(room: number): void {
    const corners = new Uint32Array(6 * room);
    for (let k = 0; k < room; k++) {
      for (const [e, c] of [0, 1, 2, 0, 2, 3].entries()) corners[6 * k + e] = 4 * k + c;
    }
    this.mesh.geometry.dispose();
    this.mesh.geometry = new three.BufferGeometry();
    this.mesh.geometry.setIndex(new three.BufferAttribute(corners, 1));
    this.room = room;
  }
}
