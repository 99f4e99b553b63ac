// Switch between dark and light theme, and read the colours of the canvases from the style sheet.

const NAMES = ["page", "ground", "grid", "text", "muted", "limit", "truth", "own", "target", "target-ahead", "force", "velocity",
  "tissue", "tissue-line", "e0", "e1", "e2", "e3", "e4"];

// Line styles of the estimators differ in colour and dashes.
export const DASHES = [[], [7, 4], [9, 3, 2, 3], [2, 3], [14, 4]];

export const colours = {};
const listeners = [];

export function onTheme(listener) {
  listeners.push(listener);
}

function read() {
  const style = getComputedStyle(document.documentElement);
  for (const name of NAMES) colours[name] = style.getPropertyValue(`--${name}`).trim();
  for (const listener of listeners) listener();
}

export function startTheme(button) {
  const preferred = matchMedia("(prefers-color-scheme: dark)");
  const root = document.documentElement;
  const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : preferred.matches);
  const label = () => {
    button.textContent = isDark() ? "Light theme" : "Dark theme";
  };
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    label();
    read();
  });
  preferred.addEventListener("change", () => {
    label();
    read();
  });
  label();
  read();
}

export function estimatorColour(index) {
  return colours[`e${index % DASHES.length}`];
}

export function estimatorDash(index) {
  return DASHES[index % DASHES.length];
}

// Return the font for a canvas, with the size in pixels of the canvas.
export function font(pixels, weight = "") {
  return `${weight} ${pixels}px system-ui, sans-serif`.trim();
}
