// Elements of the page by their id, and new ones; text only, never markup.

export const byId = (id) => document.getElementById(id);

export function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

export const mm = (metres, digits = 1) => `${(1e3 * metres).toFixed(digits)} mm`;
export const degrees = (radians) => `${((180 / Math.PI) * radians).toFixed(1)}°`;
export const percent = (share) => `${(100 * share).toFixed(1)} %`;
