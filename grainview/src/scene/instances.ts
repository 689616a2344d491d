// Many copies of one square, each with its own numbers: what grains, contacts and arrows are drawn with.

import * as three from "three";

type Column = [name: string, size: number, kind: typeof Float32Array | typeof Uint8Array];

/** A mesh of squares; `set` gives each of them its numbers. */
export class Instances {
  readonly mesh: three.Mesh<three.InstancedBufferGeometry, three.RawShaderMaterial>;
  private room = 0;

  constructor(
    vertexShader: string,
    fragmentShader: string,
    readonly uniforms: Record<string, three.IUniform>,
    private readonly columns: Column[],
  ) {
    const geometry = new three.InstancedBufferGeometry();
    const corners = new Float32Array([-1, -1, 1, -1, 1, 1, -1, 1]);
    geometry.setAttribute("corner", new three.BufferAttribute(corners, 2));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    geometry.instanceCount = 0;
    const material = new three.RawShaderMaterial({
      vertexShader, fragmentShader, uniforms, glslVersion: three.GLSL3, side: three.DoubleSide,
      alphaToCoverage: true, // smooth edges where the canvas is sampled more than once
    });
    this.mesh = new three.Mesh(geometry, material);
    this.mesh.frustumCulled = false;
  }

  get count(): number {
    return this.mesh.geometry.instanceCount;
  }

  set visible(on: boolean) {
    this.mesh.visible = on;
  }

  /** Numbers of every copy by column; columns left out stay as they are, if there is the same number of copies. */
  set(count: number, values: Record<string, Float32Array | Uint8Array>): void {
    const geometry = this.mesh.geometry;
    if (count > this.room || !geometry.getAttribute(this.columns[0][0])) this.grow(Math.ceil(count * 1.25) + 16);
    for (const [name, array] of Object.entries(values)) {
      const attribute = geometry.getAttribute(name) as three.InstancedBufferAttribute;
      (attribute.array as Float32Array).set(array);
      attribute.clearUpdateRanges();
      attribute.addUpdateRange(0, array.length);
      attribute.needsUpdate = true;
    }
    geometry.instanceCount = count;
  }

  private grow(room: number): void {
    const geometry = this.mesh.geometry;
    for (const [name, size, Kind] of this.columns) {
      const old = geometry.getAttribute(name) as three.InstancedBufferAttribute | undefined;
      const attribute = new three.InstancedBufferAttribute(new Kind(room * size), size, Kind === Uint8Array);
      if (old) (attribute.array as Float32Array).set(old.array as Float32Array);
      attribute.setUsage(three.DynamicDrawUsage);
      geometry.setAttribute(name, attribute);
    }
    geometry.dispose(); // buffers of the old size are given back
    this.room = room;
  }
}
