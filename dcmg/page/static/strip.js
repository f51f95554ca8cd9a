// A strip chart: the smallest and the largest value of each column, as curves that move with time.
import uPlot from "./vendor/uPlot.esm.js";
import { colour, curveColour, dash, make } from "./looks.js";

export class Strip {
  /** options: labels, unit, height, least (smallest range), log (ratio to a threshold at 1), shades() → [[from, to]] */
  constructor(root, options) {
    this.root = root;
    this.options = options;
    this.hidden = new Set();
    this.curves = make("ul", { class: "curves" });
    this.box = make("div");
    root.replaceChildren(this.curves, this.box);
    this.clear();
    this.build();
    new ResizeObserver(() => this.resize()).observe(root);
  }

  clear() {
    this.data = [[], ...this.options.labels.map(() => [])];
  }

  relabel(labels) {
    this.options.labels = labels;
    this.hidden.clear();
    this.clear();
    this.build();
  }

  build() {
    this.plot?.destroy();
    const { labels, log, height = 190, least = 0 } = this.options;
    const ink = colour("ink");
    const font = '12px Inter, "Segoe UI", "Helvetica Neue", Arial, sans-serif';
    const axis = { stroke: ink, font, grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("rule"), width: 1 } };
    const series = labels.map((label, at) => ({ label, stroke: colour(curveColour(at)), dash: dash(at), width: 1.6, points: { show: false }, show: !this.hidden.has(at) }));
    const linear = (_, low, high) => {
      for (const band of this.band ? [...this.band.low, ...this.band.high] : []) {
        for (const value of band) {
          if (value === null) continue;
          low = low === null ? value : Math.min(low, value);
          high = high === null ? value : Math.max(high, value);
        }
      }
      if (low === null) return [0, 1];
      const more = Math.max((least - (high - low)) / 2, (high - low) * 0.08);
      return [low - more, high + more];
    };
    const ratio = (_, low, high) => [low === null ? 0.01 : Math.max(1e-4, Math.min(0.1, low)), Math.max(10, (high ?? 1) * 1.5)];
    this.plot = new uPlot(
      {
        width: Math.max(200, this.root.clientWidth),
        height,
        legend: { show: false },
        cursor: { drag: { x: false, y: false }, points: { show: false } },
        scales: { x: { time: false, auto: false }, y: log ? { distr: 3, range: ratio } : { range: linear } },
        axes: [
          { ...axis, size: 34, values: (_, ticks) => ticks.map((one) => `${Number(one.toFixed(6))} s`) },
          { ...axis, size: 62, space: log ? 16 : 34, ...(log ? { splits: decades } : {}), values: (_, ticks) => ticks.map((one) => (one === null ? "" : log ? logTick(one) : String(Number(one.toPrecision(8))))) },
        ],
        series: [{}, ...series],
        hooks: { drawClear: [(plot) => this.shade(plot), (plot) => this.foresee(plot)], draw: [(plot) => this.threshold(plot)] },
      },
      this.data,
      this.box,
    );
    this.curves.replaceChildren(...labels.map((label, at) => this.curve(label, at)));
  }

  curve(label, at) {
    const line = make("line", { x1: 0, y1: 5, x2: 22, y2: 5, stroke: colour(curveColour(at)), "stroke-width": 3, "stroke-dasharray": dash(at).join(" ") });
    const toggle = () => {
      this.hidden.has(at) ? this.hidden.delete(at) : this.hidden.add(at);
      button.setAttribute("aria-pressed", String(!this.hidden.has(at)));
      this.plot.setSeries(at + 1, { show: !this.hidden.has(at) });
    };
    const button = make("button", { type: "button", "aria-pressed": String(!this.hidden.has(at)), onclick: toggle }, make("svg", { viewBox: "0 0 22 10", "aria-hidden": "true" }, line), make("span", {}, label));
    return make("li", {}, button);
  }

  values(texts) {
    texts.forEach((text, at) => {
      const span = this.curves.children[at]?.querySelector("span");
      if (span && span.textContent !== text) span.textContent = text;
    });
  }

  resize() {
    const width = this.root.clientWidth;
    if (width > 50 && width !== this.plot.width) this.plot.setSize({ width, height: this.plot.height });
  }

  take(series, period) {
    if (series.anew) this.clear();
    const size = series.bin_steps;
    const high = series.high ?? series.low;
    const count = series.low[0]?.length ?? 0;
    for (let bin = 0; bin < count; bin++) {
      const from = (series.first_bin + bin) * size * period;
      this.data[0].push(from);
      series.low.forEach((one, at) => this.data[at + 1].push(one[bin]));
      if (series.high) {
        this.data[0].push(from + (size * period) / 2);
        high.forEach((one, at) => this.data[at + 1].push(one[bin]));
      }
    }
  }

  draw(from, to) {
    let gone = 0;
    while (gone < this.data[0].length && this.data[0][gone] < from) gone++;
    if (gone > 200) this.data.forEach((one) => one.splice(0, gone - 1));
    this.plot.setData(this.data, false);
    this.plot.setScale("x", { min: from, max: to });
  }

  shade(plot) {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.fillStyle = colour("shade");
    for (const [from, to] of this.options.shades?.() ?? []) {
      const left = Math.max(bbox.left, plot.valToPos(from, "x", true));
      const right = Math.min(bbox.left + bbox.width, plot.valToPos(to, "x", true));
      if (right > left) ctx.fillRect(left, bbox.top, right - left, bbox.height);
    }
    ctx.restore();
  }

  /** Fill what lies between two futures, edges dashed. */
  foresee(plot) {
    if (!this.band) return;
    const { ctx, bbox } = plot;
    const { from, column } = this.band;
    const place = (value, bin) => [plot.valToPos(from + (bin + 0.5) * column, "x", true), plot.valToPos(this.options.log ? Math.max(value, 1e-5) : value, "y", true)];
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    this.band.low.forEach((low, at) => {
      if (this.hidden.has(at) || low.includes(null)) return;
      const edge = [...low.map(place), ...this.band.high[at].map(place).reverse()];
      ctx.beginPath();
      edge.forEach(([x, y], one) => (one ? ctx.lineTo(x, y) : ctx.moveTo(x, y)));
      ctx.closePath();
      ctx.fillStyle = ctx.strokeStyle = colour(curveColour(at));
      ctx.globalAlpha = 0.22;
      ctx.fill();
      ctx.globalAlpha = 0.9;
      ctx.lineWidth = devicePixelRatio;
      ctx.setLineDash([3 * devicePixelRatio, 3 * devicePixelRatio]);
      ctx.stroke();
    });
    ctx.restore();
  }

  threshold(plot) {
    if (!this.options.log) return;
    const { ctx, bbox } = plot;
    const y = plot.valToPos(1, "y", true);
    ctx.save();
    ctx.strokeStyle = colour("alert");
    ctx.lineWidth = 2 * devicePixelRatio;
    ctx.setLineDash([8 * devicePixelRatio, 5 * devicePixelRatio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.fillStyle = colour("alert");
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    ctx.font = `600 ${12 * devicePixelRatio}px Inter, Arial, sans-serif`;
    ctx.fillText("threshold", bbox.left + 6 * devicePixelRatio, y - 5 * devicePixelRatio);
    ctx.restore();
  }
}

function decades(_plot, _axis, low, high) {
  const [first, last] = [Math.ceil(Math.log10(low)), Math.floor(Math.log10(high))];
  const each = Math.max(1, Math.ceil((last - first) / 7));
  const found = [];
  for (let power = Math.ceil(first / each) * each; power <= last; power += each) found.push(10 ** power);
  return found;
}

function logTick(value) {
  const power = Math.log10(value);
  return Math.abs(power - Math.round(power)) < 1e-9 ? String(Number(value.toPrecision(3))) : "";
}
