// Trade-off: fronts of the searches with several objectives, with what the true runs say of them.
"use strict";

rsmkit.pareto = (function () {
  const { element, svg, section, choice, announce, number } = rsmkit.format;
  const HEIGHT = 430;
  const VERIFIED = "#a259d9";
  let data, state;
  let count = 0;

  function open() {
    ({ data, state } = rsmkit);
    for (const search of data.searches.filter((s) => s.front.length > 1)) openFront(search);
  }

  const quantityOf = (key) => rsmkit.study.quantities.find((q) => q.key === key);

  const titleOf = (key) => quantityOf(key)?.title ?? key;

  function openFront(search) {
    const axes = search.minimize.map((text, i) => [String(i), titleOf(text)]);
    const shown = { x: 0, y: 1, isWide: false };
    const host = element("div");
    const points = search.front.map((candidate) => state.pointOf(candidate.factors));
    const redraw = () => rsmkit.charts.update(new Set([`front ${search.name}`]));
    const pick = (axis, i) => { shown[axis] = +i; redraw(); };
    const walk = element("input", { type: "range", min: 0, max: points.length - 1, step: 1, value: 0,
      "aria-label": `Design on the front of ${search.name}`, oninput: () => {
        const order = search.front.map((_, row) => row).sort((a, b) => search.front[a].objectives[shown.x] - search.front[b].objectives[shown.x]);
        const row = order[+walk.value];
        walk.setAttribute("aria-valuetext", search.minimize.map((key, i) => `${titleOf(key)} ${number(search.front[row].objectives[i])}`).join(", "));
        state.set({ point: points[row] });
      } });
    section(`front-${++count}`, `Pareto front: ${search.name}`,
      element("div", { class: "bar" },
        choice("across", axes, "0", (i) => pick("x", i)), choice("up", axes, "1", (i) => pick("y", i)),
        choice("Range:", [["", "the front"], ["all", "every run"]], "", (value) => { shown.isWide = value !== ""; redraw(); }),
        element("label", { class: "choice" }, "along the front ", walk),
        element("button", { type: "button", onclick: () => state.set({ brush: null }) }, "Clear brush")),
      host, rsmkit.runs.strip(),
      element("p", { class: "fine" }, `${points.length} designs of the surfaces none of which beats another in every objective. Click one to ` +
        "go there; drag a box around dots to light them up in every view. A line leads from what was predicted to what the simulator gave. " +
        "Without a mouse: the slider walks along the front, the arrow keys walk along the dots, Enter goes to a design or marks a run."),
      verifiedTable(search), ...volumes(search));
    const drawn = {};
    const paint = (at, width) => {
      Object.assign(drawn, rsmkit.plot.draw(at, width, chart(search, points, shown)), { ring: svg("circle", { class: "ring", r: 7 }) });
      drawn.box.append(drawn.ring);
      here(search, shown, drawn);
    };
    rsmkit.charts.add(host, { paint, move: () => here(search, shown, drawn), keys: ["point", "brush", `front ${search.name}`] });
  }

  // The current design among the objectives, if the page can evaluate them.
  function here(search, { x, y }, { toX, toY, ring }) {
    const [a, b] = [x, y].map((i) => quantityOf(search.minimize[i])?.value(state.point));
    ring.setAttribute("visibility", Number.isFinite(a) && Number.isFinite(b) ? "visible" : "hidden");
    if (!Number.isFinite(a) || !Number.isFinite(b)) return;
    ring.setAttribute("cx", toX(a));
    ring.setAttribute("cy", toY(b));
  }

  function brushed(search, points, found) {
    const rows = found.filter(([mark]) => mark.isFront).map(([, row]) => row);
    if (!rows.length) {
      rsmkit.runs.marking.brush(found);
      return;
    }
    state.set({ brush: { search: search.name, rows, points: rows.map((row) => points[row]) } });
    announce(`${rows.length} designs brushed`);
  }

  const place = (factors) => data.factors.map((f) => `${f.label} ${rsmkit.format.factorValue(f, f.numeric ? factors[f.name] : f.levels.indexOf(factors[f.name]))}`);

  const objectivesIn = (search, values) => search.minimize.map((key, i) => `${titleOf(key)} ${number(values[i])}`);

  // Points of this search that were run: what was predicted of each objective, and what is true.
  const verified = (search) => (data.verification?.searches ?? []).filter((s) => s.name === search.name)
    .flatMap((s) => [s, ...(s.extremes ?? [])])
    .map((p) => ({ ...p, values: search.minimize.map((key) => p.objectives[key]) })).filter((p) => p.values.every(Boolean));

  function chart(search, points, shown) {
    const { x, y } = shown;
    const { colour } = rsmkit.charts;
    const dots = (values, texts, more) => ({ kind: "dots", x: values.map((v) => v[x]), y: values.map((v) => v[y]), texts, ...more });
    const all = [...runDots(search, shown, dots, colour), ...refined(search, dots, colour), ...front(search, points, shown, dots),
      ...failed(search, dots, colour), ...checked(search, shown, dots)];
    const range = shown.isWide ? {} : ranges(search, shown);
    return { label: `Pareto front of ${search.name}`, height: HEIGHT, x: { title: titleOf(search.minimize[x]), ...range.x }, y: { title: titleOf(search.minimize[y]), ...range.y },
      marks: shown.isWide ? all : all.map((mark) => within(mark, range)), scale: scale(search, shown), legend: true,
      pick: (mark, i) => { if (mark.isFront) state.set({ point: points[i] }); else rsmkit.runs.marking.pick(mark, i); },
      brush: (found) => brushed(search, points, found) };
  }

  // The range of the front and of what was verified, with a margin.
  function ranges(search, { x, y }) {
    const span = (i) => {
      const values = [...search.front.map((c) => c.objectives[i]), search.objectives[i],
        ...verified(search).flatMap((p) => [p.values[i].predicted, p.values[i].actual])].filter(Number.isFinite);
      const [low, high] = [Math.min(...values), Math.max(...values)], margin = 0.12 * (high - low) || Math.abs(high) / 10 || 1;
      return { low: low - margin, high: high + margin };
    };
    return { x: span(x), y: span(y) };
  }

  function within(mark, range) {
    if (mark.kind !== "dots") return mark;
    const isIn = (v, { low, high }) => v >= low && v <= high;
    return { ...mark, x: mark.x.map((v, i) => (isIn(v, range.x) && isIn(mark.y[i], range.y) ? v : null)) };
  }

  const third = (search, { x, y }) => search.minimize.map((_, i) => i).find((i) => i !== x && i !== y);

  function scale(search, shown) {
    const i = third(search, shown);
    if (i === undefined) return null;
    const own = search.front.map((c) => c.objectives[i]);
    return { title: titleOf(search.minimize[i]), low: Math.min(...own), high: Math.max(...own), colour: (share) => rsmkit.bands.css(rsmkit.bands.colour(share)) };
  }

  function front(search, points, shown, dots) {
    const { colour } = rsmkit.charts;
    const values = search.front.map((candidate) => candidate.objectives);
    const shade = scale(search, shown), i = third(search, shown);
    const rows = state.brush?.search === search.name ? new Set(state.brush.rows) : null;
    const words = (v, row) => [...objectivesIn(search, v), ...place(search.front[row].factors)].join("\n");
    return [dots(values, values.map(words), { isFront: true, name: "front of the surfaces", colour: colour("accent"), shades: shade ? [0.1, 0.5, 0.9].map(shade.colour) : undefined,
      colours: shade ? values.map((v) => shade.colour((v[i] - shade.low) / (shade.high - shade.low || 1))) : undefined,
      opacities: rows ? values.map((_, row) => (rows.has(row) ? 1 : 0.18)) : undefined }),
    dots([search.objectives], [`knee\n${objectivesIn(search, search.objectives).join("\n")}`], { name: "knee", shape: "star", size: 6, colour: "#ffdd33", edge: "#222", opacity: 1 })];
  }

  // Runs that the surfaces rest on, by what they say: beaten by none, dominated, infeasible.
  function runDots(search, shown, dots, colour) {
    const found = data.trade_offs?.[search.name];
    if (!found) return [];
    const kinds = [["infeasible", "infeasible runs", "cross", 3, "soft"], ["dominated", "dominated runs", "circle", 3, "soft"], ["best", "best runs", "diamond", 4.5, "ink"]];
    return kinds.flatMap(([kind, name, shape, size, tone]) => {
      const runs = found.state.map((s, run) => (s === kind ? run : -1)).filter((run) => run >= 0);
      if (!runs.length) return [];
      return [dots(runs.map((run) => found.objectives[run]),
        runs.map((run) => [`run ${rsmkit.runs.label(run)}, ${kind}`, ...objectivesIn(search, found.objectives[run])].join("\n")),
        { name, shape, size, runs, isHollow: true, opacity: 0.9, colour: colour(tone), colours: rsmkit.runs.colours(runs, () => colour(tone)) })];
    });
  }

  function checked(search, { x, y }, dots) {
    const known = verified(search);
    if (!known.length) return [];
    const lines = known.filter((p) => p.values.every((v) => v.actual !== null)).map((p) => ({ kind: "line", colour: VERIFIED, width: 1.2,
      x: [p.values[x].predicted, p.values[x].actual], y: [p.values[y].predicted, p.values[y].actual] }));
    return [...lines, dots(known.map((p) => p.values.map((v) => v.actual)),
      known.map((p) => [`verified, ${p.point}: ${p.verdict}`, ...search.minimize.map((key, i) => `${titleOf(key)} ${number(p.values[i].actual)} (predicted ${number(p.values[i].predicted)})`)].join("\n")),
      { name: "verified, true", shape: "square", size: 5, colour: VERIFIED, opacity: 1 })];
  }

  // Runs that failed have no objectives; they stand where the surfaces predict them.
  function failed(search, dots, colour) {
    const places = [...(data.failed ?? []), ...(data.refinements[search.name]?.failed ?? [])];
    const values = places.map((factors) => search.minimize.map((key) => quantityOf(key)?.value(state.pointOf(factors))));
    const known = values.map((v, i) => [v, places[i]]).filter(([v]) => v.every(Number.isFinite));
    if (!known.length) return [];
    return [dots(known.map(([v]) => v), known.map(([v, factors]) => ["failed run, where the surfaces predict it", ...objectivesIn(search, v), ...place(factors)].join("\n")),
      { name: "failed, as predicted", shape: "cross", size: 5, isHollow: true, colour: colour("poor"), opacity: 1 })];
  }

  function refined(search, dots, colour) {
    const found = data.refinements[search.name]?.front ?? [];
    if (!found.length) return [];
    return [dots(found.map((p) => p.objectives), found.map((p) => ["true run of the refinement", ...objectivesIn(search, p.objectives), ...place(p.factors)].join("\n")),
      { name: "front of true runs", shape: "triangle", size: 5, colour: colour("good"), opacity: 1 })];
  }

  function verifiedTable(search) {
    const known = verified(search);
    if (!known.length) return null;
    const rows = known.map((p) => element("tr", {}, element("th", { scope: "row" }, p.point),
      ...p.values.flatMap((v) => [element("td", {}, number(v.predicted)), element("td", {}, v.actual === null ? "failed" : number(v.actual))]), element("td", {}, p.verdict)));
    return element("details", {}, element("summary", {}, "Predicted against true"),
      element("div", { class: "scroller", tabindex: "0", role: "group", "aria-label": "Predicted against true" }, element("table", {},
        element("thead", {}, element("tr", {}, element("td"), ...search.minimize.flatMap((key) => [element("th", { scope: "col" }, `${titleOf(key)}, predicted`), element("th", { scope: "col" }, "true")]),
          element("th", { scope: "col" }, "verdict"))), element("tbody", {}, ...rows))));
  }

  // What the true runs dominate, wave by wave of a refinement.
  function volumes(search) {
    const found = data.refinements[search.name];
    if (!found || found.measure !== "hypervolume" || !found.waves.length) return [];
    const host = element("div");
    const ends = found.waves.map((_, w) => found.start_runs + found.waves.slice(0, w + 1).reduce((sum, wave) => sum + wave.objectives.length, 0));
    rsmkit.charts.add(host, { keys: [], plot: () => ({ label: "Hypervolume that the true runs dominate, wave by wave", height: 220,
      x: { title: "simulator runs" }, y: { title: "hypervolume" }, marks: [
        { kind: "line", x: ends, y: found.waves.map((wave) => wave.best), colour: rsmkit.charts.colour("good"), isStepped: true },
        { kind: "dots", x: ends, y: found.waves.map((wave) => wave.best), colour: rsmkit.charts.colour("good"), texts: found.waves.map((wave) => `wave ${wave.number}: ${number(wave.best)}`) }] }) });
    return [element("h3", {}, "Hypervolume per wave"), host, element("p", { class: "fine" }, rsmkit.refinement.SCALE)];
  }

  return { open };
})();
