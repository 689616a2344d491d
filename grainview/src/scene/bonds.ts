// Contacts as cylinders between the centres of two grains, as wide as the smaller one allows; at true grain size only a
// collar at the neck is visible.

import type { Bonds } from "../data/bonds";
import { COMMON } from "./glsl";
import { Column, SQUARE, Squares } from "./squares";
import type * as three from "three";

const VERTEX = /* glsl */ `
uniform mat4 modelViewMatrix;
uniform float uBar;
uniform highp sampler2D uFrom;
uniform highp sampler2D uTo;
uniform highp sampler2D uColour;
out vec3 vOnQuad;
out float vAcross;
flat out vec3 vFrom;
flat out vec3 vAxis;
flat out vec3 vColour;
flat out float vBar;

void main() {
  vec2 corner = cornerOf(gl_VertexID);
  vec4 from = fetched(uFrom, gl_VertexID);
  float bar = uBar * from.w;
  vBar = bar;
  vec3 a = (modelViewMatrix * vec4(from.xyz, 1.0)).xyz;
  vec3 b = (modelViewMatrix * vec4(fetched(uTo, gl_VertexID).xyz, 1.0)).xyz;
  vec4 colour = fetched(uColour, gl_VertexID);
  vFrom = a;
  vAcross = corner.y;
  vAxis = b - a;
  vColour = colour.rgb;
  vec3 middle = 0.5 * (a + b);
  vec3 toEye = isOrtho() ? vec3(0.0, 0.0, 1.0) : normalize(-middle);
  vec3 along = normalize(vAxis);
  vec3 side = cross(along, toEye);
  side = dot(side, side) < 1e-6 ? vec3(1.0, 0.0, 0.0) : normalize(side);
#ifdef SIMPLE
  // the square is on the side of the bar that faces the eye
  vec3 front = normalize(cross(side, along));
  vOnQuad = middle + front * bar + corner.x * 0.5 * vAxis + corner.y * side * bar;
#else
  // the square faces the eye and contains the outline of the bar, including its ends
  vec3 axial = cross(toEye, side);
  float halfLength = 0.5 * abs(dot(vAxis, axial)) + bar * (0.2 + abs(dot(along, toEye)));
  vOnQuad = middle + corner.x * halfLength * axial + corner.y * side * bar * 1.2;
#endif
  gl_Position = projectionMatrix * vec4(vOnQuad, 1.0);
  if (colour.a < 0.5 || (!isOrtho() && max(a.z, b.z) > 0.0)) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}
`;

const FRAGMENT = /* glsl */ `
flat in float vBar;
in vec3 vOnQuad;
in float vAcross;
flat in vec3 vFrom;
flat in vec3 vAxis;
flat in vec3 vColour;
out vec4 outColour;

#ifdef SIMPLE
void main() {
  outColour = vec4(simplyLit(vColour, vec3(0.0, 0.5 * vAcross, 0.8), 1.0, -vOnQuad.z), 1.0);
}
#else
void main() {
  vec3 origin = rayOrigin(vOnQuad);
  vec3 ray = rayDirection(vOnQuad);
  float size = length(vAxis);
  vec3 axis = vAxis / size;
  vec3 offset = origin - vFrom;
  vec3 rayAcross = ray - dot(ray, axis) * axis;
  vec3 offsetAcross = offset - dot(offset, axis) * axis;
  float a = dot(rayAcross, rayAcross);
  float b = dot(rayAcross, offsetAcross);
  float c = dot(offsetAcross, offsetAcross) - vBar * vBar;
  float discriminant = b * b - a * c;
  if (discriminant < 0.0) discard;
  float rayAlong = dot(ray, axis);
  float position = a < 1e-12 ? -1.0 : dot(offset, axis) + (-b - sqrt(discriminant)) / a * rayAlong;
  vec3 p, normal;
  if (position >= 0.0 && position <= size && a >= 1e-12) {
    p = origin + (-b - sqrt(discriminant)) / a * ray;
    normal = (p - vFrom - position * axis) / vBar;
  } else {
    // the flat end that faces the eye
    float end = rayAlong > 0.0 ? 0.0 : size;
    p = origin + (end - dot(offset, axis)) / rayAlong * ray;
    vec3 across = p - vFrom - end * axis;
    if (dot(across, across) > vBar * vBar) discard;
    normal = rayAlong > 0.0 ? -axis : axis;
  }
  outColour = vec4(lit(vColour, normal, -ray, 1.0, -p.z), 1.0);
  gl_FragDepth = depthOf(p);
}
#endif
`;

export class BondsMesh extends Squares {
  private readonly from = new Column(Float32Array);
  private readonly to = new Column(Float32Array);
  private readonly colour = new Column(Uint8Array);

  constructor(uniforms: Record<string, three.IUniform>, smooth: boolean) {
    const own: Record<string, three.IUniform> = { ...uniforms, uBar: { value: 1 } };
    super(COMMON + SQUARE + VERTEX, COMMON + FRAGMENT, own, smooth);
    own.uFrom = this.from.uniform;
    own.uTo = this.to.uniform;
    own.uColour = this.colour.uniform;
  }

  /** Draw the pieces with radii of `bar` times those of the smaller grains. */
  set(pieces: Bonds, bar: number): void {
    const count = pieces.contact.length;
    this.uniforms.uBar.value = bar;
    for (const [column, ends] of [[this.from, pieces.from], [this.to, pieces.to]] as const) {
      const values = column.write(count);
      for (let k = 0; k < count; k++) {
        for (let a = 0; a < 3; a++) values[4 * k + a] = ends[3 * k + a];
        values[4 * k + 3] = pieces.radius[k];
      }
    }
    this.colour.write(count).set(pieces.colour);
    this.count = count;
  }
}
