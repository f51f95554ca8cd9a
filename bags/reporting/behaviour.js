"use strict";
// Bokeh draws on canvases, which style sheets do not reach: its colours, and the columns of its legends, follow the page.
(() => {
  const light = ["#1f2933", "#6b7785", "#e6eaee", "#ffffff", "#b8c1ca", "#f1f3f5", "#f8dfcc"];
  const dark = ["#e6ebf0", "#9aa7b4", "#2b343d", "#181f25", "#4a5662", "#20282f", "#5a2d10"];
  const query = matchMedia("(prefers-color-scheme: dark)");
  const print = matchMedia("print");
  const other = (value, from, to) => {
    const at = typeof value === "string" ? from.indexOf(value.toLowerCase()) : -1;
    return at < 0 ? null : to[at];
  };
  const models = () => (window.Bokeh ? Bokeh.documents.flatMap((doc) => [...doc._all_models.values()]) : []);
  const paint = () => {
    const night = query.matches && !print.matches;
    const [from, to] = night ? [light, dark] : [dark, light];
    for (const model of models()) {
      for (const [name, held] of Object.entries(model.attributes)) {
        if (!name.endsWith("color")) continue;
        const vector = held !== null && typeof held === "object" && "value" in held;
        const swapped = other(vector ? held.value : held, from, to);
        if (swapped !== null) model[name] = vector ? { ...held, value: swapped } : swapped;
      }
    }
  };
  const fit = () => {
    for (const model of models()) {
      if (model.type === "Legend") model.ncols = window.innerWidth < 600 ? 3 : Math.max(model.ncols, model.tags[0] || 0);
    }
    for (const one of document.querySelectorAll(".scroll")) one.classList.toggle("wide", one.scrollWidth > one.clientWidth + 1);
  };
  const start = () => { paint(); fit(); setTimeout(() => { paint(); fit(); }, 400); };
  query.addEventListener("change", paint);
  print.addEventListener("change", paint);
  addEventListener("resize", fit);
  if (document.readyState === "complete") start(); else addEventListener("load", start);
})();
