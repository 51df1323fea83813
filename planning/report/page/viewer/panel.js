// A triangle that was chosen: who lights and sees it, or which limit forbids it.

import * as THREE from "three";

import { geometryOf, whyNoPair, whyNot } from "./limits.js";
import { byId, degrees, element, mm } from "./dom.js";
import { half } from "./payload.js";

export class Panel {
  constructor(facts, arrays, surface, layers) {
    Object.assign(this, { facts, arrays, surface, layers });
    this.projectors = facts.devices.filter((d) => d.kind === "projector");
    this.cameras = facts.devices.filter((d) => d.kind === "camera");
    // Cameras alone measure by each other: the first of a pair stands for its light.
    this.alone = !this.projectors.length;
    this.lights = this.alone ? this.cameras : this.projectors;
  }

  // Limits passed by a device on a face, and how many there are.
  steps(device, face) {
    const lights = device.kind === "projector";
    const causes = this.facts.causes[lights ? "light" : "sight"];
    const index = (lights ? this.projectors : this.cameras).indexOf(device);
    const passed = this.arrays.get(lights ? "light" : "sight")[index][face];
    return { passed, causes, good: passed === causes.length };
  }

  steep(face) {
    const parts = this.arrays.get("steep").map((column) => (column[face] - 32768) / 32767);
    return new THREE.Vector3(...parts);
  }

  show(face) {
    const { surface, facts, layers } = this;
    const point = surface.centroid(face);
    const normal = surface.normal(face);
    const about = { point, normal, steep: this.steep(face), limits: facts.limits };
    const place = [point.x, point.y, point.z].map((x) => (1e3 * x).toFixed(1)).join(", ");
    const devices = facts.devices.map((device) => this.device(device, face, about));
    const rows = [
      ["centroid", `${place} mm in the axes of the mesh`],
      ["region", this.region(face)],
      ...["curved", "error"].map((id) => [this.label(id), layers.words(id, face)]),
    ].filter(([, words]) => words);
    byId("triangle").replaceChildren(
      element("h3", { textContent: `Triangle ${face}` }),
      element("p", { className: "verdict", id: "triangle-verdict" }, ...this.verdict(face)),
      element("dl", {}, ...rows.flatMap(([key, words]) => [
        element("dt", { textContent: key }), element("dd", { textContent: words }),
      ])),
      element("h4", { textContent: "Devices" }),
      element("ul", { id: "triangle-devices" }, ...devices),
      ...this.pairs(face),
      element("p", { className: "small", textContent: "Each names the first limit that it violates at the centroid; limits that come after it aren't looked at." }),
    );
    byId("face-number").value = face;
  }

  label(id) {
    return this.facts.layers.find((layer) => layer.id === id)?.label;
  }

  region(face) {
    const about = this.facts.layers.find((layer) => layer.id === "region");
    return about.classes.find(({ code }) => code === this.layers.codes("region")[face])?.words;
  }

  verdict(face) {
    const code = this.layers.codes("cause")[face];
    const about = this.facts.layers.find((layer) => layer.id === "cause");
    if (code !== 255) {
      const row = about.classes.find((each) => each.code === code);
      return [element("strong", { textContent: "Not measured: " }), row.words];
    }
    const count = this.layers.codes("pairs")[face];
    const best = this.arrays.get("best")[0][face];
    const [p, c] = [Math.floor(best / this.cameras.length), best % this.cameras.length];
    const pair = `${this.lights[p].id} + ${this.cameras[c].id}`;
    const sigma = this.layers.words("sigma", face);
    const terms = this.facts.layers.filter((l) => l.id.startsWith("sigma."));
    const parts = terms.map((l) => `${l.id.slice(6)} ${this.layers.words(l.id, face)}`);
    return [
      element("strong", { textContent: `Measured by ${count} pair${count === 1 ? "" : "s"}. ` }),
      `Best ${pair}: sigma ${sigma} (${parts.join(", ")}), triangulation angle ${this.layers.words("angle", face)}.`,
    ];
  }

  device(device, face, about) {
    const { passed, causes, good } = this.steps(device, face);
    const at = geometryOf(device, about.point, about.normal);
    const verb = device.kind === "projector" ? "lights" : "sees";
    const words = good
      ? ` ${verb} it, ${degrees(at.incidence)} off its normal, ${mm(at.distance)} away`
      : `: ${causes[passed]}, ${whyNot(device, causes[passed], at, about)}`;
    return element("li", { className: good ? "good" : "bad" }, element("strong", { textContent: device.id }), words);
  }

  // Pairs that light and see a face, and still don't measure it.
  pairs(face) {
    const rows = [];
    const causes = this.facts.causes.pair;
    this.lights.forEach((projector, p) =>
      this.cameras.forEach((camera, c) => {
        if (this.alone && p >= c) return;
        // Devices of two stations are no pair: they measure one after the other.
        const [a, b] = [projector.station, camera.station];
        if (a && b && a !== b) return;
        if (!this.steps(projector, face).good || !this.steps(camera, face).good) return;
        const pair = p * this.cameras.length + c;
        const passed = this.arrays.get("pairs")[pair][face];
        const name = element("strong", { textContent: `${projector.id} + ${camera.id}` });
        if (passed === causes.length) return void rows.push(element("li", { className: "good" }, name, " measure it"));
        const value = half(this.arrays.get("failing")[pair][face]);
        rows.push(element("li", { className: "bad" }, name, `: ${causes[passed]}, ${whyNoPair(causes[passed], value, this.facts.limits)}`));
      }),
    );
    return rows.length ? [element("h4", { textContent: "Pairs" }), element("ul", {}, ...rows)] : [];
  }
}
