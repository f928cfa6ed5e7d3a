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
    const host = element("div");
    section("searches", "How the search went",
      element("div", { class: "bar" }, choice("Search", told.map((s) => [s.name, s.name]), chosen.name, (name) => {
        chosen = told.find((s) => s.name === name);
        rsmkit.charts.update(new Set(["search"]));
      })), host, element("p", { class: "fine" }, "Spread: mean distance between the individuals, in shares of the box; " +
        "near zero the population has converged."));
    rsmkit.charts.add(host, { plot: chart, keys: ["search"] });
  }

  function chart() {
    const h = chosen.history;
    const { colour } = rsmkit.charts;
    const line = (y, name, shade, more = {}) => ({ kind: "line", x: h.generation, y, name, colour: colour(shade), ...more });
    // desirabilities are minimised with their sign turned; below zero is how far goals are out of reach
    const isWished = Boolean(chosen.settings?.desirability);
    const shown = (values) => (isWished ? values.map((v) => (v === null ? v : -v)) : values);
    const marks = h.best ? [line(shown(h.best), "best", "accent"), line(shown(h.mean), "mean", "fair"), line(shown(h.worst), "worst", "soft")]
      : [line(h.hypervolume, "dominated volume", "accent")];
    if (h.mean_distance) marks.push(line(h.mean_distance, "spread", "now", { onY2: true, width: 1.5, dash: "2 3" }));
    return { label: "Progress of the search over the generations", height: 320, legend: true, marks, x: { title: "generation" },
      y: { title: !h.best ? "dominated volume" : isWished ? "overall desirability" : "objective" }, y2: h.mean_distance ? { title: "spread", low: 0 } : null };
  }

  return { open };
})();
