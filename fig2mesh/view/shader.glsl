// Sphere tracing of part fields (paper §4.5, appendix B). An effect that is off is not in the program: the page writes
// one #define for each effect that is on, and the numbers of grids and slots, above this line.
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler3D;

// Six vectors a grid: box low, spacing | box high, 1 / slope | first node | texel of it, slot | last node's index |
// grids of the two parts that a fillet joins, or twice the grid itself.
layout(std140) uniform Grids { vec4 grid[GRIDS * 6]; };
// Two vectors a slot: place (ax, bx, ay, by) | window (x0, y0, x1, y1), texels.
layout(std140) uniform Slots { vec4 slots[SLOTS * 2]; };
uniform sampler3D field;
uniform int order[GRIDS];  // grids, nearest first
uniform mat3 camera;       // columns: right, up, back
uniform vec3 centre;       // FIGURE, in the middle of the picture
uniform vec2 size;         // of the picture, pixels
uniform float pixel;       // FIGURE units
uniform float far;         // from centre to the eye, or to the plane where rays start
out vec4 result;

const float NEVER = 1e9;
const int STEPS = 160;
const float LEAST = 0.2;   // nodes: a step is at least so long; what is thinner may be missed

float value(int g, vec3 at) {
  vec3 texel = grid[g * 6 + 3].xyz + clamp(at, vec3(0), grid[g * 6 + 4].xyz) + 0.5;
  return texture(field, texel / vec3(textureSize(field, 0))).r;
}

vec3 nodes(int g, vec3 p) { return (p - grid[g * 6 + 2].xyz) / grid[g * 6].w; }

vec3 gradient(int g, vec3 p, float reach) {
  vec3 at = nodes(g, p), e = vec3(reach, 0, 0);
  return vec3(
    value(g, at + e.xyy) - value(g, at - e.xyy),
    value(g, at + e.yxy) - value(g, at - e.yxy),
    value(g, at + e.yyx) - value(g, at - e.yyx)) / (2.0 * reach * grid[g * 6].w);
}

// From where to where a ray is in a grid's box, widened by `room`; backwards where it misses.
vec2 box(int g, vec3 o, vec3 inverse, float room) {
  vec3 a = (grid[g * 6].xyz - room - o) * inverse, b = (grid[g * 6 + 1].xyz + room - o) * inverse;
  vec3 low = min(a, b), high = max(a, b);
  return vec2(max(max(low.x, low.y), max(low.z, 0.0)), min(high.x, min(high.y, high.z)));
}

// First t in [t, end] where grid g is not positive; the bracket is halved until it is a thousandth of a node.
// solid: where the ray is in the box that holds the solid, beyond which the values of a part that is cut off go on.
// near: least value on the way, where, and of which grid.
float march(int g, vec3 o, vec3 d, float t, float end, vec2 solid, inout vec3 near) {
  vec3 at = nodes(g, o), w = d / grid[g * 6].w;
  float rate = grid[g * 6 + 1].w, least = LEAST * grid[g * 6].w, before = t;
  for (int i = 0; i < STEPS; i++) {
    float v = value(g, at + w * t);
    if (v <= 0.0 && t >= solid.x && before <= solid.y) {
      for (int k = 0; k < 8; k++) {
        float middle = 0.5 * (before + t);
        if (value(g, at + w * middle) > 0.0) before = middle; else t = middle;
      }
      return max(before, solid.x);
    }
#ifdef OUTLINE
    if (v > 0.0 && v < near.x) near = vec3(v, t, float(g));
#endif
    before = t;
    if (t >= end) break;
    t = min(t + max(v * rate, least), end);
  }
  return NEVER;
}

// Distance to the union, as far as `most`.
float distance_to(vec3 p, float most) {
  for (int g = 0; g < TRACED; g++) {
    vec3 away = max(max(grid[g * 6].xyz - p, p - grid[g * 6 + 1].xyz), vec3(0));
    float squared = dot(away, away);
    if (squared >= most * most || most <= 0.0) continue;
    // inside of the brick the value itself; beyond its margin as outside of a part's cube
    vec3 at = nodes(g, p), past = at - clamp(at, vec3(0), grid[g * 6 + 4].xyz);
    float v = value(g, at), rest = length(past) * grid[g * 6].w;
    most = min(most, rest > 0.0 ? sqrt(rest * rest + max(v, 0.0) * max(v, 0.0)) : v);
  }
  return most;
}

#ifdef TEXTURE
uniform sampler2D paint;
uniform sampler2D depth;
uniform vec4 depth_place;
uniform float grazing;
uniform vec4 pen;          // colour, width in FIGURE units (0: the drawing has no contours)
const float CLEARANCE = 3e-3;
const float BORDER = 0.15; // of the normal's z, over which the drawing fades into the plain picture

vec3 colour_of(int slot, vec2 p) {
  vec4 place = slots[slot * 2], window = slots[slot * 2 + 1];
  float lod = max(log2(pixel * place.x), 0.0), half_texel = 0.5 * exp2(ceil(lod));
  vec2 texel = clamp(p * place.xz + place.yw, window.xy + half_texel, window.zw - half_texel);
  return textureLod(paint, texel / vec2(textureSize(paint, 0)), lod).rgb;
}

// How far behind the surface that the drawing's viewer sees; next to a rim the farther side counts.
float hidden_by(vec3 p) {
  ivec2 last = textureSize(depth, 0) - 1;
  ivec2 at = ivec2(floor(p.xy * depth_place.xz + depth_place.yw - 0.5));
  float z = NEVER;
  for (int k = 0; k < 4; k++) z = min(z, texelFetch(depth, clamp(at + ivec2(k & 1, k >> 1), ivec2(0), last), 0).r);
  return z - p.z;
}

int slot_at(int g, vec3 p) {
#ifdef SMOOTH_UNION
  int a = int(grid[g * 6 + 5].x), b = int(grid[g * 6 + 5].y);
  if (a != b) g = value(a, nodes(a, p)) <= value(b, nodes(b, p)) ? a : b;
#endif
  return int(grid[g * 6 + 3].w);
}

vec3 colour_at(int g, vec3 p, vec3 n) {
#ifdef BLEND
  float shown = smoothstep(grazing - BORDER, grazing + BORDER, n.z)
    * (1.0 - smoothstep(CLEARANCE, 6.0 * CLEARANCE, hidden_by(p)));
#else
  float shown = n.z > grazing && hidden_by(p) < CLEARANCE ? 1.0 : 0.0;
#endif
  vec3 colour = colour_of(0, p.xy);
  if (shown < 1.0) {
    vec3 plain = colour_of(slot_at(g, p), p.xy);
#ifdef CREASES
    // Off a flat or round surface the distance grows as fast as one goes; in a corner other surfaces are nearer.
    if (pen.w > 0.0) {
      float reach = 0.8 * pen.w, away = distance_to(p + reach * n, 2.0 * reach);
      plain = mix(plain, pen.rgb, clamp((0.6 - away / reach) / 0.2 + 0.5, 0.0, 1.0));
    }
#endif
    colour = mix(plain, colour, shown);
  }
  return colour;
}
#endif

#ifdef OUTLINE
uniform vec4 line;         // colour, width in FIGURE units

// How much of the line there is where a ray passed by a surface: silhouettes, and limbs before what is far behind.
float outline(vec3 o, vec3 d, vec3 near, float t) {
  if (near.z < 0.0 || t - near.y < 2.5 * line.w) return 0.0;
  int g = int(near.z);
  float slope = length(gradient(g, o + near.y * d, 1.0));
  float soft = 0.5 * pixel;
  return 1.0 - smoothstep(line.w - soft, line.w + soft, near.x / max(slope, 1.0));
}
#endif

vec4 shade(vec3 o, vec3 d) {
  vec3 inverse = 1.0 / mix(d, vec3(1e-9), lessThan(abs(d), vec3(1e-9)));
  float best = NEVER;
  int hit = -1;
  vec3 near = vec3(NEVER, 0.0, -1.0);
  for (int i = 0; i < TRACED; i++) {
    int g = order[i];
    vec2 solid = box(g, o, inverse, 0.0), reach = solid;
#ifdef OUTLINE
    reach = box(g, o, inverse, line.w);
    if (solid.x > solid.y) solid = vec2(NEVER);
#endif
    reach.y = min(reach.y, best);
    if (reach.x > reach.y) continue;
    float t = march(g, o, d, reach.x, reach.y, solid, near);
    if (t < best) { best = t; hit = g; }
  }
  vec4 colour = vec4(0);
  if (hit >= 0) {
    vec3 p = o + best * d, n = gradient(hit, p, 1.0);
    // Where differences cancel, as in a limb thinner than a node, those of a quarter node do not.
    if (dot(n, d) >= 0.0) n = gradient(hit, p, 0.25);
    n = dot(n, n) > 0.0 ? normalize(n) : -d;
#ifdef TEXTURE
    colour = vec4(colour_at(hit, p, n), 1);
#else
    colour = vec4(CLAY, 1);
#endif
#ifdef LIGHT
    // Half-Lambert of a lamp at the viewer's upper left: no side falls into black.
    float light = 0.5 + 0.5 * dot(n, camera * normalize(vec3(-0.30, 0.45, 0.84)));
    colour.rgb *= AMBIENT + DIFFUSE * pow(light, 1.5);
#endif
#ifdef AO
    float closed = 0.0, weight = 0.5;
    for (int k = 0; k < 4; k++) {
      float reach = 0.015 * exp2(float(k));
      closed += weight * (1.0 - max(distance_to(p + reach * n, reach), 0.0) / reach);
      weight *= 0.6;
    }
    colour.rgb *= 1.0 - 0.55 * min(closed, 1.0);
#endif
  }
#ifdef OUTLINE
  float drawn = outline(o, d, near, best);
  colour = mix(colour, vec4(line.rgb, 1), drawn);
#endif
  return vec4(min(colour.rgb, 1.0), colour.a);
}

void main() {
  vec4 total = vec4(0);
#ifdef ANTIALIAS
  const int SIDE = 2;
#else
  const int SIDE = 1;
#endif
  for (int k = 0; k < SIDE * SIDE; k++) {
    vec2 inner = (vec2(k % SIDE, k / SIDE) + 0.5) / float(SIDE) - 0.5;
    vec2 at = (gl_FragCoord.xy + inner - 0.5 * size) * pixel;
    vec3 picture = camera * vec3(at, 0);
#ifdef PERSPECTIVE
    vec3 eye = far * camera[2];
    vec4 one = shade(centre + eye, normalize(picture - eye));
#else
    vec4 one = shade(centre + picture + far * camera[2], -camera[2]);
#endif
    total += vec4(one.rgb * one.a, one.a);
  }
  result = total / float(SIDE * SIDE);
}
