// How well the surface of one quantity fits: effects, observed against predicted, residuals, tables.
"use strict";

rsmkit.fit = (function () {
  const { element, section, choice, number } = rsmkit.format;
  let data, study, state, picker, tables, effects, parity, residuals;

  function open() {
    ({ data, study, state } = rsmkit);
    const known = study.quantities.filter((q) => data.reports[q.key]);
    picker = choice("Surface of", known.map((q) => [q.key, q.title]), shown(), (key) => state.set({ quantity: key }));
    [effects, parity, residuals] = [0, 1, 2].map(() => element("div"));
    tables = element("div");
    section("fit", "How well it fits", element("div", { class: "bar" }, picker),
      element("div", { class: "trio" },
        element("div", {}, element("h3", {}, "Effects (t values)"), effects),
        element("div", {}, element("h3", {}, "Observed against predicted"), parity),
        element("div", {}, element("h3", {}, "Studentised residuals"), residuals)),
      tables);
    rsmkit.charts.add(effects, { plot: effectsChart, keys: ["quantity"] });
    rsmkit.charts.add(parity, { plot: parityChart, keys: ["quantity"] });
    rsmkit.charts.add(residuals, { plot: residualChart, keys: ["quantity"] });
    fillTables();
  }

  // The quantity chosen for the contours, or the first response when that one has no surface of its own.
  const shown = () => (data.reports[state.quantity] ? state.quantity : data.responses[0].key);

  const report = () => data.reports[shown()];

  function effectsChart() {
    const terms = (report().terms ?? []).filter((term) => term.name !== "1" && term.t !== null)
      .sort((a, b) => Math.abs(a.t) - Math.abs(b.t)).slice(-24);
    const { colour } = rsmkit.charts;
    return { label: "Effects: coefficients over their standard errors", height: Math.max(300, 60 + 22 * terms.length),
      x: { title: "t" }, y: { names: terms.map((t) => t.name) },
      marks: [{ kind: "bars", lengths: terms.map((t) => t.t), colours: terms.map((t) => colour(t.p < 0.05 ? "accent" : "line")),
        texts: terms.map((t) => `${t.name}: t = ${number(t.t)}, p ${probability(t.p)}`) }] };
  }

  function parityChart() {
    const { observed = [], fitted = [] } = report().diagnostics;  // not every kind of surface has them
    const known = [...observed, ...fitted].filter((v) => v !== null);
    const ends = known.length ? [Math.min(...known), Math.max(...known)] : [];
    return { label: "Observed against predicted", height: 300, x: { title: "predicted" }, y: { title: "observed" }, marks: [
      { kind: "line", x: ends, y: ends, colour: rsmkit.charts.colour("soft"), width: 1, dash: "2 3" }, dots(fitted, observed)] };
  }

  function residualChart() {
    const { fitted = [], studentised = [] } = report().diagnostics;
    return { label: "Residuals against predicted", height: 300, x: { title: "predicted" }, y: { title: "residual / its standard error" },
      marks: [{ kind: "rule", y: 0, colour: rsmkit.charts.colour("soft"), dash: "none" }, dots(fitted, studentised)] };
  }

  function dots(x, y) {
    return { kind: "dots", x, y, colour: rsmkit.charts.colour("accent"),
      texts: x.map((v, i) => `run ${i + 1}: ${number(v)}, ${number(y[i])}`) };
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
