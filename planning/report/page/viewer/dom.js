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

// Light or dark: as the system asks, until the button says otherwise.
export function theme(changed) {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (root.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";
  const apply = () => {
    byId("theme").textContent = isDark() ? "Light page" : "Dark page";
    const style = getComputedStyle(root);
    changed(...["--canvas", "--beside"].map((name) => style.getPropertyValue(name).trim()));
  };
  byId("theme").addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    apply();
  });
  system.addEventListener("change", apply);
  apply();
}
