// What the surface is coloured by, and the legend that says what colours mean.

import { byId, element, percent } from "./dom.js";

const NOTHING = 255;
const BLANK = [185, 178, 170];
const rgb = (hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16));

export const valueOf = (about, code) =>
  code === NOTHING ? null : about.low + (code / 254) * (about.high - about.low);

function rounded(value, about) {
  const span = about.last - about.first;
  const digits = Math.max(0, 3 - Math.floor(Math.log10(span || 1)) - 1);
  return value.toFixed(Math.min(digits, 6));
}

// The colours of a scale's 256 codes.
function shades(about) {
  const stops = about.palette.map(rgb);
  return Array.from({ length: 256 }, (_, code) => {
    if (code === NOTHING) return BLANK;
    const share = (valueOf(about, code) - about.first) / (about.last - about.first || 1);
    const place = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
    const k = Math.min(Math.floor(place), stops.length - 2);
    return [0, 1, 2].map((i) => stops[k][i] + (place - k) * (stops[k + 1][i] - stops[k][i]));
  });
}

export function tableOf(about) {
  if (about.kind === "scale") return shades(about);
  const table = {};
  for (const { code, colour } of about.classes) table[code] = rgb(colour);
  return table;
}

export class Layers {
  constructor(facts, arrays, surface) {
    Object.assign(this, { facts, arrays, surface });
    this.select = byId("layer");
    for (const { id, label } of facts.layers) {
      this.select.append(element("option", { value: id, textContent: label }));
    }
  }

  get about() {
    return this.facts.layers.find((layer) => layer.id === this.select.value);
  }

  codes(id) {
    return this.arrays.get(`layer.${id}`)[0];
  }

  show() {
    const { about } = this;
    const table = tableOf(about);
    this.surface.paint(this.codes(about.id), table, BLANK);
    if (about.kind === "scale") scaleLegend(about);
    else classLegend(about.label, about.classes);
  }

  // A face's value in words; nothing where it has none.
  words(id, face) {
    const about = this.facts.layers.find((layer) => layer.id === id);
    const value = about && valueOf(about, this.codes(id)[face]);
    return value === null || value === undefined ? null : `${rounded(value, about)} ${about.unit}`;
  }
}

export function classLegend(title, classes) {
  const rows = classes
    .filter(({ share }) => share > 0)
    .map(({ words, colour, share }) => {
      const patch = element("span", { className: "patch" });
      patch.style.background = `#${colour}`;
      return element("li", {}, patch, `${percent(share)} ${words}`);
    });
  byId("legend").replaceChildren(element("h3", { textContent: `${title}, shares of the surface` }), element("ul", {}, ...rows));
}

function scaleLegend(about) {
  const bar = element("div", { className: "bar" });
  bar.style.background = `linear-gradient(90deg, ${about.palette.map((c) => `#${c}`).join(", ")})`;
  const ticks = [0, 0.25, 0.5, 0.75, 1].map((share) => {
    const value = rounded(about.first + share * (about.last - about.first), about);
    const sign = share === 0 && about.low < about.first ? "≤ " : share === 1 && about.high > about.last ? "≥ " : "";
    return element("span", { textContent: sign + value });
  });
  const patch = element("span", { className: "patch" });
  patch.style.background = `rgb(${BLANK.join(",")})`;
  const blank = { error: "no point there", curved: "not trusted" }[about.id] ?? "not measured";
  byId("legend").replaceChildren(
    element("h3", { textContent: `${about.label} [${about.unit}]` }),
    bar,
    element("div", { className: "ticks" }, ...ticks),
    element("ul", {}, element("li", {}, patch, blank)),
  );
}
