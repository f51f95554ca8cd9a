// The page: puts the parts together, and lets the keyboard do everything.
import { AttackForm } from "./attackform.js";
import { Graph, samples, stateWords } from "./graph.js";
import { Heat } from "./heat.js";
import { arrow, figure, fixed, make, onScheme } from "./looks.js";
import { Strip } from "./strip.js";
import { Wire } from "./wire.js";

const RATES = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50];
const SPANS = [[5, "5 s"], [10, "10 s"], [30, "30 s"], [60, "1 min"], [300, "5 min"], [3600, "1 h"]];
const SOURCES = { simulation: "simulation", bag: "recorded run", ros: "ROS run" };
const WHAT = { attack: "✕ attack", over: "○ over", alarm: "▲ alarm", quiet: "○ quiet", clock: "◷ clock", note: "· note" };
const LOG_LINES = 400;

const at = (id) => document.getElementById(id);
const state = { outline: null, frame: null, chosen: "", span: 10, shades: [], now: 0, forecast: null };

const wire = new Wire(await (await fetch("schema.json")).json(), heard, connection);
const command = (message) => wire.command(message);
const form = new AttackForm(command, foreseen);
const graph = new Graph(at("graph"), choose);
const heat = new Heat(at("heat"), at("heat-rows"), at("ramp"), choose);
const anyShade = () => state.shades.map((one) => [one.from, one.to ?? state.now]);
const linkShade = () => state.shades.filter((one) => one.link === state.chosen).map((one) => [one.from, one.to ?? state.now]);
const strips = {
  voltage: new Strip(at("voltage-plot"), { labels: [], unit: "V", least: 0.02, shades: anyShade }),
  current: new Strip(at("current-plot"), { labels: [], unit: "A", least: 0.2, shades: anyShade }),
  alpha: new Strip(at("alpha-plot"), { labels: [], unit: "V", least: 0.002, shades: anyShade }),
};
const residual = new Strip(at("residual-plot"), { labels: [], unit: "", log: true, shades: linkShade, height: 200 });
at("states").replaceChildren(...samples());

function view() {
  const seen = ["voltage", "current", "alpha", "heat"].filter((one) => visible.get(one) !== false);
  const width = Math.min(1200, Math.max(100, Math.round(at("residual-plot").clientWidth - 80)));
  return { kind: "view", panels: state.chosen ? [...seen, state.chosen] : seen, span_sec: state.span, pixels: width };
}

// only what is on the screen is sent
const visible = new Map();
const watcher = new IntersectionObserver((entries) => {
  let changed = false;
  for (const entry of entries) {
    const panel = entry.target.dataset.panel;
    if (visible.get(panel) !== entry.isIntersecting) {
      visible.set(panel, entry.isIntersecting);
      changed = true;
    }
  }
  if (changed && state.outline) wire.look(view());
}, { rootMargin: "100px" });
for (const [panel, id] of [["voltage", "voltage-plot"], ["current", "current-plot"], ["alpha", "alpha-plot"], ["heat", "heat"]]) {
  at(id).dataset.panel = panel;
  watcher.observe(at(id));
}

function heard(message) {
  if (message.kind === "outline") begin(message);
  if (message.kind === "frame" && state.outline) take(message);
  if (message.kind === "bye") notice(message.text);
}

function begin(outline) {
  const first = state.outline === null;
  state.outline = outline;
  document.title = `${outline.name} – dcmg`;
  at("name").textContent = outline.name;
  at("source").textContent = SOURCES[outline.source];
  at("about").textContent = outline.about;
  at("cut-row").hidden = !outline.can.includes("cut");
  for (const id of ["play", "step", "rate"]) at(id).disabled = !outline.can.includes("clock");
  at("scrub-row").hidden = !outline.can.includes("seek");
  at("scrub").max = String(outline.end_step ?? 1);
  if (first) {
    graph.build(outline);
    heat.build(outline);
    const labels = outline.dgus.map((one) => `DGU ${one.number}`);
    for (const strip of Object.values(strips)) strip.relabel(labels);
    residual.relabel(outline.outputs);
  }
  form.build(outline);
  choose(state.chosen || outline.links[0]?.name || "");
  notice("");
}

function choose(name) {
  state.chosen = name;
  const link = state.outline.links.find((one) => one.name === name);
  at("link-title").textContent = link ? `Link ${arrow(name)}` : "No link";
  at("residual-title").textContent = link ? `Residual over threshold, ${arrow(name)}` : "Residual over threshold";
  at("certificate").replaceChildren(...(link?.certificate ?? []).map((one) => make("li", {}, one)));
  form.choose(name);
  residual.clear();
  bands();
  wire.look(view());
  if (state.frame) later();
}

function take(frame) {
  state.frame = frame;
  const period = state.outline.sampling_period_sec;
  for (const series of frame.series) {
    if (series.panel === "heat") heat.take(series, period);
    else if (series.panel === state.chosen) residual.take(series, period);
    else strips[series.panel]?.take(series, period);
  }
  if (frame.log_anew) {
    at("log").replaceChildren();
    state.shades = [];
  }
  for (const entry of frame.log) tell(entry, period);
  later();
}

function tell(entry, period) {
  const when = entry.step * period;
  if (entry.what === "attack") state.shades.push({ link: entry.link, from: when, to: null });
  if (entry.what === "over") {
    const found = state.shades.find((one) => one.link === entry.link && one.to === null);
    if (found) found.to = when;
  }
  if (state.shades.length > 300) state.shades.shift();
  const log = at("log");
  log.prepend(make("li", { class: entry.what }, make("time", {}, `${fixed(when, 2)} s`), make("b", {}, WHAT[entry.what]), make("span", {}, entry.text)));
  while (log.children.length > LOG_LINES) log.lastChild.remove();
}

let waiting = false;
function later() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    draw();
  });
}

function draw() {
  const { outline, frame, chosen } = state;
  if (!frame || frame.links.length !== outline.links.length) return;
  const now = frame.time.step * outline.sampling_period_sec;
  state.now = now;
  const from = Math.max(0, now - state.span);
  const to = Math.max(now, state.span, horizon(now));
  graph.show(outline, frame, chosen);
  heat.states(frame.links, outline, chosen);
  if (visible.get("heat") !== false) heat.draw(from, to);
  for (const [name, strip] of Object.entries(strips)) {
    if (visible.get(name) === false) continue;
    strip.draw(from, to);
    strip.values(outline.dgus.map((one, place) => `DGU ${one.number} ${figure(frame[name][place], 5)} ${strip.options.unit}`));
  }
  residual.draw(from, to);
  clock(frame, now);
  game(frame);
  const blind = frame.links.some((one) => one.state === "hidden");
  at("residual-box").hidden = at("heat-box").hidden = blind;
  linkPanel(outline, frame, chosen);
}

function clock(frame, now) {
  const { time } = frame;
  at("play").textContent = time.ended ? (state.outline.can.includes("seek") ? "Again" : "Ended") : time.running ? "Pause" : "Go on";
  at("play").setAttribute("aria-pressed", String(time.running));
  at("time").textContent = `t = ${fixed(now, 2)} s`;
  at("factor").textContent = time.factor === null ? "" : `${figure(time.factor, 3)} × real time`;
  at("mean").textContent = frame.mean_voltage === null ? "" : `mean ${fixed(frame.mean_voltage, 4)} V`;
  at("late").textContent = time.late ? `${time.late} steps late` : "";
  at("late").classList.toggle("warn", time.late > 0);
  if (document.activeElement !== at("rate")) setRate(time.rate);
  if (!at("scrub").matches(":active")) at("scrub").value = String(time.step);
  document.body.dataset.step = String(time.step);
}

function setRate(rate) {
  const select = at("rate");
  const value = String(rate);
  if (![...select.options].some((one) => one.value === value)) select.append(make("option", { value }, `${rate} ×`));
  select.value = value;
}

/** How a challenge stands. */
function game(frame) {
  const found = frame.game;
  at("game").hidden = !found;
  if (!found) return;
  const told = { ready: "Ready", running: "Running", won: "✓ Won", lost: "✕ Lost" };
  at("goal").textContent = `${state.outline.name}: ${state.outline.challenge}`;
  at("game-verdict").textContent = told[found.verdict];
  at("game").dataset.verdict = found.verdict;
  at("share").value = found.share;
  at("moved").textContent = `moved ${fixed(found.moved_v, 3)} V`;
  at("left").textContent = `${fixed(found.left_sec, 1)} s left`;
  at("score").textContent = `${found.score} points`;
  at("game-why").textContent = found.why;
  at("again").hidden = !state.outline.can.includes("attack");
  if (at("best").children.length !== found.best.length) at("best").replaceChildren(...found.best.map((one) => make("li", {}, one)));
  const left = found.cut.includes(state.chosen);
  at("cut").textContent = left ? "Take this link in again" : "Leave this link out";
  at("cut").setAttribute("aria-pressed", String(left));
  graph.leave(found.cut, state.outline);
}

const cut = () => command({ kind: "cut", link: state.chosen, on: at("cut").getAttribute("aria-pressed") !== "true" });

/** Draw a forecast beside the truth until it is over, or forgotten. */
function foreseen(forecast) {
  state.forecast = forecast;
  at("foreseen").hidden = forecast === null;
  at("foreseen").querySelector("ul").replaceChildren(...(forecast?.lines ?? []).map((one) => make("li", {}, one)));
  bands();
  later();
}

function bands() {
  const forecast = state.forecast ?? null;
  const period = state.outline.sampling_period_sec;
  for (const [name, strip] of [...Object.entries(strips), [state.chosen, residual]]) {
    const found = forecast?.bands.find((one) => one.panel === name);
    strip.band = found ? { ...found, from: forecast.first_step * period, column: forecast.bin_steps * period } : null;
  }
  document.body.dataset.foreseen = forecast ? String(forecast.first_step) : "";
}

/** Until when there is something to draw [s]. */
function horizon(now) {
  const { forecast, outline, span } = state;
  if (!forecast) return now;
  const period = outline.sampling_period_sec;
  const [from, to] = [forecast.first_step * period, (forecast.first_step + forecast.steps) * period];
  if (now > to + span || now < from - period) {
    foreseen(null);
    return now;
  }
  return to;
}

function linkPanel(outline, frame, chosen) {
  const place = outline.links.findIndex((one) => one.name === chosen);
  if (place < 0) return;
  const found = frame.links[place];
  at("link-says").textContent = stateWords(found);
  const detail = frame.details.find((one) => one.link === chosen);
  const rows = at("link-numbers").tBodies[0];
  if (rows.children.length !== outline.outputs.length) {
    rows.replaceChildren(...outline.outputs.map((name) => make("tr", {}, make("td", {}, name), make("td"), make("td"), make("td"))));
  }
  outline.outputs.forEach((_, one) => {
    const [r, limit] = [detail?.residual[one] ?? null, detail?.threshold[one] ?? null];
    const ratio = r === null || !limit ? null : Math.abs(r) / limit;
    const cells = rows.children[one].children;
    [figure(r), figure(limit), figure(ratio, 3)].forEach((text, cell) => (cells[cell + 1].textContent = text));
    rows.children[one].className = ratio !== null && ratio > 1 ? "over" : "";
  });
  form.show(found.attacked, found.state === "calibrating" || found.state === "settling");
}

function connection(on, farewell) {
  at("link-state").textContent = on ? "live" : "not connected";
  at("link-state").className = `pill ${on ? "ok" : "off"}`;
  if (!on) notice(farewell || `${state.outline?.bag ? `The run has ended, or does not answer. Its bag shows every moment: dcmg page ${state.outline.bag}` : "The page does not answer: it has ended."} Trying again …`);
}

function notice(text) {
  at("notice").hidden = !text;
  at("notice").textContent = text;
}

// what a person does

const clockCommand = (action, more = {}) => command({ kind: "clock", action, ...more });
const toggle = async () => {
  if (state.frame?.time.ended && state.outline.can.includes("seek")) await seek(0);
  return clockCommand(state.frame?.time.running ? "pause" : "resume");
};
const faster = (by) => {
  const now = state.frame?.time.rate ?? 1;
  const next = by > 0 ? RATES.find((one) => one > now) : RATES.findLast((one) => one < now);
  if (next) clockCommand("rate", { rate: next });
};
// while one scrubs, only the last place that is asked for counts
const scrub = { asked: null, busy: false };
async function scrubTo(step) {
  scrub.asked = step;
  if (scrub.busy) return;
  scrub.busy = true;
  while (scrub.asked !== null) {
    const next = scrub.asked;
    scrub.asked = null;
    await seek(next);
  }
  scrub.busy = false;
}
const seek = (step) => command({ kind: "seek", step: Math.max(0, Math.min(state.outline.end_step ?? step, Math.round(step))) });

at("play").addEventListener("click", toggle);
at("step").addEventListener("click", (event) => clockCommand("step", { steps: event.shiftKey ? 10 : 1 }));
at("rate").append(...RATES.map((one) => make("option", { value: String(one) }, `${one} ×`)));
at("rate").addEventListener("change", () => clockCommand("rate", { rate: Number(at("rate").value) }));
at("span").append(...SPANS.map(([seconds, name]) => make("option", { value: String(seconds) }, name)));
at("span").value = String(state.span);
at("span").addEventListener("change", () => {
  state.span = Number(at("span").value);
  wire.look(view());
});
at("scrub").addEventListener("input", () => scrubTo(Number(at("scrub").value)));
at("again").addEventListener("click", () => command({ kind: "again" }));
at("cut").addEventListener("click", cut);
at("help").addEventListener("click", () => at("keys").showModal());

function neighbour(by) {
  const names = state.outline.links.map((one) => one.name);
  if (names.length) choose(names[(names.indexOf(state.chosen) + by + names.length) % names.length]);
}

const KEYS = {
  " ": toggle,
  ".": () => clockCommand("step"),
  ">": () => clockCommand("step", { steps: 10 }),
  ":": () => clockCommand("step", { steps: 10 }),
  "+": () => faster(1),
  "=": () => faster(1),
  "-": () => faster(-1),
  j: () => neighbour(1),
  k: () => neighbour(-1),
  a: () => at("kind").focus(),
  s: () => form.order("stop"),
  x: () => state.outline.can.includes("cut") && cut(),
  f: () => state.outline.can.includes("whatif") && form.ahead(false),
  "?": () => at("keys").showModal(),
  ArrowLeft: () => state.outline.can.includes("seek") && seek(state.frame.time.step - 1 / state.outline.sampling_period_sec),
  ArrowRight: () => state.outline.can.includes("seek") && seek(state.frame.time.step + 1 / state.outline.sampling_period_sec),
};

addEventListener("keydown", (event) => {
  const target = event.target;
  if (event.ctrlKey || event.metaKey || event.altKey || !state.outline || at("keys").open) return;
  if (target.matches("input, select, textarea")) {
    if (event.key === "Escape") target.blur();
    return;
  }
  if (event.key === " " && target.matches("button, summary, [role=button]") && target.id !== "play") {
    if (target.matches("[role=button]")) {
      choose(target.dataset.link);
      event.preventDefault();
    }
    return;
  }
  const does = KEYS[event.key];
  if (!does) return;
  event.preventDefault();
  does();
});

onScheme(() => {
  for (const strip of [...Object.values(strips), residual]) strip.build();
  later();
});
addEventListener("resize", () => {
  clearTimeout(state.resized);
  state.resized = setTimeout(() => state.outline && wire.look(view()), 300);
});

window.dcmg = { command }; // for scripts of one's own, and the console
wire.open(view());
