// How well the surface of one quantity fits: effects, residuals, influence, transformation, equations, tables.
"use strict";

rsmkit.fit = (function () {
  const { element, svg, section, choice, number } = rsmkit.format;
  const HEIGHT = 290;
  const MOST_BARS = 24, MOST_NAMED = 8, MOST_OPEN = 16;
  const JUDGED = { studentised: "studentised residual", deleted: "deleted (externally studentised) residual", residual: "residual" };
  const LETTER = 6.2;  // pixels
  const SOURCES = { FO: "first order (FO)", TWI: "two-factor interactions (TWI)", PQ: "pure quadratic (PQ)" };
  const FAR = 3;  // studentised residuals beyond are looked at
  const PICTURES = [
    ["effects", "Effects", effects], ["parity", "Observed against predicted", parity], ["residuals", "Residuals", residuals],
    ["leverage", "Leverage", leverage], ["cook", "Cook's distance", cook], ["power", "Power of the response (Box-Cox)", power],
  ];
  let data, study, state, picker, controls, words, unknown, tables;
  const chosen = { effects: "half_normal", judged: "studentised", against: "fitted", group: "" };

  function open() {
    ({ data, study, state } = rsmkit);
    const known = study.quantities.filter((q) => data.reports[q.key]);
    picker = choice("Surface of", known.map((q) => [q.key, q.title]), shown(), (key) => state.set({ quantity: key }));
    controls = element("div", { class: "bar" });
    words = element("div");
    tables = element("div", { class: "folded" });
    unknown = element("p", { class: "fine" });
    section("fit", "How well it fits", element("div", { class: "bar" }, picker), words, controls, rsmkit.runs.strip(),
      element("div", { class: "trio" }, ...PICTURES.map(([id, title, draw]) => {
        const host = element("div");
        rsmkit.charts.add(host, { paint: (at, width) => paint(at, width, draw), keys: ["quantity", "brush", "fit"] });
        return element("div", { id: `fit-${id}`, class: "picture" }, element("h3", {}, title), host);
      })), unknown, tables);
    fill();
  }

  // The quantity chosen for the contours, or the first one that has a surface of its own.
  const shown = () => (data.reports[state.quantity] ? state.quantity : data.responses[0].key);
  const report = () => data.reports[shown()];
  const fit = () => data.fits[shown()];
  const column = (name) => fit().columns[name];
  const colour = (name) => rsmkit.charts.colour(name);
  const redraw = () => rsmkit.charts.update(new Set(["fit"]));

  function paint(host, width, draw) {
    const { marks, names = [], missing: isMissing, ...rest } = draw();
    if (isMissing) return;
    const { toX, toY, box } = rsmkit.plot.draw(host, width, { height: HEIGHT, marks, ...rest, ...rsmkit.runs.marking });
    const taken = rulesOf(marks, toY, width);  // a name that would lie on another is left to the pointer
    for (const [x, y, text] of names) {
      const right = width - toX(x) - 16, isLeft = LETTER * text.length > right && toX(x) - 46 > right;
      const told = rsmkit.plot.cut(text, (isLeft ? toX(x) - 46 : right) / LETTER), long = LETTER * told.length;
      const place = { x: toX(x) + (isLeft ? -7 : 7), y: toY(y) - 5 };
      const from = isLeft ? place.x - long : place.x;
      if (taken.some(([left, end, at]) => from < end + 4 && from + long > left - 4 && Math.abs(at - place.y) < 12)) continue;
      taken.push([from, from + long, place.y]);
      box.append(svg("text", { ...place, "text-anchor": isLeft ? "end" : "start", class: "named" }, told));
    }
  }

  // Where the words at the rules stand: [left, right, height].
  const rulesOf = (marks, toY, width) => marks.filter(({ kind, y, text }) => kind === "rule" && y !== undefined && text)
    .map(({ y, text, isAtStart }) => (isAtStart ? [0, 60 + LETTER * text.length, toY(y) - 4] : [width - 20 - LETTER * text.length, width, toY(y) - 4]));

  const missing = { missing: true };  // what this kind of surface does not know

  // ---- dots of runs

  const flagged = () => new Map((fit().flagged ?? []).map((item) => [item.run, item]));

  function ownColour() {
    const group = chosen.group && column(`group ${chosen.group}`), levels = group ? [...new Set(group)] : [];
    const bad = flagged(), { PALETTE } = rsmkit.runs;
    return (i) => (group ? PALETTE[levels.indexOf(group[i]) % PALETTE.length] : bad.has(i) ? colour("poor") : colour("accent"));
  }

  function dots(x, y, say) {
    const runs = column("runs");
    return { kind: "dots", x, y, runs, colours: rsmkit.runs.colours(runs, ownColour()), opacity: 0.85,
      texts: column("labels").map((label, i) => `run ${label}: ${say(i)}${chosen.group ? `, ${chosen.group} ${column(`group ${chosen.group}`)[i]}` : ""}`) };
  }

  const short = (v) => number(v, Math.abs(v) / 1e3);

  // Names of the flagged rows beside their dots.
  const namesOf = (x, y) => [...flagged().keys()].filter((i) => Number.isFinite(x[i]) && Number.isFinite(y[i]))
    .map((i) => [x[i], y[i], `run ${column("labels")[i]}`]);

  const limit = (place, text = "") => ({ kind: "rule", y: place, colour: colour("now"), text });

  // The place of each run in time where that is known, else in the data.
  const inOrder = () => column("order") ?? column("labels").map((_, i) => i + 1);
  const orderTitle = () => (column("order") ? "run order" : "run, in the order of the data");

  // ---- pictures

  function parity() {
    const observed = column("observed"), fitted = column("fitted");
    if (!observed || !fitted) return missing;
    const all = [...observed, ...fitted].filter((v) => v !== null);
    const ends = [Math.min(...all), Math.max(...all)];
    return { label: "Observed against predicted", x: { title: "predicted" }, y: { title: "observed" }, names: namesOf(fitted, observed),
      marks: [{ kind: "line", x: ends, y: ends, colour: colour("soft"), width: 1, dash: "2 3" },
        dots(fitted, observed, (i) => `observed ${short(observed[i])}, predicted ${short(fitted[i])}`)] };
  }

  function residuals() {
    const values = column(chosen.judged) ?? column("residual");
    if (!values) return missing;
    const judged = column(chosen.judged) ? chosen.judged : "residual";
    const [x, axis] = across(values);
    if (!x) return missing;
    const far = judged === "deleted" ? fit().limits?.deleted : judged === "studentised" ? FAR : null;
    const rules = far ? [limit(far), limit(-far, judged === "deleted" ? "outlier beyond (Bonferroni, 5 %)" : "")] : [];
    return { label: `${JUDGED[judged]} against ${axis.title}`, x: axis, y: { title: JUDGED[judged] }, names: namesOf(x, values),
      marks: [{ kind: "rule", y: 0, colour: colour("soft"), dash: "none" }, ...rules,
        dots(x, values, (i) => `${JUDGED[judged]} ${short(values[i])}, ${axis.title} ${axis.names ? axis.names[x[i]] : short(x[i])}`)] };
  }

  // What residuals are drawn against: values by run, and the axis.
  function across() {
    if (chosen.against === "fitted") return [column("fitted"), { title: "predicted" }];
    if (chosen.against === "order") return [inOrder(), { title: orderTitle() }];
    if (chosen.against === "normal") return [column("quantiles"), { title: "normal quantile" }];
    const j = data.factors.findIndex((f) => f.name === chosen.against), factor = data.factors[j];
    const x = column("runs").map((run) => (run < 0 ? null : data.points[run][j]));
    return [x, { title: factor.title, names: factor.numeric ? null : factor.levels }];
  }

  function leverage() {
    const values = column("leverage");
    if (!values || !fit().limits) return missing;
    const far = fit().limits.leverage;
    return { label: "Leverage of each run", x: { title: orderTitle() }, y: { title: "leverage", low: 0, high: 1.04 },
      names: namesOf(inOrder(), values),
      marks: [...(far <= 1 ? [limit(far, "three times the mean")] : []), dots(inOrder(), values, (i) => `leverage ${short(values[i])}`)] };
  }

  function cook() {
    const values = column("cooks_distance");
    if (!values || !fit().limits) return missing;
    const far = fit().limits.cooks_distance, most = Math.max(...values.filter(Number.isFinite), 0);
    return { label: "Cook's distance of each run", x: { title: orderTitle() },
      y: { title: "Cook's distance", low: 0, high: 1.08 * Math.max(most, far > 2 * most ? 0 : far) || 1 }, names: namesOf(inOrder(), values),
      marks: [...(far !== null && far <= 2 * most ? [limit(far, "influential beyond")] : []),
        dots(inOrder(), values, (i) => `Cook's distance ${short(values[i])}${far > 2 * most ? ` (influential beyond ${short(far)})` : ""}`)] };
  }

  function effects() {
    const found = fit().effects;
    if (!found?.names.length) return missing;
    const { names, sizes, unit, error, limit: least } = found;
    const isLarge = (i) => least !== null && Math.abs(sizes[i]) > least;
    const colours = sizes.map((_, i) => (isLarge(i) ? colour("accent") : colour("soft")));
    const texts = names.map((term, i) => `${term}: ${unit} = ${short(sizes[i])}`);
    const order = sizes.map((_, i) => i).sort((a, b) => Math.abs(sizes[b]) - Math.abs(sizes[a]));
    if (chosen.effects === "bars") {
      const kept = order.slice(0, MOST_BARS).reverse();
      const rules = least === null ? [] : [least, -least].map((x) => ({ kind: "rule", x, colour: colour("now") }));
      return { label: `Largest effects of ${names.length}`, height: Math.max(HEIGHT, 56 + 20 * kept.length), x: { title: unit }, y: { names: kept.map((i) => names[i]) },
        marks: [...rules, { kind: "bars", lengths: kept.map((i) => sizes[i]), colours: kept.map((i) => colours[i]), texts: kept.map((i) => texts[i]) }] };
    }
    const isHalf = chosen.effects === "half_normal";
    const x = found[chosen.effects], y = isHalf ? sizes.map(Math.abs) : sizes;
    const ends = [isHalf ? 0 : Math.min(...x), Math.max(...x)];
    const marks = [...(error === null ? [] : [{ kind: "line", x: ends, y: ends.map((v) => v * error), colour: colour("soft"), width: 1, dash: "2 3" }]),
      ...(least === null ? [] : [{ ...limit(least, "p = 0.05"), isAtStart: true }, ...(isHalf ? [] : [limit(-least)])]),
      { kind: "dots", x, y, colours, texts, opacity: 0.9 }];
    const named = order.slice(0, MOST_NAMED).filter((i) => least === null || isLarge(i));
    return { label: `${isHalf ? "Half-normal" : "Normal"} plot of the effects`, marks, names: named.map((i) => [x[i], y[i], names[i]]),
      x: { title: `${isHalf ? "half-normal" : "normal"} quantile`, ...(isHalf ? { low: 0 } : {}) }, y: { title: isHalf ? `|${unit}|` : unit, ...(isHalf ? { low: 0 } : {}) } };
  }

  function power() {
    const found = report().box_cox, least = fit().box_cox_limit;
    if (!found?.curve) return missing;
    const line = (x, text, dash) => (x === null ? [] : [{ kind: "rule", x, colour: colour("soft"), dash, text }]);
    const scale = fit().kind === "box-cox" ? "further power (1: transformed enough)" : "power (1: as it is, 0: logarithm)";
    return { label: `Box-Cox: best power ${short(found.power)}`, x: { title: scale }, y: { title: "residual sum of squares", isLog: found.curve.sse.every((v) => v > 0) },
      marks: [{ kind: "line", x: found.curve.power, y: found.curve.sse, colour: colour("accent") },
        { kind: "dots", x: found.curve.power, y: found.curve.sse, colour: colour("accent"), size: 2.5, texts: found.curve.power.map((p, i) => `power ${p}: ${short(found.curve.sse[i])}`) },
        ...(least === null || least === undefined ? [] : [{ ...limit(least, "95 % interval below"), isAtStart: found.power > 0 }]),
        ...line(found.power, `best ${short(found.power)}`, "none"), ...[found.low, found.high].flatMap((v) => (v >= found.curve.power[0] && v <= found.curve.power.at(-1) ? line(v, "", "2 3") : []))] };
  }

  // ---- words and tables

  function fill() {
    const option = (key) => (value) => { chosen[key] = value; redraw(); };
    const groups = fit().groups ?? [];
    if (!groups.includes(chosen.group)) chosen.group = "";
    const known = Object.entries(JUDGED).filter(([key]) => column(key));
    const against = [["fitted", "predicted"], ["order", "run order"], ...(column("quantiles") ? [["normal", "normal quantiles"]] : []),
      ...data.factors.map((f) => [f.name, f.label])];
    controls.replaceChildren(...[
      fit().effects?.names.length ? choice("Effects as", [["half_normal", "half-normal plot"], ["normal", "normal plot"], ["bars", "bars"]], chosen.effects, option("effects")) : null,
      known.length > 1 ? choice("Residuals:", known, chosen.judged, option("judged")) : null,
      choice(known.length > 1 ? "against" : "Residuals against", against, chosen.against, option("against")),
      groups.length ? choice("Colours:", [["", "none"], ...groups.map((name) => [name, name])], chosen.group, option("group")) : null].filter(Boolean));
    fillWords();
    fillUnknown();
    fillTables();
  }

  // Leaves out what is not known of this surface, and says so in one sentence.
  function fillUnknown() {
    const absent = PICTURES.filter(([, , draw]) => draw().missing);
    for (const [id] of PICTURES) document.getElementById(`fit-${id}`).hidden = absent.some(([other]) => other === id);
    const names = absent.map(([, title]) => title).join(", "), why = report().box_cox?.reason;
    unknown.textContent = !absent.length ? "" : fit().limits ? `Not shown: ${names}${why ? ` (${why})` : ""}.`
      : `Not shown of this surface (${fit().kind}): ${names}. These are for polynomials of independent runs.`;
  }

  function fillWords() {
    const r = report(), found = fit().flagged ?? [];
    const parts = [];
    if (r.note) parts.push(element("p", { class: "fine" }, `${r.note}.`));
    if (fit().limits && !found.length) parts.push(element("p", {}, "No run stands out: no outlier, no influential run, none of high leverage."));
    if (found.length) {
      parts.push(element("ul", { class: "flagged" }, ...found.map((item) => element("li", {},
        element("button", { type: "button", class: "small", onclick: () => rsmkit.runs.toggle(column("runs")[item.run]) }, `run ${column("labels")[item.run]}`),
        ` ${item.reasons.join(", ")}: observed ${short(column("observed")[item.run])}, predicted ${short(column("fitted")[item.run])}` +
        (item.p !== null && item.reasons.includes("outlier") ? `, p ${item.p < 0.0001 ? "" : "= "}${probability(item.p)} among all runs` : "")))));
    }
    words.replaceChildren(...parts);
  }

  function table(caption, head, rows, kind = null) {
    return element("div", { class: "scroller tall", tabindex: "0", role: "group", "aria-label": caption },
      element("table", { class: kind }, element("caption", {}, caption),
        element("thead", {}, element("tr", {}, ...head.map((text) => (text ? element("th", { scope: "col" }, text) : element("td"))))),
        element("tbody", {}, ...rows.map(([name, ...cells]) => element("tr", {}, element("th", { scope: "row" }, name),
          ...cells.map((cell) => element("td", {}, cell)))))));
  }

  const fold = (title, isOpen, ...children) => element("details", { open: isOpen }, element("summary", {}, title), ...children);

  const probability = (p) => (p === null || p === undefined ? "–" : p < 0.0001 ? "< 0.0001" : p.toFixed(4));

  function fillTables() {
    const r = report(), parts = [];
    const summary = [["R²", r.r2], ["R² adjusted", r.r2_adjusted], ["R² predicted", r.r2_predicted], ["σ", r.sigma],
      ["PRESS", r.press], ["leave-one-out error", r.rmse_loo], ["runs", r.runs], ["degrees of freedom left", r.df]]
      .filter(([, value]) => value !== undefined);
    parts.push(fold(`Summary (${r.model})`, true, table("", ["", "value"], summary.map(([name, value]) => [name, number(value, Math.abs(value) / 1e4)]))));
    if (r.terms) {
      parts.push(fold(`Coefficients: ${r.terms.length} terms in ${r.units === "proportions" ? r.units : `${r.units} units`}`, r.terms.length <= MOST_OPEN,
        table("", ["term", "estimate", "std. error", "95 % interval", "t", "p"],
          r.terms.map((t) => [t.name, number(t.estimate, t.std_error), number(t.std_error, Math.abs(t.std_error) / 10),
            `${number(t.low, t.std_error)} … ${number(t.high, t.std_error)}`, number(t.t, 0.01), probability(t.p)]))));
    }
    if (r.anova) {
      parts.push(fold("Analysis of variance (sequential)", Object.keys(r.anova).length <= MOST_OPEN, table("", ["source", "df", "sum of squares", "mean square", "F", "p"],
        Object.entries(r.anova).map(([source, row]) => [SOURCES[source] ?? source, String(row.df), number(row.ss), number(row.ms), number(row.F), probability(row.p)])),
        r.lack_of_fit?.reason ? element("p", { class: "fine" }, `Lack of fit not tested: ${r.lack_of_fit.reason}.`) : null));
    }
    parts.push(fold("Equation, to copy", (r.terms?.length ?? 0) <= MOST_OPEN, rsmkit.equations.panel(fit(), r, shown())));
    const compared = fit().comparison;
    if (compared) {
      parts.push(fold("Why this model", compared.rows.length > 1, element("p", {}, compared.reason),
        compared.rows.length > 1 ? table("Models compared by their error at runs left out", ["model", "error", ""],
          compared.rows.map((row) => [row.model, number(row.rmse_loo), row.remark]), "remarks") : null,
        compared.note ? element("p", { class: "fine" }, `${compared.note}.`) : null));
    }
    tables.replaceChildren(...parts);
  }

  function update(keys) {
    if (!keys.has("quantity")) return;
    picker.select.value = shown();
    fill();
  }

  return { open, update };
})();
