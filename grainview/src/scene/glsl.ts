// Functions of all shaders: rays through a pixel, lighting, depth; in camera coordinates.

export const COMMON = /* glsl */ `
precision highp float;
precision highp int;

uniform mat4 projectionMatrix;
uniform vec3 uBackground;
uniform vec2 uDepth;    // distances at which the haze begins and is strongest
uniform float uHaze;    // its strength, 0 to 1
uniform float uAmbient; // ambient light; weaker in the dark theme

bool isOrtho() { return projectionMatrix[3][3] == 1.0; }

vec3 rayOrigin(vec3 onQuad) { return isOrtho() ? vec3(onQuad.xy, 0.0) : vec3(0.0); }

vec3 rayDirection(vec3 onQuad) { return isOrtho() ? vec3(0.0, 0.0, -1.0) : normalize(onQuad); }

float depthOf(vec3 p) {
  vec4 clip = projectionMatrix * vec4(p, 1.0);
  return 0.5 * clip.z / clip.w + 0.5;
}

// simplified lighting for objects a few pixels wide: key light and sky
vec3 simplyLit(vec3 colour, vec3 normal, float openness, float distance) {
  float key = max(dot(normal, vec3(-0.41, 0.6, 0.69)), 0.0);
  float light = (uAmbient * (0.78 + 0.22 * normal.y) + 0.66 * key) * openness;
  return mix(colour * light, uBackground, uHaze * smoothstep(uDepth.x, uDepth.y, distance));
}

// key light from the upper left, fill light from the right, sky, highlight and rim
vec3 lit(vec3 colour, vec3 normal, vec3 toEye, float openness, float distance) {
  vec3 key = normalize(vec3(-0.45, 0.65, 0.75));
  vec3 fill = normalize(vec3(0.8, -0.1, 0.35));
  float sky = 0.5 + 0.5 * normal.y;
  float light = uAmbient * (0.55 + 0.45 * sky) * openness
    + 0.62 * max(dot(normal, key), 0.0) * (0.45 + 0.55 * openness) + 0.14 * max(dot(normal, fill), 0.0) * openness;
  float shine = 0.16 * pow(max(dot(normal, normalize(key + toEye)), 0.0), 40.0) * openness;
  float rim = 0.78 + 0.22 * smoothstep(0.0, 0.45, dot(normal, toEye));
  vec3 shaded = colour * light * rim + shine;
  float haze = uHaze * smoothstep(uDepth.x, uDepth.y, distance);
  return mix(shaded, uBackground, haze);
}
`;
