// The prediction profiler: every quantity against every factor through the current design, with intervals, the runs
// faded by their distance from the slice, and current values that can be dragged.
"use strict";

rsmkit.profiler = (function () {
  const { element, svg, section, choice, number, measured, halfWidth, factorValue, tick, ticks } = rsmkit.format;
  const { tenths } = rsmkit.bands;
  const OVERLAYS = ["#d97706", "#0d9488", "#a855f7", "#64748b", "#db2777"];
  const TOP = 6, SIDE = 5, PLOT = 82;
  const NAME_WIDTH = 118, GUTTER = 42, SMALLEST_CELL = 100;
  const LETTER = 5.8, LINE = 11;  // pixels
  const FADE = [[0.35, 0.9], [0.9, 0.42], [1.8, 0.14]];  // [distance in coded units, opacity]
  const INTERVALS = [["1", "one new run (95 %)"], ["0", "the mean (95 %)"], ["", "none"]];
  let grid, overlay, legend, data, study, state;
  let cells = [], names = [], feet = [], rows = [], gutters = [];
  let scales = [];  // of the rows: { low, high }
  let height = 104;  // of a cell: the plot, and one or two lines of texts below
  let samples = 43;  // points of a trace
  let every = 3;  // samples from one interval that is computed to the next
  let noise = "1", isAll = false, hasArrows = false;

  function open() {
    ({ data, study, state } = rsmkit);
    // many cells are small, and among many factors a line hardly ever passes close to a run
    [samples, every] = data.factors.length > 4 ? [25, 4] : [43, 3];
    overlay = choice("Interactions with", [["-1", "none"], ...data.factors.map((f, j) => [String(j), f.label])],
      String(state.overlay), (j) => state.set({ overlay: +j }));
    legend = element("span", { class: "fine" });
    grid = element("div", { class: "profiler" });
    const again = (change) => (value) => { change(value); rsmkit.charts.update(new Set(["profiler"])); };
    section("profiler", data.mixtures.length ? "Prediction profiler, along Cox directions" : "Prediction profiler", element("div", { class: "bar" }, overlay, legend,
      choice("Band for", INTERVALS, noise, again((value) => { noise = value; })),
      choice("Scale to", [["", "what is in sight"], ["all", "all runs"]], "", again((value) => { isAll = Boolean(value); })),
      choice("Sensitivity", [["", "off"], ["on", "arrows"]], "", again((value) => { hasArrows = Boolean(value); }))), grid,
      element("p", { class: "fine" },
        "Drag a dashed line, or set the factors of the current design. " + (data.equalities.length ? "A component of a mixture moves along its " +
        "Cox direction: the others give way in proportion, a profile ends where one of them meets a bound; components that are held stay. " : "") + "Dots are the runs, fading with their distance from the current design. " +
        "Interactions: the other profiles with the chosen factor at its ends; where they are parallel the two factors do not interact. " +
        "Sensitivity: an arrow shows which way, and how steeply, a value moves when its factor rises."));
    rsmkit.charts.add(grid, { paint, move, keys: ["point", "brush", "overlay", "goals", "profiler", ...(data.equalities.length ? ["held"] : [])] });
  }

  // Lays the cells out: as many factors side by side as fit, the rest in further bands below.
  function build(width) {
    rows = rsmkit.goals.wishes().length > 1 ? [...study.quantities, rsmkit.goals.quantity()] : study.quantities;
    scales = rows.map(() => null);
    const factors = data.factors;
    const narrow = width < 620;
    const room = width - GUTTER - (narrow ? 0 : NAME_WIDTH + 8);
    const most = Math.max(1, Math.floor(room / (SMALLEST_CELL + 8)));
    const across = Math.ceil(factors.length / Math.ceil(factors.length / most));
    const cellWidth = Math.floor(room / across - 8);
    height = TOP + PLOT + 5 + LINE * Math.max(1, ...factors.filter((f) => !f.numeric).map((factor) => rowsOf(factor, cellWidth).length));
    grid.replaceChildren();
    [cells, names, feet, gutters] = [[], [], [], []];
    for (let first = 0; first < factors.length; first += across) {
      const band = factors.slice(first, first + across).map((_, i) => first + i);
      const block = element("div", { class: "rows",
        style: `grid-template-columns:${narrow ? "" : `${NAME_WIDTH}px `}${GUTTER - 8}px repeat(${across}, minmax(0, ${cellWidth}px))` });
      rows.forEach((quantity, q) => {
        const made = { q, value: element("b"), interval: element("span") };
        names.push(made);
        block.append(element("div", { class: "row-name", style: narrow ? "grid-column:1/-1" : null },
          element("i", { title: quantity.key }, quantity.title), made.value, made.interval));
        const gutter = svg("svg", { class: "gutter", width: GUTTER - 8, height: height, "aria-hidden": "true" });
        gutters.push({ q, gutter });
        block.append(gutter, ...band.map((j) => cell(q, j, cellWidth)), ...blanks(across - band.length));
      });
      if (!narrow) block.append(element("div"));
      block.append(element("div"), ...band.map(foot), ...blanks(across - band.length));
      grid.append(block);
    }
  }

  const blanks = (count) => Array.from({ length: count }, () => element("div"));

  // Categories stand in the middle of equal shares of a cell.
  function placing(factor, width) {
    const count = factor.levels.length;
    if (!factor.numeric) return (v) => SIDE + (width - 2 * SIDE) * (v + 0.5) / count;
    return (v) => SIDE + (width - 2 * SIDE) * (v - factor.low) / (factor.high - factor.low);
  }

  function cell(q, j, width) {
    const factor = data.factors[j];
    const toX = placing(factor, width);
    const toY = (v) => TOP + PLOT - (PLOT) * (v - scales[q].low) / (scales[q].high - scales[q].low);
    const box = svg("svg", { class: "cell", width, height: height, "aria-hidden": "true" });
    const marks = factor.numeric ? [factor.low, factor.high] : factor.levels.map((_, i) => i);
    box.append(...axisTexts(factor, marks, toX, width));
    const parts = { lines: svg("path", { class: "grid" }), band: svg("path", { class: "band" }),
      runs: FADE.map(([, opacity]) => svg("path", { class: "runs", opacity })), lit: svg("path", { class: "lit-dot" }),
      others: svg("g", { class: "others" }), trace: svg("path", { class: "trace" }), now: svg("path", { class: "now" }),
      arrow: svg("path", { class: "arrow" }), grip: svg("circle", { class: "grip", r: 4.5 }) };
    // what leaves the scale is cut off at the frame
    const clip = svg("svg", { width, height: TOP + PLOT + 2 }, parts.lines, parts.band, ...parts.runs, parts.lit, parts.others, parts.trace,
      parts.now, parts.arrow);
    box.append(clip, parts.grip);
    const drag = (event) => {
      const x = event.clientX - box.getBoundingClientRect().left;
      const share = (x - SIDE) / (width - 2 * SIDE);
      state.setFactor(j, factor.numeric ? factor.low + share * (factor.high - factor.low) : share * factor.levels.length - 0.5);
    };
    box.addEventListener("pointerdown", (event) => { box.setPointerCapture(event.pointerId); drag(event); });
    box.addEventListener("pointermove", (event) => { if (box.hasPointerCapture(event.pointerId)) drag(event); });
    const places = !factor.numeric ? marks
      : Array.from({ length: samples }, (_, i) => factor.low + (factor.high - factor.low) * i / (samples - 1));
    cells.push({ q, j, toX, toY, width, places, xs: places.map((v) => tenths(toX(v))), shown: null, isPlaced: false, ...parts });
    return box;
  }

  // Ends of a numeric factor; names of levels.
  function axisTexts(factor, marks, toX, width) {
    if (factor.numeric) {
      return marks.map((v, i) => svg("text", { x: toX(v), y: TOP + PLOT + 12, "text-anchor": i ? "end" : "start" }, factorValue(factor, v)));
    }
    return rowsOf(factor, width).flatMap((row, r) => placed(row.map((v) => [factor.levels[v], toX(v)]), width).map(([level, text, x]) =>
      svg("text", { x, y: TOP + PLOT + 12 + LINE * r, "text-anchor": "middle" }, svg("title", {}, level), text)));
  }

  // Levels in as few lines as their names fit side by side in, dealt out in turn; three at most.
  function rowsOf(factor, width) {
    const dealt = (count) => Array.from({ length: count }, (_, row) => [...factor.levels.keys()].filter((v) => v % count === row));
    return [1, 2].map(dealt).find((rows) => rows.every((row) => fits(row.map((v) => factor.levels[v]), width))) ?? dealt(Math.min(3, factor.levels.length));
  }

  const fits = (names, width) => names.reduce((sum, name) => sum + (name.length + 1) * LETTER, 0) <= width;

  // Names as near to their places as they fit side by side, cut to equal shares where they do not: [name, text, place].
  function placed(names, width) {
    const long = ([name]) => name.length * LETTER;
    const fit = fits(names.map(([name]) => name), width);
    const made = names.map(([name, x]) => {
      const text = fit ? name : short(name, width / names.length / LETTER - 0.5), half = long([text]) / 2 + 1;
      return { name, text, half, x: Math.min(width - half, Math.max(half, x)) };
    });
    const apart = (a, b) => a.half + b.half + LETTER;
    for (let i = 1; i < made.length; i++) made[i].x = Math.max(made[i].x, made[i - 1].x + apart(made[i - 1], made[i]));
    for (let i = made.length - 1, end = width; i >= 0; i--) {
      made[i].x = Math.min(made[i].x, end - made[i].half);
      end = made[i].x - made[i].half - LETTER;
    }
    return made.map(({ name, text, x }) => [name, text, x]);
  }

  const known = (value) => value !== null && Number.isFinite(value);

  const short = (text, length) => (text.length > length ? `${text.slice(0, Math.max(1, Math.floor(length) - 1))}…` : text);

  function foot(j) {
    const value = element("b");
    feet.push({ j, value });
    return element("p", { class: "foot" }, element("span", {}, data.factors[j].title), value);
  }

  function paint(host, width) {
    build(width);
    explain();
    move();
    cells.forEach(light);
  }

  // Follows the current design: a profile changes only when another factor than its own has moved.
  function move() {
    const point = state.point;
    const now = rows.map((quantity) => quantity.value(point));
    for (const { q, value, interval } of names) {
      const half = halfWidth(rows[q].interval(point));
      value.textContent = measured(now[q], half);
      interval.textContent = intervalText(now[q], half);
    }
    for (const { j, value } of feet) value.textContent = factorValue(data.factors[j], point[j]);
    for (const item of cells) {
      if (item.shown && !item.shown.some((v, j) => j !== item.j && v !== point[j])) continue;
      draw(item, point);
    }
    rows.forEach((_, q) => scale(q));
    const levels = fadeLevels(point);
    for (const item of cells) {
      if (!item.isPlaced) place(item, levels[item.j]);
      mark(item, point, now[item.q]);
    }
  }

  function intervalText(mean, half) {
    if (!Number.isFinite(half)) return "";
    return half < 1e-9 * Math.abs(mean) ? "exact" : `± ${number(half, half)}`;
  }

  // Computes the profile of a cell, its band and its interactions.
  function draw(item, point) {
    const { q, j, places } = item;
    const quantity = rows[q];
    const line = rsmkit.sums.involves(j) ? rsmkit.sums.line(point, j, places.length) : null;
    if (line) Object.assign(item, { places: line.map((p) => p[j]), xs: line.map((p) => tenths(item.toX(p[j]))) });
    Object.assign(item, { shown: point, isPlaced: false, line, means: line ? line.map(quantity.value) : quantity.values(point, j, places) });
    item.ends = noise === "" ? null : ends(quantity, point, item);
    item.others.values = (state.overlay === j ? [] : overlaid()).map(({ value, colour }) => {
      const moved = rsmkit.sums.moved(point, state.overlay, value);
      return { colour, ...(line ? crossed(quantity, moved, item) : { means: quantity.values(moved, j, places) }) };
    });
  }

  // The profile of a factor in sums through another point, over amounts of its own.
  function crossed(quantity, point, { j, toX }) {
    const line = rsmkit.sums.line(point, j, samples);
    return { means: line.map(quantity.value), xs: line.map((p) => tenths(toX(p[j]))) };
  }

  // Lower and upper edge of the band; null without an interval.
  function ends(quantity, point, { j, places, line, means }) {
    const isExact = places.length !== samples;
    const computed = isExact ? places : places.filter((_, i) => i % every === 0);
    const found = line ? quantity.intervalsAt(line.filter((_, i) => i % every === 0), +noise)
      : quantity.intervals(point, j, computed, +noise);
    if (!found.every(([least, most]) => Number.isFinite(most - least))) return null;
    return [0, 1].map((side) => {
      const away = found.map((pair, i) => pair[side] - means[isExact ? i : every * i]);
      return means.map((mean, i) => mean + (isExact ? away[i] : between(away, i / every)));
    });
  }

  // Value of a smooth sequence between its members, by the cubic through the nearest four.
  function between(values, at) {
    const first = Math.min(values.length - 4, Math.max(0, Math.floor(at) - 1));
    const u = at - first;
    return -values[first] * (u - 1) * (u - 2) * (u - 3) / 6 + values[first + 1] * u * (u - 2) * (u - 3) / 2 -
      values[first + 2] * u * (u - 1) * (u - 3) / 2 + values[first + 3] * u * (u - 1) * (u - 2) / 6;
  }

  // The scale of a row: all that its profiles show, bands as far as they are no wider than these; or the range over the
  // box. It stays while everything fits and fills a fair part, so that nothing jumps while a line is dragged.
  function scale(q) {
    const own = cells.filter((item) => item.q === q);
    const [least, most] = rows[q].range;
    let low = least, high = most;
    if (!isAll && rows[q].key !== "desirability") {
      const values = own.flatMap(({ means, others }) => [...means, ...others.values.flatMap((other) => other.means)]).filter(Number.isFinite);
      if (values.length) [low, high] = [Math.min(...values), Math.max(...values)];
      const fair = Math.max(0, Math.max(0.02 * (most - least), 1e-6 * Math.max(Math.abs(low), Math.abs(high))) - (high - low)) / 2;
      [low, high] = [low - fair, high + fair];
      const reach = 0.6 * (high - low);
      const edges = own.flatMap((item) => item.ends ?? []).flat().filter(Number.isFinite);
      if (values.length && edges.length) [low, high] = [Math.max(low - reach, Math.min(low, ...edges)), Math.min(high + reach, Math.max(high, ...edges))];
    }
    const margin = 0.06 * (high - low) || Math.abs(high) * 0.05 || 1;
    const before = scales[q];
    if (before && low >= before.low && high <= before.high && high - low > 0.4 * (before.high - before.low)) return;
    scales[q] = { low: low - margin, high: high + margin };
    const marks = ticks(low - margin, high + margin, 3);
    for (const item of own) {
      item.isPlaced = false;
      item.lines.setAttribute("d", marks.map((t) => `M0 ${item.toY(t).toFixed(1)}H${item.width}`).join(""));
      item.dots = data.points.map((run, i) => (!known(rows[q].observed[i]) ? "" : `M${tenths(item.toX(run[item.j]))} ${tenths(item.toY(rows[q].observed[i]))}h0`));
    }
    for (const { gutter } of gutters.filter((made) => made.q === q)) {
      gutter.replaceChildren(...marks.map((t) => svg("text", { x: GUTTER - 12, y: own[0].toY(t) + 3.5, "text-anchor": "end" }, tick(t))));
    }
  }

  // A line through places; it stops where a value is unknown.
  function joined({ xs, toY }, values) {
    let path = "", pen = "M";
    xs.forEach((x, i) => {
      if (!Number.isFinite(values[i])) { pen = "M"; return; }
      path += `${pen}${x} ${tenths(toY(values[i]))}`;
      pen = "L";
    });
    return path;
  }

  // Draws what has been computed on the scale of its row.
  function place(item, levels) {
    item.isPlaced = true;
    item.trace.setAttribute("d", joined(item, item.means));
    const above = item.ends ? joined(item, item.ends[1]) : "";
    const below = { xs: item.xs.slice().reverse(), toY: item.toY };
    item.band.setAttribute("d", above ? `${above}${joined(below, item.ends[0].slice().reverse()).replace("M", "L")}Z` : "");
    const faded = item.runs.map(() => "");
    item.dots.forEach((dot, i) => { if (levels[i] >= 0) faded[levels[i]] += dot; });
    item.runs.forEach((path, level) => path.setAttribute("d", faded[level]));
    item.others.replaceChildren(...item.others.values.map(({ colour, means, xs = item.xs }) => svg("path", { stroke: colour, d: joined({ ...item, xs }, means) })));
  }

  // The dashed lines through the current design, and the arrow of the slope there.
  function mark(item, point, mean) {
    const x = item.toX(point[item.j]), y = known(mean) ? item.toY(mean) : TOP + PLOT;
    item.now.setAttribute("d", `M${x} 0V${TOP + PLOT}${known(mean) ? `M0 ${y.toFixed(1)}H${item.width}` : ""}`);
    item.grip.setAttribute("cx", x);
    item.grip.setAttribute("cy", y);
    item.arrow.setAttribute("d", hasArrows && data.factors[item.j].numeric ? arrow(item, point, x, y) : "");
  }

  // As high as the value would change over a quarter of the factor's range, 40 pixels at most.
  function arrow({ j, places, means, toY }, point, x, y) {
    const { low, high } = data.factors[j];
    const length = places.at(-1) - places[0];
    const i = Math.min(samples - 2, Math.max(1, Math.round((point[j] - places[0]) / length * (samples - 1)))) || 1;
    const rise = (toY(means[i + 1]) - toY(means[i - 1])) / (places[i + 1] - places[i - 1]) * (high - low) / 4;
    const up = Math.min(40, Math.max(-40, rise));
    if (!(Math.abs(up) > 1.5)) return "";
    const head = Math.sign(up) * Math.min(5, Math.abs(up));
    return `M${x} ${y}V${y + up}M${x - 4} ${y + up - head}L${x} ${y + up}L${x + 4} ${y + up - head}`;
  }

  // Brushed designs.
  function light({ q, j, toX, toY, lit }) {
    const points = state.brush ? state.brush.points : [];
    lit.setAttribute("d", points.map((p) => [toX(p[j]), toY(rows[q].value(p))]).filter(([, y]) => Number.isFinite(y))
      .map(([x, y]) => `M${x.toFixed(1)} ${y.toFixed(1)}h0`).join(""));
  }

  // Values of the factor whose interactions are shown: its ends or its first levels.
  function overlaid() {
    if (state.overlay < 0) return [];
    const factor = data.factors[state.overlay];
    const values = factor.numeric ? [factor.low, factor.high] : factor.levels.map((_, i) => i);
    return values.slice(0, OVERLAYS.length).map((value, i) => ({ value, colour: OVERLAYS[i] }));
  }

  function explain() {
    overlay.select.value = state.overlay;
    legend.replaceChildren(...overlaid().map(({ value, colour }) => element("span", { class: "key", style: `--key:${colour}` },
      factorValue(data.factors[state.overlay], value))));
  }

  // For every factor, how clearly each run appears in the profiles along it: index into FADE, or -1. The distance of a
  // run from the slice is in coded units of two other factors, for random points are far apart in many factors.
  function fadeLevels(point) {
    const { factors } = data;
    const squares = data.points.map((run) => factors.map((factor, i) => {
      const step = (run[i] - point[i]) / (0.5 * (factor.high - factor.low));
      return factor.numeric ? step * step : 4 * (step !== 0);
    }));
    const ways = factors.map((_, j) => (rsmkit.sums.involves(j) ? rsmkit.sums.along(point, j) : null));
    const sums = squares.map((row) => row.reduce((sum, square) => sum + square, 0));
    const scale = Math.max(1, (factors.length - 1) / 2);
    return factors.map((_, j) => squares.map((row, i) => {
      const off = Math.sqrt((ways[j] ? fromLine(data.points[i], point, ways[j], j) : Math.max(0, sums[i] - row[j])) / scale);
      return FADE.findIndex(([distance]) => off <= distance);
    }));
  }

  // Squared distance of a run from the line of a factor that takes others along, at the run's own value of it.
  const fromLine = (run, point, way, j) => data.factors.reduce((sum, factor, i) => {
    const step = (run[i] - point[i] - (run[j] - point[j]) * way[i]) / (0.5 * (factor.high - factor.low));
    return i === j ? sum : sum + (factor.numeric ? step * step : 4 * (step !== 0));
  }, 0);

  return { open };
})();
