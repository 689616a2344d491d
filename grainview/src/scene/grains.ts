// Grains as spheres, ray-cast on one square per grain.

import * as three from "three";
import { COMMON } from "./glsl";
import { Column, SQUARE, Squares } from "./squares";

const VERTEX = /* glsl */ `
uniform mat4 modelViewMatrix;
uniform float uSize;
uniform float uPixel; // pixels per unit length at unit distance (orthographic: at any distance)
uniform highp sampler2D uPosition;  // and radius
uniform highp sampler2D uColour;    // and visibility
uniform highp sampler2D uOcclusion; // components from 0 for −1 to 1 for 1; and mark
out vec3 vOnQuad;
out vec2 vCorner;
flat out float vEdge; // radius of the ring around a marked grain, in radii
flat out vec3 vCentre;
flat out float vRadius;
flat out vec3 vColour;
flat out vec3 vOcclusion;
flat out float vMark;

void main() {
  vec2 corner = cornerOf(gl_VertexID);
  vec4 position = fetched(uPosition, gl_VertexID);
  vec4 colour = fetched(uColour, gl_VertexID);
  vec4 occluded = fetched(uOcclusion, gl_VertexID);
  float mark = floor(255.0 * occluded.a + 0.5);
  vec3 c = (modelViewMatrix * vec4(position.xyz, 1.0)).xyz;
  float r = position.w * uSize;
#ifdef SIMPLE
  r = max(r, 0.75 / uPixel * (isOrtho() ? 1.0 : -c.z)); // at any distance a grain covers at least about a pixel
#endif
  vCentre = c;
  vRadius = r;
  vColour = colour.rgb;
  vOcclusion = mat3(modelViewMatrix) * ((255.0 * occluded.rgb - 128.0) / 127.0);
  vMark = mark;
  vCorner = corner;
#ifdef SIMPLE
  float extent = mark > 0.5 ? max(1.5 * r, r + 2.0 / uPixel * (isOrtho() ? 1.0 : -c.z)) : r;
  vEdge = extent / r;
  vCorner *= vEdge;
#else
  float extent = r * (mark > 0.5 ? 1.3 : 1.06);
#endif
  vec3 across = vec3(1.0, 0.0, 0.0);
  vec3 up = vec3(0.0, 1.0, 0.0);
  if (!isOrtho()) {
    // in perspective the outline of a sphere is larger than its radius
    float d2 = dot(c, c);
    vec3 n = -c * inversesqrt(d2);
    across = normalize(cross(abs(n.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0), n));
    up = cross(n, across);
    extent *= sqrt(d2 / max(d2 - r * r, 1e-6 * d2));
  }
  vOnQuad = c + (corner.x * across + corner.y * up) * extent;
  gl_Position = projectionMatrix * vec4(vOnQuad, 1.0);
#ifdef SIMPLE
  // depth of the front of the sphere, so that it hides bars inside it
  vec4 front = projectionMatrix * vec4(c + r * (isOrtho() ? vec3(0.0, 0.0, 1.0) : normalize(-c)), 1.0);
  gl_Position.z = front.z / front.w * gl_Position.w;
#endif
  bool behindEye = !isOrtho() && c.z > -0.2 * r;
  if (colour.a < 0.5 || behindEye) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}
`;

const FRAGMENT = /* glsl */ `
uniform vec3 uInk;
in vec3 vOnQuad;
in vec2 vCorner;
flat in float vEdge;
flat in vec3 vCentre;
flat in float vRadius;
flat in vec3 vColour;
flat in vec3 vOcclusion;
flat in float vMark;
out vec4 outColour;

#ifdef SIMPLE
void main() {
  float d = dot(vCorner, vCorner);
  if (d > 1.0) {
    if (vMark < 0.5 || d > vEdge * vEdge) discard;
    outColour = vec4(vMark > 1.5 ? vec3(0.9, 0.35, 0.0) : uInk, 1.0);
    return;
  }
  vec3 normal = vec3(vCorner, sqrt(1.0 - d));
  float openness = (1.0 - 0.8 * max(dot(normal, vOcclusion), 0.0)) * (1.0 - 0.22 * length(vOcclusion));
  outColour = vec4(simplyLit(vColour, normal, openness, -vCentre.z), 1.0);
}
#else
void main() {
  vec3 origin = rayOrigin(vOnQuad);
  vec3 ray = rayDirection(vOnQuad);
  vec3 toCentre = vCentre - origin;
  float b = dot(ray, toCentre);
  vec3 across = toCentre - b * ray;
  float discriminant = vRadius * vRadius - dot(across, across);
#ifdef SMOOTH
  float coverage = clamp(0.5 + discriminant / max(fwidth(discriminant), 1e-12), 0.0, 1.0);
#else
  float coverage = discriminant < 0.0 ? 0.0 : 1.0;
#endif
  if (coverage == 0.0 || (vMark > 0.5 && discriminant < 0.0)) {
    // a ring around a marked grain
    float ring = vRadius * 1.22;
    if (vMark < 0.5 || ring * ring < dot(across, across)) discard;
    outColour = vec4(vMark > 1.5 ? vec3(0.9, 0.35, 0.0) : uInk, 1.0);
    gl_FragDepth = depthOf(origin + b * ray);
    return;
  }
  vec3 p = origin + (b - sqrt(max(discriminant, 0.0))) * ray;
  vec3 normal = (p - vCentre) / vRadius;
  float openness = 1.0 - 0.8 * max(dot(normal, vOcclusion), 0.0);
  openness *= 1.0 - 0.22 * length(vOcclusion);
  outColour = vec4(lit(vColour, normal, -ray, openness, -p.z), vMark > 0.5 ? 1.0 : coverage);
  gl_FragDepth = depthOf(p);
}
#endif
`;

export class GrainsMesh extends Squares {
  readonly position = new Column(Float32Array);
  private readonly colour = new Column(Uint8Array);
  private readonly occlusion = new Column(Uint8Array);

  constructor(uniforms: Record<string, three.IUniform>, smooth: boolean) {
    const own: Record<string, three.IUniform> = { ...uniforms };
    super(COMMON + SQUARE + VERTEX, COMMON + FRAGMENT, own, smooth);
    own.uPosition = this.position.uniform;
    own.uColour = this.colour.uniform;
    own.uOcclusion = this.occlusion.uniform;
  }

  set(position: Float32Array, radius: Float32Array, colour: Uint8Array): void {
    const count = radius.length;
    const positions = this.position.write(count);
    for (let i = 0; i < count; i++) {
      positions[4 * i] = position[3 * i];
      positions[4 * i + 1] = position[3 * i + 1];
      positions[4 * i + 2] = position[3 * i + 2];
      positions[4 * i + 3] = radius[i];
    }
    this.colour.write(count).set(colour);
    this.count = count;
  }

  /** Vectors (N, 3) of occlusion, lengths below 1; null: none. */
  setOcclusion(count: number, occlusion: Float32Array | null): void {
    const values = this.occlusion.write(count);
    for (let i = 0; i < count; i++) {
      for (let a = 0; a < 3; a++) values[4 * i + a] = occlusion ? 128.5 + 127 * occlusion[3 * i + a] : 128;
    }
  }

  /** Set the marks of grains (1 selected, 2 measured) and remove all others. */
  setMarks(count: number, marks: Map<number, number>): void {
    const values = this.occlusion.write(count);
    for (let i = 0; i < count; i++) values[4 * i + 3] = 0;
    for (const [grain, kind] of marks) values[4 * grain + 3] = kind;
  }
}
