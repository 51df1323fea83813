// Steps through the exposures: which projectors shine, and which cameras measure by it.

import { classLegend } from "./layers.js";
import { byId } from "./dom.js";

const CLASSES = [
  { code: 2, words: "lit and measured in this step", colour: "1f988b" },
  { code: 1, words: "lit, not measured", colour: "f0e442" },
  { code: 0, words: "dark", colour: "6b6b73" },
];

export class Sequence {
  constructor(facts, arrays, surface, panel) {
    Object.assign(this, { facts, arrays, surface, panel });
    this.step = -1; // Not stepping.
  }

  get on() {
    return this.step < 0 ? null : this.facts.sequence[this.step].on;
  }

  go(step) {
    const { length } = this.facts.sequence;
    this.step = step < 0 || !length ? -1 : step % length;
    if (this.step < 0) {
      byId("step-words").textContent = `${length} step${length === 1 ? "" : "s"}; not stepping`;
      return;
    }
    const { on, frames } = this.facts.sequence[this.step];
    const { cameras, shares } = this.paint(on);
    const shine = on.map((id, k) => `${id} (${frames[k]} frames)`).join(" and ");
    const measure = cameras.map((id, k) => `${id} ${(100 * shares[k]).toFixed(1)} %`).filter((_, k) => shares[k] > 0);
    byId("step-words").textContent =
      `Step ${this.step + 1} of ${length}: ${shine} shine${on.length === 1 ? "s" : ""}; ` +
      (measure.length ? `of the surface ${measure.join(", ")} measure` : "no camera measures");
  }

  paint(on) {
    const { arrays, facts, panel, surface } = this;
    const { projectors, cameras } = panel;
    const chosen = projectors.flatMap((p, k) => (on.includes(p.id) ? [k] : []));
    const [lit, most] = [facts.causes.light.length, facts.causes.pair.length];
    const seen = facts.causes.sight.length;
    const [light, sight, pairs] = ["light", "sight", "pairs"].map((name) => arrays.get(name));
    const { areas, count } = surface;
    const totals = new Float64Array(cameras.length);
    const kinds = new Float64Array(3);
    const codes = new Uint8Array(count);
    let whole = 0;
    for (let f = 0; f < count; f++) {
      whole += areas[f];
      let code = chosen.some((p) => light[p][f] === lit) ? 1 : 0;
      for (let c = 0; code && c < cameras.length; c++) {
        if (sight[c][f] !== seen) continue;
        const measures = chosen.some((p) => light[p][f] === lit && pairs[p * cameras.length + c][f] === most);
        if (!measures) continue;
        totals[c] += areas[f];
        code = 2;
      }
      codes[f] = code;
      kinds[code] += areas[f];
    }
    const rgb = (hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16));
    const shades = Object.fromEntries(CLASSES.map(({ code, colour }) => [code, rgb(colour)]));
    surface.paint(codes, shades, shades[0]);
    classLegend(`Exposure: ${on.join(" + ")}`, CLASSES.map((row) => ({ ...row, share: kinds[row.code] / whole })));
    return { cameras: cameras.map((camera) => camera.id), shares: [...totals].map((total) => total / whole) };
  }
}
