// Puts the viewer of report.html together from the data that the page carries.

import * as THREE from "three";

import { Devices, matrix, panelCorners, zonesAndObstacles } from "./devices.js";
import { byId, element, theme } from "./dom.js";
import { Eye } from "./eyes.js";
import { Layers } from "./layers.js";
import { bends, lookThrough } from "./lens.js";
import { dots, Measure } from "./measure.js";
import { Panel } from "./panel.js";
import { meshOf, unpack } from "./payload.js";
import { Picking } from "./picking.js";
import { Sequence } from "./sequence.js";
import { Stage } from "./stage.js";
import { Surface } from "./surface.js";

// Smooth edges cost a software renderer five times as long; finer meshes need them less.
const SMOOTH = 300000;
const SHOWN = ["surface", "bodies", "labels", "frusta", "beams", "zones", "obstacles"];

async function start() {
  const facts = JSON.parse(byId("facts").textContent);
  const arrays = await unpack(byId("payload").textContent, facts.arrays);
  const projectors = facts.devices.filter((d) => d.kind === "projector");
  Surface.LIT = facts.causes.light.length;
  const surface = new Surface(meshOf(arrays, "mesh"), facts.mesh, projectors, arrays.get("light"));
  const up = new THREE.Vector3(...facts.up);
  const stage = new Stage(byId("canvas"), surface.count < SMOOTH, objectCentre(facts), up, [...objectPlaces(facts), ...devicePlaces(facts), ...panelPlaces(facts)]);
  stage.scene.add(surface.mesh);
  const devices = new Devices(stage, facts, byId("labels"));
  const { zones, obstacles } = zonesAndObstacles(facts, (name) => meshOf(arrays, name));
  stage.scene.add(zones, obstacles);
  const layers = new Layers(facts, arrays, surface);
  const panel = new Panel(facts, arrays, surface, layers);
  const sequence = new Sequence(facts, arrays, surface, panel);
  const measure = new Measure(stage);
  const picking = new Picking(stage, surface);

  const mark = dots(new THREE.BufferGeometry());
  mark.frustumCulled = false;
  stage.scene.add(mark);

  stage.scene.traverse((thing) => {
    // A lens may bend into the picture what lies beside it.
    thing.frustumCulled = false;
    if (thing.material && !thing.material.isShaderMaterial) bends(thing.material);
  });

  const isOn = (name) => byId(`show-${name}`)?.checked ?? false;
  const ringed = projectors.filter((p) => p.radii.length);
  byId("rings-of").hidden = !ringed.length;
  const rings = new Map(ringed.map((p) => [p, check("rings-of", `rings-${p.id}`, p.id, false)]));

  function update() {
    const on = Object.fromEntries(SHOWN.map((name) => [name, isOn(name)]));
    const shining = sequence.on;
    devices.show(on, shining);
    surface.mesh.visible = on.surface;
    zones.visible = on.zones;
    obstacles.visible = on.obstacles;
    const asked = projectors.map((p) =>
      shining ? shining.includes(p.id) : rings.get(p)?.checked || stage.eye?.device === p,
    );
    surface.uniforms.ringsOn.value = asked.reduce((bits, lit, k) => bits | (lit ? 1 << k : 0), 0);
    stage.redraw();
  }

  function choose(face, point) {
    if (!(face >= 0 && face < surface.count)) return;
    surface.uniforms.chosen.value = face;
    mark.geometry.setFromPoints([point]);
    if (measure.active) measure.add(point);
    panel.show(face);
    stage.redraw();
  }

  function step(to) {
    sequence.go(to);
    if (sequence.step < 0) layers.show();
    update();
  }

  const [near, far] = [0.02 * stage.reach, 60 * stage.reach];
  const eyes = facts.devices.map((device) => new Eye(device, near, far, objectCentre(facts)));
  function look() {
    const chosen = byId("view").value;
    stage.eye = eyes.find((eye) => eye.device.id === chosen) ?? null;
    stage.eye?.zoom(1e-9);
    lookThrough(stage.eye?.lens ?? null);
    const turned = { all: {}, object: { places: objectPlaces(facts) } }[chosen];
    const flat = { top: [-Math.PI / 2, 1.57], front: [-Math.PI / 2, 0], side: [0, 0] }[chosen];
    if (turned) stage.frame({ turn: facingDevices(stage, facts), ...turned });
    if (flat) stage.frame({ turn: flat[0], height: flat[1] });
    byId("canvas").setAttribute("aria-label", `The rig in three dimensions, ${byId("view").selectedOptions[0].text}`);
    update();
  }

  for (const { id, kind } of facts.devices) {
    const words = kind === "camera" ? `what camera ${id} sees` : `what projector ${id} shines on`;
    byId("view").append(element("option", { value: id, textContent: words }));
  }
  for (const name of SHOWN) {
    byId(`show-${name}`)?.addEventListener("change", update);
  }
  for (const name of ["zones", "obstacles"]) byId(`show-${name}`).parentElement.hidden = !facts[name].length;
  rings.forEach((box) => box.addEventListener("change", update));
  byId("view").addEventListener("change", look);
  byId("layer").addEventListener("change", () => step(-1));
  byId("step-next").addEventListener("click", () => step(sequence.step + 1));
  byId("step-back").addEventListener("click", () => step((Math.max(sequence.step, 0) || facts.sequence.length) - 1));
  byId("step-end").addEventListener("click", () => step(-1));
  byId("measure").addEventListener("click", () => measure.toggle());
  byId("face-go").addEventListener("click", () => {
    const face = Math.floor(Number(byId("face-number").value));
    if (face >= 0 && face < surface.count) choose(face, surface.centroid(face));
  });
  byId("face-number").max = surface.count - 1;
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") measure.toggle(false);
  });
  stage.onHome = () => {
    byId("view").value = "all";
    look();
  };
  stage.onClick = (x, y) => {
    const hit = picking.at(x, y);
    if (hit) choose(hit.face, hit.point);
  };
  theme((colour, beside) => stage.setBackground(colour, beside));
  sequence.go(-1);
  layers.show();
  look();
  stage.onDraw.push(() => ready(stage));
  // For tests, and for those who look closer in the console.
  window.ringrig = { facts, arrays, surface, stage, panel, picking, choose };
}

// Says once how long the page took to its first picture [ms], drawn and not only asked
// for: reading a pixel waits for it.
function ready({ renderer }) {
  const root = document.documentElement;
  if (root.dataset.ready) return;
  const gl = renderer.getContext();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  root.dataset.ready = Math.round(performance.now());
}

function check(into, id, words, checked) {
  const box = element("input", { type: "checkbox", id, checked });
  byId(into).append(element("label", {}, box, ` ${words}`));
  return box;
}

const objectCentre = ({ mesh }) => new THREE.Vector3(...mesh.low.map((low, k) => low + 0.5 * mesh.side[k]));
const devicePlaces = ({ devices }) => devices.map(({ pose }) => new THREE.Vector3(...pose.slice(0, 3).map((row) => row[3])));

// Corners of panels in parallel light, which are as large as their beams.
const panelPlaces = ({ devices }) =>
  devices.filter(({ K }) => !K).flatMap((device) => panelCorners(device).map((c) => c.applyMatrix4(matrix(device.pose))));

// Corners of the object's box.
function objectPlaces({ mesh }) {
  return Array.from({ length: 8 }, (_, bits) =>
    new THREE.Vector3(...mesh.low.map((low, k) => low + ((bits >> k) & 1) * mesh.side[k])),
  );
}

// A turn about up from which the side that devices stand on is seen, a little aside.
function facingDevices(stage, facts) {
  const [across, ahead] = stage.level;
  const sum = [0, 0];
  for (const place of devicePlaces(facts)) {
    const away = place.sub(stage.centre);
    sum[0] += away.dot(across);
    sum[1] += away.dot(ahead);
  }
  return Math.atan2(sum[1], sum[0]) + 0.5;
}

start().catch((error) => {
  const words = "The three-dimensional view needs WebGL 2; tables and drawings below need nothing.";
  byId("triangle").replaceChildren(element("p", { role: "alert", textContent: `${words} (${error.message})` }));
  console.error(error);
});
