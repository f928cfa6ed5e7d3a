// Goals for several quantities, combined into one desirability between 0 and 1 (Derringer & Suich 1980), with Python's
// formulas; those of the study's first search to begin with. What is in range counts as a limit and not in the mean.
"use strict";

rsmkit.goals = (function () {
  const { element, section, typed, announce } = rsmkit.format;
  const GOALS = [["", "no goal"], ["min", "minimise"], ["max", "maximise"], ["target", "hit a target"], ["range", "keep in range"]];
  const NUMBERS = [["low", "low"], ["target", "target"], ["high", "high"], ["weight", "weight"], ["importance", "importance"]];
  const STUDY = { minimize: "min", maximize: "max", target: "target" };
  let rows = [], status, searcher, table;

  // The goals of a study's first search that the page can evaluate.
  function ofStudy(data) {
    const search = data.searches[0];
    const known = (key) => rsmkit.study.quantities.some((q) => q.key === key);
    if (!search) return {};
    const wished = Object.entries(search.settings?.desirability ?? {}).filter(([key]) => known(key))
      .map(([key, wish]) => [key, { ...wish, goal: STUDY[wish.goal] }]);
    return Object.fromEntries(wished.length ? wished : search.minimize.filter(known).map((key) => [key, { goal: "min" }]));
  }

  // A goal with everything it leaves out: the scale is then the range of the quantity over the box.
  function full(quantity) {
    const given = rsmkit.state.goals[quantity.key];
    const [low, high] = quantity.range;
    const made = { low, high, weight: 1, importance: 1, ...Object.fromEntries(Object.entries(given).filter(([, v]) => v !== null && v !== undefined)) };
    return { ...made, target: made.target ?? (made.low + made.high) / 2, above: made.weight_above ?? made.weight };
  }

  const wishes = () => rsmkit.study.quantities.filter((q) => rsmkit.state.goals[q.key]?.goal);

  const ramp = (rise) => Math.min(1, Math.max(0, rise));

  // How far a value has risen from what is unacceptable, 0, to what is wished, 1, and the exponent of that; on both sides it goes on.
  function rising({ goal, low, high, target, weight, above }, value) {
    if (goal === "range") return { rise: Math.min(value - low, high - value) / (high - low), exponent: 1 };
    if (goal === "max") return { rise: (value - low) / (high - low), exponent: weight };
    if (goal === "min") return { rise: (high - value) / (high - low), exponent: weight };
    return value < target ? { rise: (value - low) / (target - low), exponent: weight } : { rise: (high - value) / (high - target), exponent: above };
  }

  // Desirability of one value, 0 to 1.
  function single(wish, value) {
    if (wish.goal === "range") return Number(value >= wish.low && value <= wish.high);
    const { rise, exponent } = rising(wish, value);
    return ramp(rise) ** exponent;
  }

  // Geometric mean of all, weighted by importance.
  function desirability(point) {
    const told = wishes().map((quantity) => [full(quantity), quantity.value(point)]);
    const total = told.reduce((sum, [wish]) => sum + (wish.goal === "range" ? 0 : wish.importance), 0) || 1;
    return told.reduce((product, [wish, value]) => product * single(wish, value) ** (wish.goal === "range" ? 1 : wish.importance / total), 1);
  }

  // Desirability as one more quantity, for the profiler.
  const quantity = () => ({ key: "desirability", title: "desirability", value: desirability, interval: () => [NaN, NaN],
    values: rsmkit.models.along(desirability), intervals: (point, j, values) => values.map(() => [NaN, NaN]), intervalsAt: (points) => points.map(() => [NaN, NaN]),
    observed: rsmkit.data.points.map(() => null), range: [0, 1] });

  function open() {
    const { quantities } = rsmkit.study;
    if (!quantities.length) return;
    rows = quantities.map(row);
    status = element("span", { class: "fine", role: "status" });
    searcher = element("button", { type: "button", onclick: find }, "Find the best design");
    const head = ["", "goal", ...NUMBERS.map(([, word]) => word), "desirability"];
    section("goals", "Goals",
      element("div", { class: "bar" }, searcher,
        element("button", { type: "button", onclick: () => rsmkit.state.set({ goals: ofStudy(rsmkit.data) }) }, "Goals of the study"), status),
      element("div", { class: "scroller", tabindex: "0", role: "group", "aria-label": "Goals" },
        table = element("table", { class: "goals" },
          element("thead", {}, element("tr", {}, ...head.map((text) => (text ? element("th", { scope: "col" }, text) : element("td"))))),
          element("tbody", {}, ...rows.map(({ line }) => line)))),
      element("p", { class: "fine" }, "Desirability rises from 0 at one end of the scale (low to high) to 1 at the other, or at the target; weights are " +
        "exponents, above 1 only values near the goal please. All are combined by their geometric mean, weighted by importance. The search keeps every " +
        "limit and every factor that is held."));
    update(new Set(["goals", "point"]));
  }

  function row(quantity) {
    const change = (part, value) => {
      const goals = { ...rsmkit.state.goals, [quantity.key]: { ...rsmkit.state.goals[quantity.key], [part]: value } };
      if (part === "goal" && !value) delete goals[quantity.key];
      if (part === "weight") delete goals[quantity.key].weight_above;
      rsmkit.state.set({ goals });
    };
    const pick = element("select", { "aria-label": `Goal for ${quantity.title}`, onchange: (event) => change("goal", event.target.value) },
      ...GOALS.map(([value, text]) => element("option", { value }, text)));
    const fields = NUMBERS.map(([part, word]) => {
      const input = element("input", { type: "number", step: "any", "aria-label": `${word} for ${quantity.title}`,
        onchange: () => change(part, input.value === "" ? null : +input.value) });
      return { part, word, input };
    });
    const value = element("td", { "data-word": "desirability" });
    return { quantity, pick, fields, value, line: element("tr", {}, element("th", { scope: "row" }, quantity.title), element("td", {}, pick),
      ...fields.map(({ word, input }) => element("td", { "data-word": word }, input)), value) };
  }

  const isUsed = (goal, part) => Boolean(goal) && (part === "target" ? goal === "target" : goal !== "range" || part === "low" || part === "high");

  // What is wrong with a goal, in words; empty if nothing.
  function fault({ goal, low, high, target, weight, importance }) {
    if (!(low < high)) return "low must be below high";
    if (goal === "target" && !(low < target && target < high)) return "the target must lie between low and high";
    return weight > 0 && importance > 0 ? "" : "weight and importance must be positive";
  }

  function update(keys) {
    if (!rows.length || !(keys.has("goals") || keys.has("point"))) return;
    let wrong = "";
    for (const { quantity, pick, fields, value } of rows) {
      const wish = rsmkit.state.goals[quantity.key]?.goal ? full(quantity) : null;
      if (keys.has("goals")) {
        pick.value = wish?.goal ?? "";
        for (const { part, input } of fields) {
          input.hidden = !isUsed(wish?.goal, part);
          if (wish && document.activeElement !== input) input.value = typed(wish[part]);
        }
      }
      if (wish && fault(wish)) wrong = `${quantity.title}: ${fault(wish)}.`;
      value.textContent = !wish ? "" : fault(wish) ? "–" : single(wish, quantity.value(rsmkit.state.point)).toFixed(3);
    }
    table.classList.toggle("untargeted", !rows.some(({ quantity }) => rsmkit.state.goals[quantity.key]?.goal === "target"));
    searcher.disabled = Boolean(wrong) || !wishes().length;
    if (keys.has("goals") || wrong) status.textContent = wrong;
  }

  async function find() {
    status.textContent = "searching …";
    const found = await rsmkit.optimise.best(await new Promise((done) => setTimeout(() => done({}), 20)));
    rsmkit.state.set({ point: found.point });
    status.textContent = found.isFeasible ? `Found: ${found.words}.` : `No design keeps every limit; this one misses least: ${found.words}.`;
    announce(status.textContent);
  }

  return { ofStudy, full, wishes, rising, single, desirability, quantity, open, update };
})();
