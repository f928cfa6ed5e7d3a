// The current design, always in sight on a desk: its factors to set, what the surfaces predict there, what it breaks.
"use strict";

rsmkit.current = (function () {
  const { element, svg, number, measured, halfWidth, factorValue } = rsmkit.format;
  let known = [];
  let data, study, state, badge, ran, standing, overall;
  let controls = [], predictions = [];

  function open() {
    ({ data, study, state } = rsmkit);
    badge = element("p", { class: "badge", role: "status", hidden: true }, element("b", {}, "extrapolating"),
      element("span", {}, ": the surfaces know less here than at any of the runs they were fitted to; trust neither value nor interval."));
    known = trueRuns();
    ran = element("p", { class: "fine", hidden: true });
    standing = element("p", { class: "standing" });
    overall = element("p", {}, element("i", {}, "overall desirability"), element("b"));
    document.getElementById("current").append(
      element("h2", { id: "current-title" }, "Current design"),
      element("div", { class: "bar" },
        ...data.searches.map((search) => button(`Optimum ${search.name}`, () => state.pointOf(search.factors))),
        ...Object.entries(data.refinements).map(([name, found]) => button(`Refined ${name}`, () => state.pointOf(found.factors))),
        button("Centre", state.middle)),
      element("div", { class: "controls" }, ...data.factors.map((_, j) => control(j))),
      element("div", { class: "predictions" }, ...study.quantities.map(prediction), overall), standing, ran, badge);
    update(new Set(["point"]));
  }

  // Every true run: { point, values } with the responses where the page has them. Runs of the design, verified optima, runs of
  // refinements.
  function trueRuns() {
    const made = data.points.map((point, i) => ({ point, values: new Map(data.responses.map((r) => [r.key, r.observed[i]])) }));
    const confirmed = (data.verification?.searches ?? []).flatMap((search) => [search, ...(search.extremes ?? [])])
      .map(({ factors, responses }) => ({ factors, values: Object.entries(responses ?? {}).map(([key, { actual }]) => [key, actual]) }));
    const refined = Object.values(data.refinements).flatMap((found) => [{ factors: found.factors, values: Object.entries(found.responses ?? {}) },
      ...found.waves.flatMap((wave) => wave.runs ?? []).map((factors) => ({ factors, values: [] }))]);
    return [...made, ...[...confirmed, ...refined].filter(({ factors }) => factors)
      .map(({ factors, values }) => ({ point: state.pointOf(factors), values: new Map(values) }))];
  }

  // The true runs at a place, which know more than any surface about it, wherever it lies.
  const runsAt = (point) => known.filter((run) => run.point.every((v, j) => {
    const { low, high } = data.factors[j];
    return Math.abs(v - point[j]) <= 1e-4 * (high - low);
  }));

  // What they gave, on average, and which limits that breaks.
  function truth(runs) {
    const means = new Map(data.responses.map(({ key }) => {
      const values = runs.map((run) => run.values.get(key)).filter(Number.isFinite);
      return [key, values.reduce((sum, v) => sum + v, 0) / values.length];
    }));
    const told = data.responses.filter(({ key }) => Number.isFinite(means.get(key))).map(({ key, title }) => `${title} ${number(means.get(key))}`);
    const broken = rsmkit.limits.active().map((limit) => ({ text: limit.text, by: limit.sign * (limit.limit - means.get(limit.subject.key)), tolerance: limit.subject.tolerance }))
      .filter(({ by, tolerance }) => by > tolerance).map(({ text, by }) => `${text} (by ${number(by)})`);
    const made = told.length ? `The true run made here gave ${told.join(", ")}` : "A true run was made here";
    return `${made}${broken.length ? `: it breaks ${broken.join(", ")}` : ""}.`;
  }

  const button = (text, point) => element("button", { type: "button", onclick: () => state.set({ point: point() }) }, text);

  function prediction(quantity) {
    const made = { quantity, value: element("b"), interval: element("span") };
    predictions.push(made);
    return element("p", {}, element("i", { title: quantity.key }, quantity.title), made.value, made.interval);
  }

  // Holds a factor where it is while the page searches.
  function lock(j) {
    return element("button", { type: "button", class: "lock", "aria-pressed": "false", title: rsmkit.sums.involves(j) ? "Hold this factor in searches, and when others move" : "Hold this factor in searches",
      "aria-label": `Hold ${data.factors[j].label}`, onclick: () => state.set({
        held: state.held.includes(j) ? state.held.filter((i) => i !== j) : [...state.held, j] }) },
    svg("svg", { width: 11, height: 13, "aria-hidden": "true" }, svg("path", { class: "open", d: "M3 6V4a2.5 2.5 0 0 1 5 -1" }),
      svg("path", { class: "shut", d: "M3 6V4a2.5 2.5 0 0 1 5 0V6" }), svg("rect", { x: 1, y: 6, width: 9, height: 6, rx: 1 })));
  }

  function control(j) {
    const factor = data.factors[j];
    const made = { j, hold: lock(j) };
    controls.push(made);
    if (!factor.numeric) {
      made.pick = element("select", { "aria-label": factor.title, onchange: (e) => state.setFactor(j, +e.target.value) },
        ...factor.levels.map((level, i) => element("option", { value: i }, level)));
      return element("div", { class: "control pick" }, element("span", {}, made.hold, factor.title), made.pick);
    }
    const step = factor.continuous ? (factor.high - factor.low) / 200 : 1;
    made.slider = element("input", { type: "range", min: factor.low, max: factor.high, step: "any",
      "aria-label": factor.title, oninput: (e) => state.setFactor(j, +e.target.value),
      onkeydown: (event) => {  // a range with step "any" has no arrow keys of its own
        const moves = { ArrowRight: step, ArrowUp: step, ArrowLeft: -step, ArrowDown: -step,
          PageUp: 10 * step, PageDown: -10 * step };
        const ends = { Home: factor.low, End: factor.high };
        if (event.key in moves) state.setFactor(j, state.point[j] + moves[event.key]);
        else if (event.key in ends) state.setFactor(j, ends[event.key]);
        else return;
        event.preventDefault();
      } });
    made.field = element("input", { type: "number", min: factor.low, max: factor.high, step: "any",
      "aria-label": `${factor.title}, typed`, onchange: (e) => state.setFactor(j, +e.target.value) });
    return element("div", { class: "control" }, element("span", {}, made.hold, factor.title), made.field, made.slider);
  }

  function update(keys) {
    if (!["point", "limits", "goals", "held"].some((key) => keys.has(key))) return;
    const { point } = state;
    for (const { quantity, value, interval } of predictions) {
      const mean = quantity.value(point), half = halfWidth(quantity.interval(point));
      value.textContent = measured(mean, half);
      interval.textContent = !Number.isFinite(half) ? "" : half < 1e-9 * Math.abs(mean) ? "exact" : `± ${number(half, half)}`;
    }
    for (const { j, slider, field, pick, hold } of controls) {
      hold.setAttribute("aria-pressed", state.held.includes(j));
      if (pick) { pick.value = point[j]; continue; }
      const text = factorValue(data.factors[j], point[j]);
      slider.value = point[j];
      slider.setAttribute("aria-valuetext", text);
      if (document.activeElement !== field) field.value = text;
    }
    const isWished = rsmkit.goals.wishes().length > 1 || Object.values(state.goals).some((wish) => wish.goal === "target" || wish.low !== undefined);
    overall.hidden = !isWished;
    if (isWished) overall.lastChild.textContent = rsmkit.goals.desirability(point).toFixed(3);
    const runs = runsAt(point), isKnown = runs.length > 0;
    ran.hidden = !isKnown;
    ran.textContent = isKnown ? truth(runs) : "";
    badge.hidden = isKnown || study.reach(point) <= 1 + 1e-9;
    const { broken, unknown, all } = rsmkit.limits.judged(point);
    const list = (limits) => limits.map((limit) => limit.text).join(", ");
    standing.textContent = !all.length && !broken.length ? "" : broken.length
      ? `Breaks ${broken.map(({ text, margin }) => `${text} (by ${number(-margin)})`).join(", ")}.`
      : unknown.length ? `Whether it keeps ${list(unknown)} cannot be told here.` : all.length === 1 ? `Keeps ${list(all)}.` : `Keeps all ${all.length} limits.`;
    standing.classList.toggle("broken", broken.length > 0);
    standing.classList.toggle("open", !broken.length && unknown.length > 0);
  }

  return { open, update };
})();
