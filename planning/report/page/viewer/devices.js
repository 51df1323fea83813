// Devices as bodies with frusta, beams and names; zones and obstacles about them.

import * as THREE from "three";

import { lensOf, straight } from "./lens.js";

const COLOURS = { projector: 0xd95f02, camera: 0x1f78c8 };
const ZONES = { room: 0x80808c, "mounting plane": 0x2e844a, "keep out": 0xb22234 };
const ROUND = 64;

export const matrix = (rows) => new THREE.Matrix4().set(...rows.flat());

// Where the image's corners look: at depth 1 (diverging), or places on the panel.
function imageCorners(device) {
  const lens = lensOf(device);
  if (!lens) return panelCorners(device);
  return panelCorners(device).map(({ x, y }) => new THREE.Vector3(...straight(lens, [x, y]), 1));
}

// Corners of the panel at depth 1 (diverging), or as they are (parallel).
export function panelCorners(device) {
  const [wide, high] = device.resolution;
  const pixels = [[-0.5, -0.5], [wide - 0.5, -0.5], [wide - 0.5, high - 0.5], [-0.5, high - 0.5]];
  if (device.K) {
    const [[fx, , cx], [, fy, cy]] = device.K;
    return pixels.map(([u, v]) => new THREE.Vector3((u - cx) / fx, (v - cy) / fy, 1));
  }
  const middle = [0.5 * (wide - 1), 0.5 * (high - 1)];
  return pixels.map(
    ([u, v]) => new THREE.Vector3((u - middle[0]) * device.pitch, (v - middle[1]) * device.pitch, 0),
  );
}

// A corner of the image carried along the light to a depth.
function atDepth(device, corner, depth) {
  if (device.K) return corner.clone().multiplyScalar(depth);
  return new THREE.Vector3(corner.x, corner.y, depth);
}

function lines(points, colour, opacity = 1) {
  const geometry = new THREE.BufferGeometry().setFromPoints(points);
  const material = new THREE.LineBasicMaterial({ color: colour, transparent: opacity < 1, opacity });
  return new THREE.LineSegments(geometry, material);
}

const loop = (points) => points.flatMap((p, k) => [p, points[(k + 1) % points.length]]);

function box(half, middle, colour) {
  const shape = new THREE.BoxGeometry(...half.map((h) => 2 * h));
  const solid = new THREE.Group();
  const fill = new THREE.MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.45, depthWrite: false });
  solid.add(new THREE.Mesh(shape, fill));
  solid.add(new THREE.LineSegments(new THREE.EdgesGeometry(shape), new THREE.LineBasicMaterial({ color: colour })));
  solid.position.set(...middle);
  return solid;
}

function body(device, size, colour) {
  const group = new THREE.Group();
  if (device.body) group.add(box(device.body.half_m, device.body.centre_m, colour));
  // A small frustum shows which way it looks, a tick which side of the image is up.
  const near = imageCorners(device).map((c) => (device.K ? atDepth(device, c, size) : c));
  const rise = near[0].clone().sub(near[3]).multiplyScalar(0.3);
  const top = near[0].clone().add(near[1]).multiplyScalar(0.5).add(rise);
  const apex = new THREE.Vector3();
  const edges = device.K ? near.flatMap((c) => [apex, c]) : [];
  group.add(lines([...loop(near), ...edges, near[0], top, top, near[1]], colour));
  return group;
}

function frustum(device, colour) {
  const [low, high] = device.range;
  const ends = [low, high].map((depth) => imageCorners(device).map((c) => atDepth(device, c, depth)));
  const rays = ends[0].flatMap((c, k) => [c, ends[1][k]]);
  return lines([...ends.flatMap(loop), ...rays], colour, 0.7);
}

// The light as far as the object: edges of the image, and the outermost ring as a sheet.
function beam(device, depth, colour) {
  const group = new THREE.Group();
  const near = imageCorners(device).map((c) => atDepth(device, c, 0));
  const far = imageCorners(device).map((c) => atDepth(device, c, depth));
  group.add(lines([...loop(far), ...near.flatMap((c, k) => [c, far[k]])], colour, 0.5));
  if (!device.radii.length) return group;
  const fromRing = matrix(device.pose).invert().multiply(matrix(device.ring));
  const last = device.radii.at(-1);
  const circle = Array.from({ length: ROUND }, (_, k) => {
    const turn = (2 * Math.PI * k) / ROUND;
    const [x, y] = [last * Math.cos(turn), last * Math.sin(turn)];
    const ends = device.K ? [[0, 0, 0], [x * depth, y * depth, depth]] : [[x, y, 0], [x, y, depth]];
    return ends.map((end) => new THREE.Vector3(...end).applyMatrix4(fromRing));
  });
  const rims = [0, 1].map((end) => loop(circle.map((ray) => ray[end])));
  group.add(lines([...(device.K ? [] : rims[0]), ...rims[1]], colour, 0.8));
  const sheet = circle.flatMap(([a, b], k) => {
    const [c, d] = circle[(k + 1) % ROUND];
    return [a, b, d, a, d, c];
  });
  const fill = new THREE.MeshBasicMaterial({
    color: colour, transparent: true, opacity: 0.1, depthWrite: false, side: THREE.DoubleSide,
  });
  group.add(new THREE.Mesh(new THREE.BufferGeometry().setFromPoints(sheet), fill));
  return group;
}

export class Devices {
  constructor(stage, facts, layer) {
    this.stage = stage;
    this.items = facts.devices.map((device) => {
      const colour = COLOURS[device.kind];
      const pose = matrix(device.pose);
      const origin = new THREE.Vector3().setFromMatrixPosition(pose);
      const axis = new THREE.Vector3().setFromMatrixColumn(pose, 2);
      const depth = Math.max(stage.centre.clone().sub(origin).dot(axis), 0.1 * stage.reach);
      const parts = { bodies: body(device, 0.1 * depth, colour) };
      if (device.kind === "camera") parts.frusta = frustum(device, colour);
      else parts.beams = beam(device, depth, colour);
      for (const part of Object.values(parts)) {
        part.matrixAutoUpdate = false;
        part.matrix.copy(pose);
        stage.scene.add(part);
      }
      const label = document.createElement("span");
      label.textContent = device.existing ? `${device.id} (${device.existing})` : device.id;
      label.className = device.kind;
      layer.append(label);
      return { device, parts, origin, label };
    });
    stage.onDraw.push(() => this.placeLabels());
  }

  // Shows what is switched on; in a device's own view it is left out itself.
  show(on, projectorsOn) {
    for (const { device, parts } of this.items) {
      const own = this.stage.eye?.device === device;
      parts.bodies.visible = on.bodies && !own;
      if (parts.frusta) parts.frusta.visible = on.frusta && !own;
      if (parts.beams) {
        const shines = projectorsOn === null || projectorsOn.includes(device.id);
        parts.beams.visible = on.beams && shines && !own;
      }
    }
    this.labelled = on.labels;
  }

  placeLabels() {
    for (const { device, origin, label } of this.items) {
      const hidden = !this.labelled || this.stage.eye?.device === device;
      const at = hidden ? null : this.stage.spot(origin);
      label.hidden = !at;
      if (at) label.style.transform = `translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px)`;
    }
  }
}

export function zonesAndObstacles(facts, meshOf) {
  const [zones, obstacles] = [new THREE.Group(), new THREE.Group()];
  for (const { kind, middle, axes, half } of facts.zones) {
    const shape = new THREE.EdgesGeometry(new THREE.BoxGeometry(...half.map((h) => 2 * h)));
    const edges = new THREE.LineSegments(shape, new THREE.LineBasicMaterial({ color: ZONES[kind] }));
    const turn = new THREE.Matrix4().makeBasis(...axes.map((a) => new THREE.Vector3(...a)));
    edges.matrixAutoUpdate = false;
    edges.matrix.copy(turn.setPosition(...middle));
    zones.add(edges);
  }
  for (const { array, low, side } of facts.obstacles) {
    const geometry = new THREE.BufferGeometry();
    const { places, faces } = meshOf(array);
    const along = (columns, kind) => kind.from({ length: 3 * columns[0].length }, (_, k) => columns[k % 3][Math.floor(k / 3)]);
    geometry.setAttribute("position", new THREE.BufferAttribute(along(places, Uint16Array), 3, true));
    geometry.setIndex(new THREE.BufferAttribute(along(faces, Uint32Array), 1));
    const fill = new THREE.MeshBasicMaterial({ color: 0x8a7a68, transparent: true, opacity: 0.35, side: THREE.DoubleSide });
    const solid = new THREE.Mesh(geometry, fill);
    solid.add(new THREE.LineSegments(new THREE.EdgesGeometry(geometry, 30), new THREE.LineBasicMaterial({ color: 0x605040 })));
    solid.scale.set(...side);
    solid.position.set(...low);
    obstacles.add(solid);
  }
  return { zones, obstacles };
}
