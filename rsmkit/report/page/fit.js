// How well the surface of one quantity fits: effects, observed against predicted, residuals, tables.
"use strict";

rsmkit.fit = (function () {
  const { element, section, choice, number, plain } = rsmkit.format;
  let data, study, state, picker, tables, effects, parity, residuals;

  function open() {
    ({ data, study, state } = rsmkit);
    const known = study.quantities.filter((q) => data.reports[q.key]);
    picker = choice("Surface of", known.map((q) => [q.key, q.title]), shown(), (key) => state.set({ quantity: key }));
    [effects, parity, residuals] = ["Effects: coefficients over their standard errors", "Observed against predicted",
      "Residuals against predicted"].map((label) => element("div", { role: "img", "aria-label": label }));
    tables = element("div");
    section("fit", "How well it fits", element("div", { class: "bar" }, picker),
      element("div", { class: "trio" },
        element("div", {}, element("h3", {}, "Effects (t values)"), effects),
        element("div", {}, element("h3", {}, "Observed against predicted"), parity),
        element("div", {}, element("h3", {}, "Studentised residuals"), residuals)),
      tables);
    rsmkit.charts.add(effects, { build: effectsChart, keys: ["quantity"] });
    rsmkit.charts.add(parity, { build: parityChart, keys: ["quantity"] });
    rsmkit.charts.add(residuals, { build: residualChart, keys: ["quantity"] });
    fillTables();
  }

  // The quantity chosen for the contours, or the first response when that one has no surface of its own.
  const shown = () => (data.reports[state.quantity] ? state.quantity : data.responses[0].key);

  const report = () => data.reports[shown()];

  function effectsChart() {
    const terms = (report().terms ?? []).filter((term) => term.name !== "1" && term.t !== null)
      .sort((a, b) => Math.abs(a.t) - Math.abs(b.t)).slice(-24);
    const { colour } = rsmkit.charts;
    return { traces: [{ type: "bar", orientation: "h", x: terms.map((t) => t.t), y: terms.map((t) => plain(t.name)),
      marker: { color: terms.map((t) => (t.p < 0.05 ? colour("accent") : colour("line"))) },
      hovertemplate: "%{y}: t = %{x:.3g}<extra></extra>" }],
      layout: { height: Math.max(300, 60 + 22 * terms.length), xaxis: { title: { text: "t" } }, yaxis: {}, uirevision: state.quantity } };
  }

  function parityChart() {
    const { observed = [], fitted = [] } = report().diagnostics;  // not every kind of surface has them
    const ends = observed.length ? [Math.min(...observed, ...fitted), Math.max(...observed, ...fitted)] : [];
    const { colour } = rsmkit.charts;
    return { traces: [
      { type: "scatter", mode: "lines", x: ends, y: ends, line: { color: colour("soft"), width: 1, dash: "dot" }, hoverinfo: "skip" },
      dots(fitted, observed)], layout: { height: 300, xaxis: { title: { text: "predicted" } },
      yaxis: { title: { text: "observed" } }, hovermode: "closest", uirevision: state.quantity } };
  }

  function residualChart() {
    const { fitted = [], studentised = [] } = report().diagnostics;
    return { traces: [dots(fitted, studentised)], layout: { height: 300, xaxis: { title: { text: "predicted" } },
      yaxis: { title: { text: "residual / its standard error" }, zeroline: true }, hovermode: "closest", uirevision: state.quantity } };
  }

  function dots(x, y) {
    return { type: "scatter", mode: "markers", x, y, marker: { color: rsmkit.charts.colour("accent"), size: 7, opacity: 0.75 },
      text: x.map((_, i) => `run ${i + 1}`), hovertemplate: "%{text}<br>%{x:.5g}, %{y:.5g}<extra></extra>" };
  }

  function table(caption, head, rows) {
    return element("div", { class: "scroller", tabindex: "0", role: "group", "aria-label": caption },
      element("table", {}, element("caption", {}, caption),
        element("thead", {}, element("tr", {}, ...head.map((text) => element("th", { scope: "col" }, text)))),
        element("tbody", {}, ...rows.map(([name, ...cells]) => element("tr", {}, element("th", { scope: "row" }, name),
          ...cells.map((cell) => element("td", {}, cell)))))));
  }

  const probability = (p) => (p === null || p === undefined ? "–" : p < 0.0001 ? "< 0.0001" : p.toFixed(4));

  function fillTables() {
    const r = report();
    tables.replaceChildren();
    if (r.note) tables.append(element("p", { class: "fine" }, `${r.note}.`));
    const summary = [["R²", r.r2], ["R² adjusted", r.r2_adjusted], ["R² predicted", r.r2_predicted], ["σ", r.sigma],
      ["PRESS", r.press], ["leave-one-out error", r.rmse_loo], ["runs", r.runs], ["degrees of freedom left", r.df]]
      .filter(([, value]) => value !== undefined);
    tables.append(table(`Summary (${r.model})`, ["", "value"], summary.map(([name, value]) => [name, number(value, Math.abs(value) / 1e4)])));
    if (r.terms) {
      tables.append(table(`Coefficients (${r.units} units)`, ["term", "estimate", "std. error", "95 % interval", "t", "p"],
        r.terms.map((t) => [t.name, number(t.estimate, t.std_error), number(t.std_error, Math.abs(t.std_error) / 10),
          `${number(t.low, t.std_error)} … ${number(t.high, t.std_error)}`, number(t.t, 0.01), probability(t.p)])));
    }
    if (r.anova) {
      tables.append(table("Analysis of variance (sequential)", ["source", "df", "sum of squares", "mean square", "F", "p"],
        Object.entries(r.anova).map(([source, row]) => [source, String(row.df), number(row.ss), number(row.ms), number(row.F), probability(row.p)])));
    }
    if (r.lack_of_fit?.reason) tables.append(element("p", { class: "fine" }, `Lack of fit not tested: ${r.lack_of_fit.reason}.`));
  }

  function update(keys) {
    if (!keys.has("quantity")) return;
    picker.select.value = shown();
    fillTables();
  }

  return { open, update };
})();
