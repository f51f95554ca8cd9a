// The grid: DGUs on a circle, power lines between them, and the two directed links of each line bent apart.
import { arrow, fixed, make } from "./looks.js";

const SIZE = 440;
const BEND = 0.16;
const WORDS = {
  refused: "not monitored", settling: "settling", calibrating: "learning", quiet: "quiet", suspicious: "suspicious", alarm: "alarm", hidden: "what its monitor says is hidden",
};

export const stateWords = (state) => `${WORDS[state.state]}${state.attacked ? ", attacked" : ""}`;

export class Graph {
  constructor(svg, chosen) {
    this.svg = svg;
    this.chosen = chosen;
    this.links = [];
    this.volts = [];
    // letters keep their size where the drawing is small
    new ResizeObserver(() => svg.style.setProperty("--letters", String(Math.max(1, SIZE / Math.max(svg.clientWidth, 100))))).observe(svg);
  }

  build(outline) {
    const count = outline.dgus.length;
    this.few = count <= 16;
    this.radius = this.few ? 21 : Math.max(3, 66 / Math.sqrt(count));
    this.svg.setAttribute("viewBox", `0 0 ${SIZE} ${SIZE}`);
    this.svg.classList.toggle("many", !this.few);
    const inner = SIZE - 88;
    const places = new Map(outline.dgus.map((one) => [one.number, [44 + inner * one.x, 38 + inner * one.y]]));
    const wires = outline.lines.map((one) => this.wire(one, places));
    const links = outline.links.map((one) => this.link(one, places));
    const nodes = outline.dgus.map((one) => this.node(one, places.get(one.number)));
    this.links = links;
    this.svg.replaceChildren(...wires, ...links, ...nodes);
  }

  wire(line, places) {
    const [[x1, y1], [x2, y2]] = line.between.map((one) => places.get(one));
    return make("line", { class: "wire", x1, y1, x2, y2 }, make("title", {}, `Line ${line.between.join(" – ")}: ${line.facts}`));
  }

  node(dgu, [x, y]) {
    const label = make("text", { x, y: y + (this.few ? 5 : 4) }, String(dgu.number));
    const volt = make("text", { class: "volt", x, y: y + this.radius + 17 }, "");
    this.volts[dgu.number] = volt;
    return make("g", { class: "node" }, make("title", {}, `DGU ${dgu.number}: ${dgu.facts}`), make("circle", { cx: x, cy: y, r: this.radius }), ...(this.few ? [label, volt] : this.radius > 11 ? [label] : []));
  }

  link(link, places) {
    const { path, head, middle } = bent(places.get(link.source), places.get(link.target), this.radius);
    const [x, y] = middle;
    const choose = () => this.chosen(link.name);
    const press = (event) => {
      if (event.key === "Enter") choose();
    };
    return make(
      "g",
      { class: "link", tabindex: 0, role: "button", "data-link": link.name, "aria-pressed": "false", onclick: choose, onkeydown: press },
      make("title", {}, ""),
      make("path", { class: "reach", d: path }),
      make("path", { class: "edge", d: path }),
      make("polygon", { class: "head", points: head }),
      make("g", { class: "marks", transform: `translate(${x.toFixed(1)},${y.toFixed(1)})${this.few ? "" : " scale(.7)"}` }, bang(-0), hit(0)),
    );
  }

  /** Links that secondary control leaves out are crossed. */
  leave(names, outline) {
    outline.links.forEach((one, at) => this.links[at].classList.toggle("left-out", names.includes(one.name)));
  }

  show(outline, frame, chosen) {
    frame.links.forEach((state, at) => {
      const element = this.links[at];
      const name = outline.links[at].name;
      const classes = `link ${state.state}${state.attacked ? " attacked" : ""}${name === chosen ? " chosen" : ""}`;
      if (element.getAttribute("class").replace(" left-out", "") !== classes) {
        element.setAttribute("class", classes);
        element.setAttribute("aria-pressed", String(name === chosen));
        element.setAttribute("aria-label", `Link ${arrow(name)}: ${stateWords(state)}`);
        element.querySelector("title").textContent = `${arrow(name)}: ${stateWords(state)}`;
        const both = state.attacked && state.state === "alarm";
        element.querySelector(".bang").setAttribute("transform", `translate(${both ? -11 : 0},0)`);
        element.querySelector(".hit").setAttribute("transform", `translate(${both ? 11 : 0},0)`);
      }
    });
    outline.dgus.forEach((one, at) => {
      const text = `${fixed(frame.voltage[at], 3)} V`;
      if (this.volts[one.number].textContent !== text) this.volts[one.number].textContent = text;
    });
  }
}

function bang(at) {
  return make("g", { class: "mark bang", transform: `translate(${at},0)` }, make("path", { d: "M0,-11 L11,9 L-11,9 Z" }), make("line", { x1: 0, y1: -4, x2: 0, y2: 2.5 }), make("circle", { cx: 0, cy: 6, r: 0.6 }));
}

function hit(at) {
  return make("g", { class: "mark hit", transform: `translate(${at},0)` }, make("rect", { x: -8, y: -8, width: 16, height: 16, transform: "rotate(45)" }), make("path", { d: "M-4,-4 L4,4 M4,-4 L-4,4" }));
}

function bent([ax, ay], [bx, by], radius) {
  const [dx, dy] = [bx - ax, by - ay];
  const length = Math.hypot(dx, dy) || 1;
  const bend = BEND * length;
  const middle = [(ax + bx) / 2 - (bend * dy) / length, (ay + by) / 2 + (bend * dx) / length];
  const start = rim([ax, ay], middle, radius + 3);
  const tip = rim([bx, by], middle, radius + 3);
  const end = rim([bx, by], middle, radius + 12);
  const [ux, uy] = [(tip[0] - end[0]) / 9, (tip[1] - end[1]) / 9];
  const head = [tip, [end[0] - uy * 5.5, end[1] + ux * 5.5], [end[0] + uy * 5.5, end[1] - ux * 5.5]];
  const top = [0, 1].map((at) => 0.25 * start[at] + 0.5 * middle[at] + 0.25 * end[at]);
  const at = (point) => point.map((one) => one.toFixed(1)).join(",");
  return { path: `M${at(start)} Q${at(middle)} ${at(end)}`, head: head.map(at).join(" "), middle: top };
}

function rim([x, y], [tx, ty], distance) {
  const length = Math.hypot(tx - x, ty - y) || 1;
  return [x + (distance * (tx - x)) / length, y + (distance * (ty - y)) / length];
}

/** What each state looks like, for the legend. */
export function samples() {
  const edge = (state, ...more) => make("svg", { class: state, viewBox: "0 0 42 16", "aria-hidden": "true" }, make("path", { class: "edge", d: "M1,8 L34,8" }), ...more);
  const small = (mark, x) => make("g", { transform: `translate(${x},8) scale(.66)` }, mark);
  const tip = () => make("polygon", { class: "head", points: "41,8 33,4 33,12", fill: "currentColor" });
  const rows = [
    [edge("quiet", tip()), "quiet"],
    [edge("suspicious", tip()), "suspicious: above half of the threshold"],
    [edge("alarm", tip(), small(bang(0), 17)), "alarm"],
    [edge("attacked quiet", tip(), small(hit(0), 17)), "attacked"],
    [edge("calibrating", tip()), "settling, learning"],
    [edge("refused", tip()), "not monitored"],
  ];
  return rows.map(([picture, text]) => make("li", {}, picture, text));
}
