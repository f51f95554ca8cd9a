// Colours from the style sheet, small builders, numbers as people read them.

export const DASHES = [[], [7, 4], [2, 3]];
const CURVES = 8;

export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
export const curveColour = (at) => `--c${at % CURVES}`.slice(2);
export const dash = (at) => DASHES[Math.floor(at / CURVES) % DASHES.length];

export function make(tag, attributes = {}, ...inner) {
  const svg = ["svg", "g", "path", "circle", "line", "rect", "text", "title", "polygon"].includes(tag);
  const element = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...inner);
  return element;
}

export function figure(value, digits = 4) {
  if (value === null || value === undefined) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(2);
  return String(Number(value.toPrecision(digits)));
}

export const fixed = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits));
export const arrow = (name) => name.replace("-", " → ");

export function onScheme(then) {
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", then);
}
