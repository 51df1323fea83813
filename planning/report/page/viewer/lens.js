// Lens distortion after Brown and Conrady, OpenCV's k1, k2, p1, p2, k3, of the device
// whose view is shown: by this script, and by every vertex shader.

import * as THREE from "three";

const NONE = { k: [0, 0, 0], p: [0, 0], most: 0 };

// Beyond `most`, r² of slopes a little outside the image, its factor stays what it is
// there: the polynomial turns back in the end, and would fold things into the picture.
const uniforms = {
  lensK: { value: new THREE.Vector3() },
  lensP: { value: new THREE.Vector2() },
  lensMost: { value: 0 },
};

const BENT = `
uniform vec3 lensK;
uniform vec2 lensP;
uniform float lensMost;
vec4 bent(vec4 view) {
  if (lensMost == 0.0 || view.z > -1e-6) return view;
  vec2 a = vec2(view.x, -view.y) / -view.z;
  vec2 b = a * sqrt(min(1.0, lensMost / max(dot(a, a), 1e-12)));
  float q = dot(b, b);
  vec2 aside = 2.0 * b.x * b.y * lensP + lensP.yx * (q + 2.0 * b * b);
  vec2 c = a * (1.0 + q * (lensK.x + q * (lensK.y + q * lensK.z))) + aside;
  return vec4(c.x * -view.z, c.y * view.z, view.zw);
}
`;

// As `bent` of the shader, of slopes x / z and y / z in OpenCV's axes.
export function bent({ k, p, most }, [x, y]) {
  const shrink = Math.sqrt(Math.min(1, most / Math.max(x * x + y * y, 1e-12)));
  const [bx, by] = [x * shrink, y * shrink];
  const q = bx * bx + by * by;
  const factor = 1 + q * (k[0] + q * (k[1] + q * k[2]));
  return [
    x * factor + 2 * p[0] * bx * by + p[1] * (q + 2 * bx * bx),
    y * factor + 2 * p[1] * bx * by + p[0] * (q + 2 * by * by),
  ];
}

// Slopes whose image lies at these.
export function straight(lens, [x, y]) {
  let at = [x, y];
  for (let k = 0; k < 60; k++) {
    const [u, v] = bent(lens, at);
    at = [at[0] + x - u, at[1] + y - v];
  }
  return at;
}

// The lens of a device; null where nothing distorts.
export function lensOf(device) {
  const [k1, k2, p1, p2, k3] = device.distortion ?? [];
  if (![k1, k2, p1, p2, k3].some(Boolean)) return null;
  const [[fx, , cx], [, fy, cy]] = device.K;
  const [wide, high] = device.resolution;
  const whole = { k: [k1, k2, k3], p: [p1, p2], most: Infinity };
  const corners = [[0, 0], [wide, 0], [0, high], [wide, high]].map(([u, v]) =>
    straight(whole, [(u - 0.5 - cx) / fx, (v - 0.5 - cy) / fy]),
  );
  return { ...whole, most: 1.2 * Math.max(...corners.map(([x, y]) => x * x + y * y)) };
}

// Draws everything through a lens from now on; null: without.
export function lookThrough(lens) {
  const { k, p, most } = lens ?? NONE;
  uniforms.lensK.value.set(...k);
  uniforms.lensP.value.set(...p);
  uniforms.lensMost.value = most;
}

// What a shader of our own needs: its words and its uniforms.
export const LENS = { uniforms, words: BENT };

// Has a material of the library draw through the lens; before its first picture.
export function bends(material) {
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, uniforms);
    const project = THREE.ShaderChunk.project_vertex.replace(
      "projectionMatrix * mvPosition", "projectionMatrix * bent(mvPosition)",
    );
    shader.vertexShader = BENT + shader.vertexShader.replace("#include <project_vertex>", project);
  };
}
