// How the searches went: objective of every generation of the genetic algorithm, spread of its population.
"use strict";

rsmkit.searches = (function () {
  const { element, section, choice } = rsmkit.format;
  let data, chosen;

  function open() {
    ({ data } = rsmkit);
    const told = data.searches.filter((search) => search.history.generation?.length);
    if (!told.length) return;
    chosen = told[0];
    const host = element("div", { role: "img", "aria-label": "Progress of the search over the generations" });
    section("searches", "How the search went",
      element("div", { class: "bar" }, choice("Search", told.map((s) => [s.name, s.name]), chosen.name, (name) => {
        chosen = told.find((s) => s.name === name);
        rsmkit.charts.update(new Set(["search"]));
      })), host, element("p", { class: "fine" }, "Spread: mean distance between the individuals, in shares of the box; " +
        "near zero the population has converged."));
    rsmkit.charts.add(host, { build: chart, keys: ["search"] });
  }

  function chart() {
    const h = chosen.history;
    const { colour } = rsmkit.charts;
    const line = (y, name, color, extra = {}) => ({ type: "scatter", mode: "lines", x: h.generation, y, name,
      line: { color, width: 2 }, ...extra });
    const traces = h.best
      ? [line(h.best, "best", colour("accent")), line(h.mean, "mean", colour("fair")), line(h.worst, "worst", colour("soft"))]
      : [line(h.hypervolume, "dominated volume", colour("accent"))];
    if (h.mean_distance) traces.push(line(h.mean_distance, "spread", colour("now"), { yaxis: "y2", line: { color: colour("now"), width: 1.5, dash: "dot" } }));
    return { traces, layout: { height: 340, showlegend: true, hovermode: "x unified", margin: { l: 60, r: 60, t: 34, b: 44 },
      xaxis: { title: { text: "generation" } }, yaxis: { title: { text: h.best ? "objective" : "dominated volume" } },
      yaxis2: { overlaying: "y", tickmode: "auto", side: "right", title: { text: "spread" }, showgrid: false, rangemode: "tozero" }, uirevision: chosen.name } };
  }

  return { open };
})();
