// The measured surface: one colour a face from a texture, and rings drawn by the pixel.
// Every face owns the last of its three vertices, whose number says which face it is: a
// million faces are drawn with a million vertices.

import * as THREE from "three";

import { LENS } from "./lens.js";

const WIDTH = 4096;

const VERTEX = `
${LENS.words}
out vec3 vWorld;
out vec3 vView;
flat out int vFace;
void main() {
  vFace = gl_VertexID;
  vec4 world = modelMatrix * vec4(position, 1.0);
  vec4 view = viewMatrix * world;
  vWorld = world.xyz;
  vView = view.xyz;
  gl_Position = projectionMatrix * bent(view);
}`;

// A ring is where c, rho / z or rho in the ring frame, is one of the radii.
const FRAGMENT = `
in vec3 vWorld;
in vec3 vView;
flat in int vFace;
out vec4 colour;
uniform sampler2D faces;
uniform highp usampler2D lit;
uniform sampler2D radii;
uniform mat4 ringFromWorld[COUNT];
uniform int nRadii[COUNT];
uniform bool parallel[COUNT];
uniform vec3 ringColour[COUNT];
uniform int ringsOn;
uniform int chosen;

float nearest(int p, float c) {
  int low = 0, high = nRadii[p] - 1;
  for (int k = 0; k < 12; k++) {
    int middle = (low + high) / 2;
    if (texelFetch(radii, ivec2(middle, p), 0).r < c) low = middle; else high = middle;
  }
  float below = abs(c - texelFetch(radii, ivec2(low, p), 0).r);
  return min(below, abs(c - texelFetch(radii, ivec2(high, p), 0).r));
}

void main() {
  ivec2 at = ivec2(vFace % ${WIDTH}, vFace / ${WIDTH});
  vec3 base = texelFetch(faces, at, 0).rgb;
  uint mask = texelFetch(lit, at, 0).r;
  vec3 normal = normalize(cross(dFdx(vView), dFdy(vView)));
  float shade = 0.42 + 0.58 * max(dot(normal, normalize(vec3(0.25, 0.35, 0.9))), 0.0);
  if (!gl_FrontFacing) base = mix(base, vec3(0.3), 0.65);
  for (int p = 0; p < COUNT; p++) {
    vec3 y = (ringFromWorld[p] * vec4(vWorld, 1.0)).xyz;
    float c = length(y.xy) / (parallel[p] ? 1.0 : y.z);
    float wide = max(fwidth(c), 1e-9);
    bool on = ((ringsOn >> p) & 1) == 1 && ((mask >> uint(p)) & 1u) == 1u;
    if (on) base = mix(ringColour[p], base, smoothstep(0.5, 1.4, nearest(p, c) / wide));
  }
  if (vFace == chosen) base = vec3(1.0, 0.1, 0.9);
  colour = vec4(base * shade, 1.0);
}`;

const NUMBERS = `
flat in int vFace;
in vec3 vWorld;
in vec3 vView;
out vec4 colour;
void main() {
  int n = vFace + 1;
  colour = vec4(n & 255, (n >> 8) & 255, (n >> 16) & 255, (n >> 24) & 255) / 255.0;
}`;

function texture(array, format, type, internal) {
  const height = Math.ceil(array.length / (format === THREE.RGBAFormat ? 4 : 1) / WIDTH);
  const made = new THREE.DataTexture(array, WIDTH, height, format, type);
  if (internal) made.internalFormat = internal;
  made.needsUpdate = true;
  return made;
}

function owned({ places, faces }) {
  const [x, y, z] = places;
  const count = faces[0].length;
  const owner = new Int32Array(x.length).fill(-1);
  const turn = new Uint8Array(count);
  const last = new Uint32Array(count + x.length);
  let used = count;
  for (let f = 0; f < count; f++) {
    let k = 0;
    while (k < 2 && owner[faces[k][f]] >= 0) k++;
    turn[f] = k;
    last[f] = faces[k][f];
    owner[last[f]] = f;
  }
  const index = new Uint32Array(3 * count);
  const copy = (v) => {
    if (owner[v] < 0) {
      last[used] = v;
      owner[v] = used++;
    }
    return owner[v];
  };
  for (let f = 0; f < count; f++) {
    index[3 * f] = copy(faces[(turn[f] + 1) % 3][f]);
    index[3 * f + 1] = copy(faces[(turn[f] + 2) % 3][f]);
    index[3 * f + 2] = f;
  }
  // Four numbers a vertex: three would have to be spread for the graphics card.
  const corners = new Uint16Array(4 * used);
  for (let k = 0; k < used; k++) {
    corners[4 * k] = x[last[k]];
    corners[4 * k + 1] = y[last[k]];
    corners[4 * k + 2] = z[last[k]];
  }
  return { index, corners };
}

export class Surface {
  constructor(mesh, box, projectors, light) {
    this.count = mesh.faces[0].length;
    Object.assign(this, owned(mesh), { box });
    const size = WIDTH * Math.ceil(this.count / WIDTH);
    this.colours = new Uint8Array(4 * size).fill(255);
    const mask = new Uint32Array(size);
    light.forEach((steps, p) => {
      const most = this.constructor.LIT;
      for (let f = 0; f < this.count; f++) if (steps[f] === most) mask[f] |= 1 << p;
    });
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(this.corners, 4, true));
    geometry.setIndex(new THREE.BufferAttribute(this.index, 1));
    geometry.boundingSphere = new THREE.Sphere(new THREE.Vector3(0.5, 0.5, 0.5), 1);
    const defines = { COUNT: Math.max(projectors.length, 1) };
    this.texture = texture(this.colours, THREE.RGBAFormat, THREE.UnsignedByteType);
    this.uniforms = {
      faces: { value: this.texture },
      lit: {
        value: texture(mask, THREE.RedIntegerFormat, THREE.UnsignedIntType, "R32UI"),
      },
      chosen: { value: -1 },
      ringsOn: { value: 0 },
      ...LENS.uniforms,
      ...ringUniforms(projectors),
    };
    const common = { vertexShader: VERTEX, glslVersion: THREE.GLSL3, side: THREE.DoubleSide };
    this.material = new THREE.ShaderMaterial({
      ...common, defines, uniforms: this.uniforms, fragmentShader: FRAGMENT,
    });
    this.numbers = new THREE.ShaderMaterial({ ...common, uniforms: LENS.uniforms, fragmentShader: NUMBERS });
    this.mesh = new THREE.Mesh(geometry, this.material);
    this.mesh.matrixAutoUpdate = false;
    this.mesh.matrix.makeScale(...box.side).setPosition(...box.low);
    this.mesh.frustumCulled = false;
  }

  // Gives every face the colour of its code, as [red, green, blue]; others are blank.
  paint(codes, colours, blank) {
    const table = new Map(Object.entries(colours).map(([code, rgb]) => [Number(code), rgb]));
    const shades = new Uint8Array(3 * 65536);
    for (let code = 0; code < 65536; code++) shades.set(table.get(code) ?? blank, 3 * code);
    for (let f = 0; f < this.count; f++) {
      const from = 3 * codes[f];
      this.colours[4 * f] = shades[from];
      this.colours[4 * f + 1] = shades[from + 1];
      this.colours[4 * f + 2] = shades[from + 2];
    }
    this.texture.needsUpdate = true;
  }

  // Corners of a face in the world.
  triangle(face) {
    const { corners, box } = this;
    return [0, 1, 2].map((k) => {
      const at = 4 * this.index[3 * face + k];
      return new THREE.Vector3(...[0, 1, 2].map((i) => box.low[i] + (box.side[i] * corners[at + i]) / 65535));
    });
  }

  centroid(face) {
    const [a, b, c] = this.triangle(face);
    return a.add(b).add(c).divideScalar(3);
  }

  normal(face) {
    const [a, b, c] = this.triangle(face);
    return b.sub(a).cross(c.sub(a)).normalize();
  }

  // Of every face [m²], in a loop without objects: there may be a million.
  get areas() {
    if (this.known) return this.known;
    const [sx, sy, sz] = this.box.side.map((side) => side / 65535);
    const { index, corners: p } = this;
    this.known = new Float32Array(this.count);
    for (let f = 0; f < this.count; f++) {
      const [i, j, k] = [4 * index[3 * f], 4 * index[3 * f + 1], 4 * index[3 * f + 2]];
      const [ax, ay, az] = [sx * (p[j] - p[i]), sy * (p[j + 1] - p[i + 1]), sz * (p[j + 2] - p[i + 2])];
      const [bx, by, bz] = [sx * (p[k] - p[i]), sy * (p[k + 1] - p[i + 1]), sz * (p[k + 2] - p[i + 2])];
      this.known[f] = 0.5 * Math.hypot(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx);
    }
    return this.known;
  }
}

function ringUniforms(projectors) {
  const count = Math.max(projectors.length, 1);
  // What is coded by pixels has no ring: none is ever near.
  const drawn = (p) => (p.radii.length ? p.radii : [1e30, 2e30]);
  const most = Math.max(2, ...projectors.map((p) => p.radii.length));
  const radii = new Float32Array(most * count);
  projectors.forEach((p, row) => radii.set(drawn(p), row * most));
  const lines = new THREE.DataTexture(radii, most, count, THREE.RedFormat, THREE.FloatType);
  lines.needsUpdate = true;
  const filled = projectors.length ? projectors : [{ ring: null, radii: [1, 2] }];
  const ringOf = (p) => (p.ring ? new THREE.Matrix4().set(...p.ring.flat()) : new THREE.Matrix4());
  const shades = [0x8c2d04, 0x08306b, 0x00441b, 0x4a1486, 0x67000d, 0x252525];
  return {
    radii: { value: lines },
    nRadii: { value: filled.map((p) => drawn(p).length) },
    parallel: { value: filled.map((p) => p.pitch !== undefined) },
    ringFromWorld: { value: filled.map((p) => ringOf(p).invert()) },
    ringColour: { value: filled.map((_, k) => new THREE.Color(shades[k % 6])) },
  };
}
