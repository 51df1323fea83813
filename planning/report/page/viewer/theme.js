// Light or dark: as the system asks, until the button says otherwise.

import { byId } from "./dom.js";

export function theme(changed) {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (root.dataset.theme ?? (system.matches ? "dark" : "light")) === "dark";
  const apply = () => {
    byId("theme").textContent = isDark() ? "Light page" : "Dark page";
    changed(getComputedStyle(root).getPropertyValue("--canvas").trim());
  };
  byId("theme").addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    apply();
  });
  system.addEventListener("change", apply);
  apply();
}
