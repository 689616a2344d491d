// Many squares in one geometry, each with its own data; grains, contacts and arrows are drawn on them.
//
// The data are in textures, one texel per square, which every vertex of the square fetches. Instancing was not chosen
// because software renderers treat each instance as a separate draw call, which takes seconds for 100 000 grains, nor
// vertex attributes, which would transfer the data of a square four times.

import * as three from "three";

const ROW = 2048; // texels per row

/** Functions of the vertex shaders: the corner (±1, ±1) of a vertex, and the data of its square. */
export const SQUARE = /* glsl */ `
vec2 cornerOf(int vertex) {
  int k = vertex & 3;
  return vec2(k == 1 || k == 2 ? 1.0 : -1.0, k >= 2 ? 1.0 : -1.0);
}

vec4 fetched(highp sampler2D column, int vertex) {
  int square = vertex >> 2;
  return texelFetch(column, ivec2(square & ${ROW - 1}, square / ${ROW}), 0);
}
`;

/** Four numbers per square, in a texture that grows as needed. */
export class Column<Numbers extends Float32Array | Uint8Array> {
  readonly uniform: three.IUniform<three.DataTexture>;

  constructor(private readonly ArrayType: new (length: number) => Numbers) {
    this.uniform = { value: this.texture(1) };
  }

  private texture(rows: number): three.DataTexture {
    const bytes = (this.ArrayType as unknown) === Uint8Array;
    const data = new this.ArrayType(4 * ROW * rows) as Uint8Array<ArrayBuffer> | Float32Array<ArrayBuffer>;
    const type = bytes ? three.UnsignedByteType : three.FloatType;
    return new three.DataTexture(data, ROW, rows, three.RGBAFormat, type);
  }

  /** The array to be written, with capacity for `count` squares; it is transferred at the next drawing. */
  write(count: number): Numbers {
    const rows = Math.max(Math.ceil(count / ROW), 1);
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
  private capacity = 0;
  private readonly detailed: three.RawShaderMaterial;
  private readonly simplified: three.RawShaderMaterial;

  /**
   * @param vertexShader and fragmentShader are compiled twice: ray-cast, and simplified (with SIMPLE defined) for
   *   objects a few pixels wide, whose depth is that of the square
   * @param uniforms including the columns
   * @param smooth whether the canvas is multisampled, so that edges can be antialiased
   */
  constructor(
    vertexShader: string,
    fragmentShader: string,
    readonly uniforms: Record<string, three.IUniform>,
    smooth: boolean,
  ) {
    const common = { uniforms, glslVersion: three.GLSL3, side: three.DoubleSide };
    this.detailed = new three.RawShaderMaterial({
      ...common, vertexShader, fragmentShader, alphaToCoverage: smooth, defines: smooth ? { SMOOTH: "" } : {},
      // partially covered pixels at edges must stay opaque
      blending: three.CustomBlending, blendSrc: three.OneFactor, blendDst: three.ZeroFactor,
      blendSrcAlpha: three.OneFactor, blendDstAlpha: three.OneFactor, blendEquationAlpha: three.MaxEquation,
    });
    this.simplified = new three.RawShaderMaterial({ ...common, vertexShader, fragmentShader, defines: { SIMPLE: "" } });
    this.mesh = new three.Mesh(new three.BufferGeometry(), this.detailed);
    this.mesh.frustumCulled = false;
  }

  set isSimplified(on: boolean) {
    this.mesh.material = on ? this.simplified : this.detailed;
  }

  set visible(on: boolean) {
    this.mesh.visible = on;
  }

  /** Number of squares that are drawn. */
  set count(count: number) {
    if (count > this.capacity || !this.capacity) this.grow(Math.ceil(count * 1.25) + 16);
    this.mesh.geometry.setDrawRange(0, 6 * count);
  }

  private grow(capacity: number): void {
    const corners = new Uint32Array(6 * capacity);
    for (let k = 0; k < capacity; k++) {
      for (const [e, c] of [0, 1, 2, 0, 2, 3].entries()) corners[6 * k + e] = 4 * k + c;
    }
    this.mesh.geometry.dispose();
    this.mesh.geometry = new three.BufferGeometry();
    this.mesh.geometry.setIndex(new three.BufferAttribute(corners, 1));
    this.capacity = capacity;
  }
}
