// Grains as ray-cast spheres: a square each, on which every pixel asks where its ray meets the sphere.

import * as three from "three";
import { COMMON } from "./glsl";
import { CORNER, Squares } from "./squares";

const VERTEX = /* glsl */ `
uniform mat4 modelViewMatrix;
uniform float uSize;
uniform float uPixel; // pixels for a length of one at distance one (or at any, orthographic)
in vec3 place;
in float radius;
in vec4 colour;
in vec3 cover;
in float mark;
out vec3 vOnQuad;
out vec2 vCorner;
flat out vec3 vCentre;
flat out float vRadius;
flat out vec3 vColour;
flat out vec3 vCover;
flat out float vMark;

void main() {
  vec2 corner = cornerOf(gl_VertexID);
  vec3 c = (modelViewMatrix * vec4(place, 1.0)).xyz;
  float r = radius * uSize;
  vCentre = c;
  vRadius = r;
  vColour = colour.rgb;
  vCover = mat3(modelViewMatrix) * cover;
  vMark = mark;
  vCorner = corner;
#ifdef PLAIN
  float grown = mark > 0.5 ? max(1.5 * r, r + 2.0 / uPixel * (isOrtho() ? 1.0 : -c.z)) : r;
  vCorner *= grown / r;
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
  if (colour.a < 0.5 || c.z > -0.2 * r) gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // hidden, or behind the eye
}
`;

const FRAGMENT = /* glsl */ `
uniform vec3 uInk;
in vec3 vOnQuad;
in vec2 vCorner;
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
    if (vMark < 0.5) discard;
    outColour = vec4(vMark > 1.5 ? vec3(0.9, 0.35, 0.0) : uInk, 1.0);
    return;
  }
  vec3 normal = vec3(vCorner, sqrt(1.0 - d));
  float open = (1.0 - 0.85 * max(dot(normal, vCover), 0.0)) * (1.0 - 0.35 * length(vCover));
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
  float open = 1.0 - 0.85 * max(dot(normal, vCover), 0.0);
  open *= 1.0 - 0.35 * length(vCover);
  outColour = vec4(lit(vColour, normal, -ray, open, -p.z), vMark > 0.5 ? 1.0 : cover);
  gl_FragDepth = depthOf(p);
}
#endif
`;

export class GrainsMesh extends Squares {
  constructor(uniforms: Record<string, three.IUniform>, smooth: boolean) {
    super(COMMON + CORNER + VERTEX, COMMON + FRAGMENT, uniforms, [
      ["place", 3, Float32Array], ["radius", 1, Float32Array], ["colour", 4, Uint8Array],
      ["cover", 3, Float32Array], ["mark", 1, Float32Array],
    ], smooth);
  }
}
