// The distance between two points of the surface.

import * as THREE from "three";

import { byId, mm } from "./dom.js";

const LOOK = { color: 0xff00cc, depthTest: false };

// Dots that nothing hides, at points of a geometry.
export function dots(geometry) {
  return new THREE.Points(geometry, new THREE.PointsMaterial({ ...LOOK, size: 9, sizeAttenuation: false }));
}

export class Measure {
  constructor(stage) {
    this.stage = stage;
    this.points = [];
    const geometry = new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3()]);
    // Seen through the surface: a distance often runs inside it.
    this.line = new THREE.Line(geometry, new THREE.LineBasicMaterial(LOOK));
    this.ends = dots(geometry);
    for (const part of [this.line, this.ends]) {
      part.visible = false;
      part.frustumCulled = false;
      part.renderOrder = 9;
      stage.scene.add(part);
    }
  }

  get active() {
    return byId("measure").getAttribute("aria-pressed") === "true";
  }

  toggle(active = !this.active) {
    byId("measure").setAttribute("aria-pressed", String(active));
    this.points = [];
    this.line.visible = this.ends.visible = false;
    this.say(active ? "Choose the first point: click, or go to a triangle." : "");
    this.stage.redraw();
  }

  say(words) {
    byId("measure-words").textContent = words;
  }

  add(point) {
    if (this.points.length === 2) this.points = [];
    this.points.push(point.clone());
    const [a, b = a] = this.points;
    this.line.geometry.setFromPoints([a, b]);
    this.line.visible = this.ends.visible = true;
    const d = b.clone().sub(a);
    this.say(
      this.points.length === 1
        ? "Choose the second point."
        : `${mm(d.length(), 2)} apart: ${[d.x, d.y, d.z].map((x) => (1e3 * x).toFixed(2)).join(", ")} mm along x, y, z.`,
    );
    this.stage.redraw();
  }
}
