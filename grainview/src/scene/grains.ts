// Grains as ray-cast spheres: a square each, on which every pixel asks where its ray meets the sphere.

import * as three from "three";
import { COMMON } from "./glsl";
import { Column, SQUARE, Squares } from "./squares";

const VERTEX = /* glsl */ `
uniform mat4 modelViewMatrix;
uniform float uSize;
uniform float uPixel; // pixels for a length of one at distance one (or at any, orthographic)
uniform highp sampler2D uPlace;  // and radius
uniform highp sampler2D uColour; // and whether it is shown
uniform highp sampler2D uCover;  // from 0 for −1 to 1; and what it is marked as
out vec3 vOnQuad;
out vec2 vCorner;
flat out float vEdge; // of the ring around what is chosen, in radii
flat out vec3 vCentre;
flat out float vRadius;
flat out vec3 vColour;
flat out vec3 vCover;
flat out float vMark;

void main() {
  vec2 corner = cornerOf(gl_VertexID);
  vec4 place = fetched(uPlace, gl_VertexID);
  vec4 colour = fetched(uColour, gl_VertexID);
  vec4 cover = fetched(uCover, gl_VertexID);
  float mark = floor(255.0 * cover.a + 0.5);
  vec3 c = (modelViewMatrix * vec4(place.xyz, 1.0)).xyz;
  float r = place.w * uSize;
#ifdef PLAIN
  r = max(r, 0.75 / uPixel * (isOrtho() ? 1.0 : -c.z)); // in wide space a grain is a dot still
#endif
  vCentre = c;
  vRadius = r;
  vColour = colour.rgb;
  vCover = mat3(modelViewMatrix) * ((255.0 * cover.rgb - 128.0) / 127.0);
  vMark = mark;
  vCorner = corner;
#ifdef PLAIN
  float grown = mark > 0.5 ? max(1.5 * r, r + 2.0 / uPixel * (isOrtho() ? 1.0 : -c.z)) : r;
  vEdge = grown / r;
  vCorner *= vEdge;
#else
  float grown = r * (mark > 0.5 ? 1.3 : 1.06);
#endif
  vec3 across = vec3(1.0, 0.0, 0.0);
  vec3 up = vec3(0.0, 1.0, 0.0);
  if (!isOrtho()) {
    // seen from near by, a sphere's outline is wider than it
    float d2 = dot(c, c);
    vec3 n = -c * inversesqrt(d2);
    across = normalize(cross(abs(n.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0), n));
    up = cross(n, across);
    grown *= sqrt(d2 / max(d2 - r * r, 1e-6 * d2));
  }
  vOnQuad = c + (corner.x * across + corner.y * up) * grown;
  gl_Position = projectionMatrix * vec4(vOnQuad, 1.0);
#ifdef PLAIN
  // as near as the sphere is, so that bars within it are hidden
  vec4 front = projectionMatrix * vec4(c + r * (isOrtho() ? vec3(0.0, 0.0, 1.0) : normalize(-c)), 1.0);
  gl_Position.z = front.z / front.w * gl_Position.w;
#endif
  bool behind = !isOrtho() && c.z > -0.2 * r; // the eye
  if (colour.a < 0.5 || behind) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
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
flat in vec3 vCover;
flat in float vMark;
out vec4 outColour;

#ifdef PLAIN
void main() {
  float d = dot(vCorner, vCorner);
  if (d > 1.0) {
    if (vMark < 0.5 || d > vEdge * vEdge) discard;
    outColour = vec4(vMark > 1.5 ? vec3(0.9, 0.35, 0.0) : uInk, 1.0);
    return;
  }
  vec3 normal = vec3(vCorner, sqrt(1.0 - d));
  float open = (1.0 - 0.8 * max(dot(normal, vCover), 0.0)) * (1.0 - 0.22 * length(vCover));
  outColour = vec4(plainlyLit(vColour, normal, open, -vCentre.z), 1.0);
}
#else
void main() {
  vec3 origin = rayOrigin(vOnQuad);
  vec3 ray = rayDirection(vOnQuad);
  vec3 to = vCentre - origin;
  float b = dot(ray, to);
  vec3 beside = to - b * ray;
  float room = vRadius * vRadius - dot(beside, beside);
#ifdef SMOOTH
  float cover = clamp(0.5 + room / max(fwidth(room), 1e-12), 0.0, 1.0);
#else
  float cover = room < 0.0 ? 0.0 : 1.0;
#endif
  if (cover == 0.0 || (vMark > 0.5 && room < 0.0)) {
    // a ring around what is chosen
    float wide = vRadius * 1.22;
    if (vMark < 0.5 || wide * wide < dot(beside, beside)) discard;
    outColour = vec4(vMark > 1.5 ? vec3(0.9, 0.35, 0.0) : uInk, 1.0);
    gl_FragDepth = depthOf(origin + b * ray);
    return;
  }
  vec3 p = origin + (b - sqrt(max(room, 0.0))) * ray;
  vec3 normal = (p - vCentre) / vRadius;
  float open = 1.0 - 0.8 * max(dot(normal, vCover), 0.0);
  open *= 1.0 - 0.22 * length(vCover);
  outColour = vec4(lit(vColour, normal, -ray, open, -p.z), vMark > 0.5 ? 1.0 : cover);
  gl_FragDepth = depthOf(p);
}
#endif
`;

export class GrainsMesh extends Squares {
  readonly place = new Column(Float32Array);
  private readonly colour = new Column(Uint8Array);
  private readonly cover = new Column(Uint8Array);

  constructor(uniforms: Record<string, three.IUniform>, smooth: boolean) {
    const own: Record<string, three.IUniform> = { ...uniforms };
    super(COMMON + SQUARE + VERTEX, COMMON + FRAGMENT, own, smooth);
    own.uPlace = this.place.uniform;
    own.uColour = this.colour.uniform;
    own.uCover = this.cover.uniform;
  }

  set(place: Float32Array, radius: Float32Array, colour: Uint8Array): void {
    const count = radius.length;
    const places = this.place.write(count);
    for (let i = 0; i < count; i++) {
      places[4 * i] = place[3 * i];
      places[4 * i + 1] = place[3 * i + 1];
      places[4 * i + 2] = place[3 * i + 2];
      places[4 * i + 3] = radius[i];
    }
    this.colour.write(count).set(colour);
    this.count = count;
  }

  /** Directions in which grains are covered, below 1; null: nowhere. */
  setCover(count: number, cover: Float32Array | null): void {
    const covers = this.cover.write(count);
    for (let i = 0; i < count; i++) {
      for (let a = 0; a < 3; a++) covers[4 * i + a] = cover ? 128.5 + 127 * cover[3 * i + a] : 128;
    }
  }

  /** Marks of grains: 1 chosen, 2 an end of what is measured; all others none. */
  mark(count: number, marks: Map<number, number>): void {
    const covers = this.cover.write(count);
    for (let i = 0; i < count; i++) covers[4 * i + 3] = 0;
    for (const [grain, kind] of marks) covers[4 * grain + 3] = kind;
  }
}
