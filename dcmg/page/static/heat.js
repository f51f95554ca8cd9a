// Residual over threshold of every link: a row a link, a column some steps.
import { arrow, colour, figure, make, onScheme } from "./looks.js";

const MOST = 40;
const LARGEST = 25;
const MARKS = { alarm: "▲", suspicious: "△", refused: "·", calibrating: "~", settling: "~", quiet: "", hidden: "" };

export class Heat {
  constructor(canvas, rows, ramp, chosen) {
    Object.assign(this, { canvas, rows, ramp, chosen });
    this.image = make("canvas");
    this.columns = [];
    onScheme(() => this.paint());
    canvas.addEventListener("click", (event) => this.names?.length && chosen(this.names[Math.min(this.count - 1, Math.floor(event.offsetY / this.row))]));
  }

  build(outline) {
    this.count = outline.links.length;
    this.names = outline.links.map((one) => one.name);
    this.columns = [];
    this.dense = this.count > MOST;
    this.row = this.dense ? Math.max(1.5, 560 / this.count) : Math.max(15, Math.min(22, 340 / Math.max(this.count, 1)));
    this.rows.replaceChildren(...outline.links.slice(0, this.dense ? LARGEST : this.count).map((link) => this.item(link.name)));
    this.paint();
  }

  /** A row's name and number; of many links only the largest have one. */
  item(name) {
    const button = make("button", { type: "button", "data-row": name, onclick: () => this.chosen(button.dataset.row) }, make("span", {}, arrow(name)), make("span", {}, ""));
    button.style.height = `${this.dense ? 22 : this.row}px`;
    return make("li", {}, button);
  }

  /** Colours of ratios from 0 to 10, 64 a unit below 1. */
  paint() {
    const stops = ["h0", "h1", "h2", "h3"].map((name) => parse(colour(name)));
    this.table = Array.from({ length: 257 }, (_, at) => shade(stops, at / 64));
    this.none = parse(colour("paper"));
    const bar = make("canvas", { width: 128, height: 1 });
    const context = bar.getContext("2d");
    for (let x = 0; x < 128; x++) {
      context.fillStyle = `rgb(${this.table[x * 2]})`;
      context.fillRect(x, 0, 1, 1);
    }
    this.ramp.replaceChildren("0", bar, "4 and more; ▲ alarm, △ above half of the threshold");
  }

  take(series, period) {
    if (series.anew) this.columns = [];
    const upper = series.high ?? series.low;
    this.size = series.bin_steps * period;
    for (let bin = 0; bin < (upper[0]?.length ?? 0); bin++) {
      this.columns.push({ from: (series.first_bin + bin) * this.size, values: upper.map((one) => one[bin]) });
    }
  }

  draw(from, to) {
    while (this.columns.length && this.columns[0].from < from - this.size) this.columns.shift();
    const size = this.size || 1;
    const first = Math.floor(from / size + 1e-6);
    const [width, height] = [Math.max(1, Math.ceil((to - from) / size - 1e-6)), Math.max(1, this.count)];
    const scale = devicePixelRatio;
    const [wide, high] = [Math.round(this.canvas.clientWidth * scale), Math.round(this.row * this.count * scale)];
    if (this.canvas.width !== wide || this.canvas.height !== high) {
      Object.assign(this.canvas, { width: wide, height: high });
      this.canvas.style.height = `${this.row * this.count}px`;
    }
    if (this.image.width !== width || this.image.height !== height) Object.assign(this.image, { width, height });
    const inner = this.image.getContext("2d");
    const pixels = inner.createImageData(width, height);
    pixels.data.fill(0);
    for (const column of this.columns) {
      const x = Math.round(column.from / size) - first;
      if (x < 0 || x >= width) continue;
      column.values.forEach((value, y) => {
        if (value === null) return;
        const [r, g, b] = this.table[Math.min(256, Math.round(Math.min(value, 4) * 64))];
        pixels.data.set([r, g, b, 255], 4 * (y * width + x));
      });
    }
    inner.putImageData(pixels, 0, 0);
    const context = this.canvas.getContext("2d");
    context.imageSmoothingEnabled = false;
    context.clearRect(0, 0, wide, high);
    context.drawImage(this.image, 0, 0, wide, high);
    context.fillStyle = colour("paper");
    for (let y = 1; y < this.count && !this.dense; y++) context.fillRect(0, Math.round(y * this.row * scale), wide, Math.max(1, scale));
  }

  states(links, outline, chosen) {
    const weight = (one) => (one.state === "alarm" ? 1e9 : 0) + (one.attacked ? 1e8 : 0) + Math.min(one.score ?? -1, 1e7);
    const order = [...links.keys()];
    if (this.dense) order.sort((one, other) => weight(links[other]) - weight(links[one]) || one - other);
    [...this.rows.children].forEach((item, place) => {
      const [state, name] = [links[order[place]], outline.links[order[place]].name];
      const classes = `${state.state}${name === chosen ? " chosen" : ""}`;
      if (item.className !== classes) item.className = classes;
      const button = item.firstChild;
      const mark = MARKS[state.state];
      const texts = [arrow(name), state.score === null ? mark : `${mark} ${figure(state.score, 2)}`];
      button.dataset.row = name;
      texts.forEach((text, at) => {
        if (button.children[at].textContent !== text) button.children[at].textContent = text;
      });
    });
  }
}

const parse = (hex) => [1, 3, 5].map((at) => parseInt(hex.length === 4 ? hex[(at + 1) / 2].repeat(2) : hex.slice(at, at + 2), 16));

function shade(stops, ratio) {
  const [at, part] = ratio < 0.5 ? [0, ratio * 2] : ratio < 1 ? [1, ratio * 2 - 1] : [2, (ratio - 1) / 3];
  return stops[at].map((one, place) => Math.round(one + (stops[at + 1][place] - one) * Math.min(1, part)));
}
