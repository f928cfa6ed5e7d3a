// What the laws of service do: written by Python and readable without JavaScript; moved here from below the views, with
// pictures of one response: how it is distributed, and what causes its variance.
"use strict";

rsmkit.uncertainty = (function () {
  const { element, section, choice, number } = rsmkit.format;
  const HEIGHT = 300;
  let found, shown;
  const chosen = { where: "sobol" };

  function open() {
    const written = document.getElementById("service");
    if (!written) return;
    rsmkit.views.add(written);
    found = rsmkit.data.uncertainty;
    const names = Object.keys(found?.responses ?? {});
    if (!names.length) return;
    shown = names[0];
    const redraw = () => rsmkit.charts.update(new Set(["service"]));
    const picker = choice("Response", names.map((name) => [name, titleOf(name)]), shown, (name) => { shown = name; redraw(); });
    const space = choice("Causes", [["sobol", "under the laws"], ["sobol_box", "with every value in the bounds alike"]], chosen.where,
      (where) => { chosen.where = where; redraw(); });
    const [curve, causes] = [[distribution, "Distribution in service"], [shares, "What causes the variance (Sobol indices)"]].map(([plot, title]) => {
      const host = element("div");
      rsmkit.charts.add(host, { plot, keys: ["service"] });
      return element("div", { class: "picture" }, element("h3", {}, title), host);
    });
    section("in-service", "Each response in service", element("div", { class: "bar" }, picker, space), element("div", { class: "pair" }, curve, causes),
      element("p", { class: "fine" }, `The curve: the share of cases below each value, with the ${share(found.confidence)} interval that the surface leaves open; ` +
        "dashed: what the response must keep to. The bars: the share of the variance that a factor has a part in (dark), and that it causes alone (light)."));
  }

  const own = () => found.responses[shown];
  const titleOf = (name) => rsmkit.data.responses.find((r) => r.key === name)?.title ?? name;
  const share = (v) => `${number(100 * v, Math.abs(100 * v) / 100)} %`;

  // The distribution function at the probabilities that Python gives.
  function distribution() {
    const { colour } = rsmkit.charts;
    const r = own(), keys = Object.keys(r.quantiles).sort((a, b) => a - b);
    const y = keys.map(Number), x = keys.map((key) => r.quantiles[key]);
    const ends = keys.map((key) => r.quantile_intervals[key] ?? [null, null]);
    const limits = [["low", "least"], ["high", "most"]].filter(([key]) => Number.isFinite(r.specification?.[key]))
      .map(([key, text]) => ({ kind: "rule", x: r.specification[key], colour: colour("now"), text }));
    const side = (i) => ({ kind: "line", x: ends.map((pair) => pair[i]), y, colour: colour("soft"), width: 1, dash: "2 3" });
    return { label: `Distribution of ${titleOf(shown)}`, height: HEIGHT, x: { title: titleOf(shown) }, y: { title: "share of cases below", low: 0, high: 1 },
      marks: [...limits, side(0), side(1), { kind: "line", x, y, colour: colour("accent") },
        { kind: "dots", x, y, colour: colour("accent"), size: 3, texts: keys.map((key, i) => `${share(y[i])} of cases below ${number(x[i], Math.abs(x[i]) / 1e3)}` +
          (ends[i][0] === null ? "" : ` (${number(ends[i][0])} … ${number(ends[i][1])})`)) }] };
  }

  function shares() {
    const { colour } = rsmkit.charts;
    const rows = Object.entries(own()[chosen.where] ?? {}).sort(([, a], [, b]) => a.total - b.total);
    const names = rows.flatMap(([name]) => ["", name]);
    const lengths = rows.flatMap(([, s]) => [s.first, s.total]);
    const words = rows.flatMap(([name, s]) => [`${name} alone: ${share(s.first)} (${share(s.first_low)} … ${share(s.first_high)})`,
      `${name}, with others: ${share(s.total)} (${share(s.low)} … ${share(s.high)})`]);
    return { label: `What causes the variance of ${titleOf(shown)}`, height: Math.max(160, 60 + 34 * rows.length),
      x: { title: "share of the variance", low: 0 }, y: { names },
      marks: [{ kind: "bars", lengths, texts: words, colours: rows.flatMap(() => [colour("band"), colour("accent")]) }] };
  }

  return { open };
})();
