// Magnetic moments as arrows through the centres of grains: shaft and head, ray-cast on one square per arrow.

import { COMMON } from "./glsl";
import { Column, SQUARE, Squares } from "./squares";
import type * as three from "three";

const VERTEX = /* glsl */ `
uniform mat4 modelViewMatrix;
uniform float uMinLength; // of arrows that are drawn [pixels]
uniform float uPixel;   // pixels per unit length at unit distance (orthographic: at any distance)
uniform highp sampler2D uPosition;
uniform highp sampler2D uArrow; // vector from tail to tip
out vec3 vOnQuad;
flat out vec3 vTail;
flat out vec3 vAxis;

void main() {
  vec2 corner = cornerOf(gl_VertexID);
  vec3 c = (modelViewMatrix * vec4(fetched(uPosition, gl_VertexID).xyz, 1.0)).xyz;
  vec3 d = mat3(modelViewMatrix) * fetched(uArrow, gl_VertexID).xyz;
  float size = length(d);
  float halfWidth = 0.13 * size;
  vTail = c - 0.5 * d;
  vAxis = d;
  vec3 toEye = isOrtho() ? vec3(0.0, 0.0, 1.0) : normalize(-c);
  // the long side of the square is along the projected arrow; along its axis the arrow appears as a disc
  vec3 projected = d - dot(d, toEye) * toEye;
  float projectedSize = length(projected);
  vec3 along = projectedSize > 1e-4 * size ? projected / projectedSize : normalize(cross(toEye, vec3(0.3, 1.0, 0.2)));
  vec3 side = cross(toEye, along);
  vec3 middle = c + toEye * 0.5 * size; // in front of the arrow
#ifdef SIMPLE
  // a flat arrow: tail, two barbs, tip
  int k = gl_VertexID & 3;
  float t = k == 0 ? -0.5 : k == 2 ? 0.5 : 0.12;
  vOnQuad = c + t * d + (k == 1 ? 0.08 : k == 3 ? -0.08 : 0.0) * size * side + toEye * 0.1 * size;
#else
  vOnQuad = middle + corner.x * (0.5 * projectedSize + halfWidth) * along + corner.y * halfWidth * side;
#endif
  gl_Position = projectionMatrix * vec4(vOnQuad, 1.0);
  float pixels = size * uPixel / (isOrtho() ? 1.0 : max(-c.z, 1e-6));
  // arrows too small to be visible are left out, which is fast with many grains
  if (size == 0.0 || pixels < uMinLength || (!isOrtho() && c.z > -size)) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}
`;

const FRAGMENT = /* glsl */ `
uniform vec3 uInk;
uniform vec3 uTip;
in vec3 vOnQuad;
flat in vec3 vTail;
flat in vec3 vAxis;
out vec4 outColour;

const float SHAFT = 0.042; // radii, and begin of the head, in lengths of the arrow
const float HEAD = 0.125;
const float NECK = 0.64;

// distance along the ray to the first intersection with shaft, head or their flat ends, and the normal there; -1: none
float intersect(vec3 o, vec3 ray, float size, vec3 axis, out vec3 normal) {
  float best = -1.0;
  float oz = dot(o, axis), rz = dot(ray, axis);
  vec3 oa = o - oz * axis, ra = ray - rz * axis;
  float s = SHAFT * size, neck = NECK * size, h = HEAD * size;
  // shaft
  float a = dot(ra, ra), b = dot(ra, oa), c = dot(oa, oa) - s * s;
  float discriminant = b * b - a * c;
  if (discriminant > 0.0 && a > 1e-10) {
    float t = (-b - sqrt(discriminant)) / a, z = oz + t * rz;
    if (z > 0.0 && z < neck) { best = t; normal = (oa + t * ra) / s; }
  }
  // head: radius h (size - z) / (size - neck)
  float k = h / (size - neck), m = size - oz;
  a = dot(ra, ra) - k * k * rz * rz;
  b = dot(ra, oa) + k * k * rz * m;
  c = dot(oa, oa) - k * k * m * m;
  discriminant = b * b - a * c;
  if (discriminant > 0.0) {
    float root = sqrt(discriminant);
    for (int i = 0; i < 2; i++) {
      float t = abs(a) > 1e-9 ? (-b + (i == 0 ? -root : root)) / a : -0.5 * c / b;
      float z = oz + t * rz;
      if (z >= neck && z <= size && (best < 0.0 || t < best)) {
        best = t;
        normal = normalize(normalize(oa + t * ra) + k * axis);
      }
    }
  }
  // back of the head, end of the shaft
  if (rz > 1e-6) {
    for (int i = 0; i < 2; i++) {
      float t = ((i == 0 ? neck : 0.0) - oz) / rz, radius = i == 0 ? h : s;
      vec3 p = oa + t * ra;
      if (dot(p, p) < radius * radius && (best < 0.0 || t < best)) { best = t; normal = -axis; }
    }
  }
  return best;
}

#ifdef SIMPLE
void main() {
  float haze = uHaze * smoothstep(uDepth.x, uDepth.y, -vOnQuad.z);
  outColour = vec4(mix(uInk, uBackground, haze), 1.0);
}
#else
void main() {
  vec3 origin = rayOrigin(vOnQuad);
  vec3 ray = rayDirection(vOnQuad);
  float size = length(vAxis);
  vec3 axis = vAxis / size;
  // the ray starts close to the arrow, for accuracy in single precision
  float offset = dot(vTail + 0.5 * vAxis - origin, ray) - size;
  vec3 start = origin + offset * ray;
  vec3 normal;
  float t = intersect(start - vTail, ray, size, axis, normal);
  if (t < 0.0) discard;
  vec3 p = start + t * ray;
  vec3 colour = dot(p - vTail, axis) > NECK * size ? uTip : uInk;
  outColour = vec4(lit(colour, normal, -ray, 1.0, -p.z), 1.0);
  gl_FragDepth = depthOf(p);
}
#endif
`;

/** Length of an arrow, in radii of its grain. */
export const ARROW = 4;

export class ArrowsMesh extends Squares {
  private readonly arrow = new Column(Float32Array);

  /** @param position column with the positions of the grains */
  constructor(uniforms: Record<string, three.IUniform>, position: three.IUniform, smooth: boolean) {
    const own: Record<string, three.IUniform> = { ...uniforms, uPosition: position };
    super(COMMON + SQUARE + VERTEX, COMMON + FRAGMENT, own, smooth);
    own.uArrow = this.arrow.uniform;
  }

  /** Arrows along the moments (N, 3), with lengths proportional to the radii of the grains. */
  set(moment: Float32Array, radius: Float32Array, shown: Uint8Array | null): void {
    const count = radius.length;
    const arrow = this.arrow.write(count);
    for (let i = 0; i < count; i++) {
      const [x, y, z] = [moment[3 * i], moment[3 * i + 1], moment[3 * i + 2]];
      const max = Math.max(Math.abs(x), Math.abs(y), Math.abs(z)); // squares of moments in SI units may underflow
      const size = max > 0 ? max * Math.sqrt((x / max) ** 2 + (y / max) ** 2 + (z / max) ** 2) : 0;
      const factor = size > 0 && !(shown && !shown[i]) ? (ARROW * radius[i]) / size : 0;
      arrow[4 * i] = factor * x;
      arrow[4 * i + 1] = factor * y;
      arrow[4 * i + 2] = factor * z;
    }
    this.count = count;
  }
}
