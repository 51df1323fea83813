// What a limit says of a triangle: the value there, the limit, and what would relax it.
// Which limit is violated first is the audit's word; only its figures are worked out here.

import * as THREE from "three";

import { matrix } from "./devices.js";
import { degrees, mm } from "./dom.js";

const CASTS = {
  occlusion: "the surface itself stands between; only another place helps",
  body: "the body of another device stands between; move one of them, or make it smaller",
  blocked: "an obstacle stands between; move it or the device",
};
const whole = (value) => Math.ceil(value - 1e-9);
const rounding = (value, limit, over) => (over ? value > limit : value < limit);

// "67.1° (at most 60.0°)": never a value that contradicts the audit by rounding.
function against(value, limit, say, over) {
  const told = rounding(value, limit, over) ? say(value) : `just ${over ? "over" : "under"} ${say(limit)}`;
  return `${told} (at ${over ? "most" : "least"} ${say(limit)})`;
}

export function geometryOf(device, point, normal) {
  const pose = matrix(device.pose);
  const local = point.clone().applyMatrix4(pose.clone().invert());
  const origin = new THREE.Vector3().setFromMatrixPosition(pose);
  const parallel = !device.K;
  const along = parallel ? new THREE.Vector3().setFromMatrixColumn(pose, 2) : point.clone().sub(origin).normalize();
  const distance = parallel ? local.z : point.distanceTo(origin);
  const incidence = Math.acos(Math.min(1, Math.max(-1, -normal.dot(along))));
  return { local, along, distance, incidence, parallel };
}

export function pixel(device, { x, y, z }) {
  const [k1, k2, p1, p2, k3] = device.distortion;
  const [a, b] = [x / z, y / z];
  const s = a * a + b * b;
  const radial = 1 + s * (k1 + s * (k2 + s * k3));
  const [[fx, , cx], [, fy, cy]] = device.K;
  return [
    fx * (a * radial + 2 * p1 * a * b + p2 * (s + 2 * a * a)) + cx,
    fy * (b * radial + p1 * (s + 2 * b * b) + 2 * p2 * a * b) + cy,
  ];
}

// Outside the image: on which sides, by how much, and how wide it would have to be.
function outside(device, at) {
  const [wide, high] = device.resolution;
  if (!at.parallel && at.local.z <= 0) return "lies behind it; turn it, or place it elsewhere";
  if (at.parallel) {
    const half = [wide, high].map((n) => 0.5 * n * device.pitch);
    const over = [Math.abs(at.local.x) - half[0], Math.abs(at.local.y) - half[1]].filter((d) => d > 0);
    if (over.length) return `outside the panel by ${over.map((d) => mm(d)).join(" and ")}; a panel wider by twice that, or moved, would do`;
    const radius = Math.hypot(at.local.x, at.local.y);
    if (device.beam && radius > device.beam) return `${mm(radius)} off the axis, the beam reaches ${mm(device.beam)}`;
    return null;
  }
  const [u, v] = pixel(device, at.local);
  const sides = [
    [-0.5 - u, "left of"], [u - wide + 0.5, "right of"], [-0.5 - v, "above"], [v - high + 0.5, "below"],
  ].filter(([by]) => by > 0);
  if (!sides.length) return null;
  const off = Math.atan2(Math.hypot(at.local.x, at.local.y), at.local.z);
  const told = sides.map(([by, side]) => `${Math.ceil(by)} px ${side}`).join(" and ");
  return `${told} its image; one that reaches ${degrees(off)} off its axis there, or turning it, would do`;
}

function beyondRings(device, point) {
  if (!device.radii.length) return "at the very edge of its image";
  const ring = point.clone().applyMatrix4(matrix(device.ring).invert());
  const radius = Math.hypot(ring.x, ring.y);
  const last = device.radii.at(-1);
  if (!device.K) return `${mm(radius)} off the ring axis, the outermost ring is at ${mm(last)}; a ring there would do`;
  const off = Math.atan2(radius, ring.z);
  return `${degrees(off)} off the ring axis, the outermost ring is at ${degrees(Math.atan(last))}; a ring there would do`;
}

function range(device, at, kind) {
  const [low, high] = device.range;
  const far = at.distance > high;
  const say = far ? `to ${whole(1e3 * at.distance)} mm (now ${mm(high, 0)})` : `from ${Math.floor(1e3 * at.distance)} mm (now ${mm(low, 0)})`;
  return `${mm(at.distance)} away, sharp from ${mm(low, 0)} to ${mm(high, 0)}; a ${kind} sharp ${say} would do`;
}

const steeper = (angle) => Math.min(whole((180 / Math.PI) * angle), 90);

// Why a device doesn't light or see a face, in words with figures.
export function whyNot(device, cause, at, { point, normal, steep, limits }) {
  const kind = device.kind;
  for (const [name, words] of Object.entries(CASTS)) if (cause.includes(name)) return words;
  if (cause === "projector_beam") return outside(device, at) ?? beyondRings(device, point);
  if (cause === "camera_field") return outside(device, at) ?? "at the very edge of its image";
  if (cause.endsWith("_range")) return range(device, at, kind);
  if (cause.endsWith("_incidence")) {
    const limit = limits[`${kind}_max_incidence`];
    const asks = Math.max(steeper(at.incidence), steeper(limit));
    const facing = at.incidence < Math.PI / 2;
    // A rig file's limit stays below 90 degrees.
    const help = asks < 90 ? `limits.${kind}_max_incidence_deg = ${asks} would do` : "as good as edge on; only another place helps";
    const helps = facing ? help : "it faces away; only another place helps";
    return `incidence ${against(at.incidence, limit, degrees, true)}; ${helps}`;
  }
  if (cause === "tangent_angle") {
    const angle = Math.acos(Math.min(1, Math.abs(steep.dot(at.along))));
    const asks = Math.floor((180 / Math.PI) * Math.min(angle, limits.min_tangent_angle));
    return `tangent angle ${against(angle, limits.min_tangent_angle, degrees, false)}; limits.min_tangent_angle_deg = ${asks} would do`;
  }
  if (cause === "pixel_distance") {
    const wide = device.K ? at.local.z / Math.sqrt(device.K[0][0] * device.K[1][1]) : device.pitch;
    const coarse = wide / -normal.dot(at.along);
    const asks = Math.max(coarse, limits.max_sample_distance_m);
    return `a pixel covers ${against(coarse, limits.max_sample_distance_m, (metres) => mm(metres, 3), true)}; limits.max_sample_distance_mm = ${(1e3 * asks).toPrecision(3)} would do`;
  }
  if (cause === "sample_distance") {
    const [[fx], [, fy]] = device.K;
    const coarse = at.local.z / (Math.sqrt(fx * fy) * -normal.dot(at.along));
    const say = (metres) => mm(metres, 3);
    const asks = Math.max(coarse, limits.max_sample_distance_m);
    return `a pixel covers ${against(coarse, limits.max_sample_distance_m, say, true)}; limits.max_sample_distance_mm = ${(1e3 * asks).toPrecision(3)} would do`;
  }
  return cause;
}

// Why a pair that lights and sees a face doesn't measure it; the value is the audit's.
export function whyNoPair(cause, value, limits) {
  const limit = limits[cause];
  const plain = (x) => x.toPrecision(3);
  switch (cause) {
    case "sigma":
    case "view_sigma":
      return `off by ${against(value, limit, (x) => mm(x, 3), true)}; --accuracy ${(1e3 * Math.max(value, limit) * 1.005).toPrecision(3)} would do`;
    case "conditioning":
      return `|r.m| ${against(value, limit, plain, false)}, on a blind curve; limits.min_conditioning = ${(Math.floor(100 * Math.min(value, limit)) / 100).toFixed(2)} would do`;
    case "angle":
    case "view_angle": {
      const [low, high] = limit;
      const small = value < low;
      const asks = (180 / Math.PI) * (small ? Math.min(value, low) : Math.max(value, high));
      const help = small ? `min_angle_deg = ${Math.floor(asks)}` : `max_angle_deg = ${Math.ceil(asks)}`;
      return `ray and light meet at ${against(value, small ? low : high, degrees, !small)}; limits.${help} would do`;
    }
    case "pitch":
      return `rings ${against(value, limit, (x) => `${plain(x)} px`, false)} apart in the image; rings ${plain(limit / value)} times as far apart would do`;
    case "too_dark":
      return `${against(value, limit, plain, false)} grey levels between lit and dark; ${plain(limit / Math.max(value, 1e-9))} times the light would do`;
    case "clipped":
      return `grey level ${against(value, limit, plain, true)}; light cut to ${plain(limit / value)} of it would do`;
    default:
      return cause;
  }
}
