// The state that every view shares, who listens to it, and its copy in the address (a link is a design).
"use strict";

rsmkit.state = (function () {
  // point: current design; x, y: factors of the contours; quantity: key of the contour; pins: up to three designs;
  // goals: quantity key -> { goal: "min", "max", "target" or "range", low, high, target, weight, importance }; held: factors
  // that searches leave where they are; overlay: factor whose interactions are shown, or -1; brush: designs lit up;
  // corners: components of the triangle, none for the first three; view: the chosen tab, "" for the first; limits: key of a subject -> [lower, upper] where they are not the study's
  const state = { point: [], x: 0, y: 1, quantity: "", pins: [], goals: {}, overlay: -1, brush: null, view: "", limits: {}, held: [], corners: [] };
  const NUMBERS = ["low", "high", "target", "weight", "weight_above", "importance"];
  const listeners = [];
  let factors = [];
  let study = "";  // the goals of the study, as text
  let pending = null;
  const changed = new Set();

  function open(data) {
    factors = data.factors;
    const best = data.searches[0];
    state.point = best ? pointOf(best.factors) : middle();
    state.quantity = best?.settings?.desirability ? "desirability" : (data.objectives[0] ?? data.responses[0]).key;
    const numeric = factors.map((f, j) => j).filter((j) => factors[j].numeric);
    [state.x, state.y] = [numeric[0] ?? 0, numeric.find((j) => rsmkit.sums.areFree(numeric[0], j)) ?? numeric[1] ?? numeric[0] ?? 0];
    const tied = numeric.filter((j) => rsmkit.sums.mixtureOf(j)), process = numeric.filter((j) => !rsmkit.sums.involves(j));
    if (tied.length && process.length) [state.x, state.y] = [tied[0], process[0]];  // the triangle has the components
    state.goals = rsmkit.goals.ofStudy(data);
    study = JSON.stringify(state.goals);
    read();
    window.addEventListener("hashchange", () => { read(); notify(Object.keys(state)); });
  }

  const centre = (factor) => snap(factor, (factor.low + factor.high) / 2);

  // The middle of the space.
  const middle = () => rsmkit.data.centre?.slice() ?? factors.map(centre);

  // The point of a mapping from factor names to values.
  function pointOf(values) {
    return factors.map((f) => f.numeric ? values[f.name] : f.levels.indexOf(values[f.name]));
  }

  // Nearest value the factor may take.
  function snap(factor, value) {
    const inside = Math.min(factor.high, Math.max(factor.low, value));
    if (factor.numeric && factor.levels.length) {
      return factor.levels.reduce((a, b) => (Math.abs(b - inside) < Math.abs(a - inside) ? b : a));
    }
    return factor.continuous ? inside : Math.round(inside);
  }

  function setFactor(j, value) {
    set({ point: rsmkit.sums.moved(state.point, j, snap(factors[j], value)) });
  }

  // Changes parts of the state; views are told once per animation frame.
  function set(changes) {
    Object.assign(state, changes);
    for (const key of Object.keys(changes)) changed.add(key);
    if (pending === null) pending = requestAnimationFrame(flush);
  }

  function flush() {
    if (pending !== null) cancelAnimationFrame(pending);
    pending = null;
    const keys = [...changed];
    changed.clear();
    if (keys.length) notify(keys);
    write();
  }

  function notify(keys) {
    for (const listener of listeners) listener(new Set(keys));
  }

  // Calls the listener with the set of changed keys.
  function listen(listener) {
    listeners.push(listener);
  }

  function hash() {
    const parts = [`p=${state.point.join(",")}`, `x=${factors[state.x].name}`, `y=${factors[state.y].name}`,
      `q=${encodeURIComponent(state.quantity)}`];
    if (JSON.stringify(state.goals) !== study) {
      parts.push(`goals=${Object.entries(state.goals).map(([key, wish]) => `${[wish.goal, ...NUMBERS.map((part) => wish[part] ?? "")].join(",")}:${encodeURIComponent(key)}`).join(";") || "none"}`);
    }
    if (state.held.length) parts.push(`held=${state.held.map((j) => encodeURIComponent(factors[j].name)).join(";")}`);
    if (state.corners.length) parts.push(`t=${state.corners.map((j) => encodeURIComponent(factors[j].name)).join(";")}`);
    if (state.overlay >= 0) parts.push(`i=${encodeURIComponent(factors[state.overlay].name)}`);
    if (state.pins.length) parts.push(`pins=${state.pins.map((pin) => pin.join(",")).join(";")}`);
    const limits = Object.entries(state.limits).map(([key, ends]) => `${ends.map((v) => v ?? "").join(":")}:${encodeURIComponent(key)}`);
    if (limits.length) parts.push(`l=${limits.join(";")}`);
    if (state.view) parts.push(`v=${state.view}`);
    return `#${parts.join("&")}`;
  }

  let writing = null;
  function write() {
    clearTimeout(writing);  // browsers refuse more than about a hundred address changes per half minute
    writing = setTimeout(() => history.replaceState(null, "", hash()), 250);
  }

  // Takes over what the address says; anything malformed is ignored.
  function read() {
    const given = new URLSearchParams(location.hash.slice(1));
    const point = parsePoint(given.get("p"));
    if (point) state.point = point;
    for (const [key, short] of [["x", "x"], ["y", "y"], ["overlay", "i"]]) {
      const j = factors.findIndex((f) => f.name === given.get(short));
      if (j >= 0) state[key] = j;
    }
    if (given.get("q") === "desirability" || rsmkit.study.quantities.some((q) => q.key === given.get("q"))) {
      state.quantity = given.get("q");
    }
    if (given.get("held")) state.held = given.get("held").split(";").map((name) => factors.findIndex((f) => f.name === name)).filter((j) => j >= 0);
    if (given.get("t")) state.corners = given.get("t").split(";").map((name) => factors.findIndex((f) => f.name === name)).filter((j) => j >= 0);
    if (given.get("l")) state.limits = parseLimits(given.get("l"));
    if (/^[a-z-]+$/.test(given.get("v") ?? "")) state.view = given.get("v");
    const goals = parseGoals(given.get("goals") ?? "");
    if (Object.keys(goals).length || given.get("goals") === "none") state.goals = goals;
    if (given.get("pins")) state.pins = given.get("pins").split(";").map(parsePoint).filter(Boolean).slice(0, 3);
  }

  // Texts such as target,40,60,50,1,,2:yield, whatever is empty left out.
  function parseGoals(text) {
    const pairs = text.split(";").map((part) => part.match(/^([a-z]+)([^:]*):(.*)$/)).filter(Boolean).map(([, goal, numbers, key]) => [key, { goal,
      ...Object.fromEntries(numbers.split(",").slice(1).flatMap((v, i) => (v === "" || !NUMBERS[i] || !Number.isFinite(+v) ? [] : [[NUMBERS[i], +v]]))) }]);
    return Object.fromEntries(pairs.filter(([key, { goal }]) => ["min", "max", "target", "range"].includes(goal) &&
      rsmkit.study.quantities.some((q) => q.key === key)));
  }

  // Texts such as 8:15:rate, low or high empty for none.
  function parseLimits(text) {
    const found = text.split(";").map((part) => part.match(/^([^:]*):([^:]*):(.*)$/)).filter(Boolean)
      .map(([, low, high, key]) => [key, [low, high].map((v) => (v === "" ? null : Number(v)))]);
    return Object.fromEntries(found.filter(([key, ends]) => ends.every((v) => v === null || Number.isFinite(v)) &&
      rsmkit.study.subjects.some((subject) => subject.key === key)));
  }

  function parsePoint(text) {
    const values = (text ?? "").split(",").map(Number);
    if (!text || values.length !== factors.length || values.some((v) => !Number.isFinite(v))) return null;
    return rsmkit.sums.repaired(values.map((value, j) => snap(factors[j], value)));
  }

  return Object.assign(state, { open, set, setFactor, flush, listen, hash, pointOf, snap, centre, middle });
})();
