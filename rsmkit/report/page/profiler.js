// The prediction profiler: every quantity against every factor through the current design, with prediction
// intervals, the runs faded by their distance from the slice, and current values that can be dragged.
"use strict";

rsmkit.profiler = (function () {
  const { element, svg, section, choice, number, halfWidth, factorValue, tick, ticks } = rsmkit.format;
  const SAMPLES = 43;  // points of a trace
  const OVERLAYS = ["#d97706", "#0d9488", "#a855f7", "#64748b", "#db2777"];
  const HEIGHT = 104;
  const NAME_WIDTH = 150;
  const SMALLEST_CELL = 104;
  const FADE = [[0.35, 0.9], [0.9, 0.42], [1.8, 0.14]];  // [distance in coded units, opacity]
  let grid, compromise, overlay, legend, data, study, state;
  let cells = [];
  let names = [];
  let rows = [];
  let feet = [];  // names and values of the factors, below the cells
  let ranges = [];
  let every = 1;  // samples from one interval that is computed to the next

  function open() {
    ({ data, study, state } = rsmkit);
    every = data.factors.length > 4 ? 6 : 3;  // among many factors a line hardly ever passes close to a run
    compromise = element("button", { type: "button", hidden: true,
      onclick: () => state.set({ point: rsmkit.goals.bestPoint() }) }, "Best compromise");
    overlay = choice("Interactions with", [["-1", "none"], ...data.factors.map((f, j) => [String(j), f.label])],
      String(state.overlay), (j) => state.set({ overlay: +j }));
    legend = element("span", { class: "fine" });
    grid = element("div", { class: "profiler" });
    section("profiler", "Prediction profiler", element("div", { class: "bar" }, overlay, legend, compromise), grid,
      element("p", { class: "fine" },
        "Drag a dashed line, or set the factors of the current design. Bands hold one new run with 95 % probability; dots are the runs, " +
        "fading with their distance from the current design. Interactions: the other profiles with the chosen factor at " +
        "its ends; where they are parallel the two factors do not interact."));
    rsmkit.charts.add(grid, { paint, move, keys: ["point", "brush", "overlay", "goals"] });
  }

  // The rows: every quantity and, with goals, the desirability.
  function listRows() {
    rows = rsmkit.goals.wishes().length ? [...study.quantities, rsmkit.goals.quantity()] : study.quantities;
    ranges = rows.map(({ range: [low, high] }) => {
      const margin = 0.06 * (high - low) || Math.abs(high) * 0.05 || 1;
      return [low - margin, high + margin];
    });
  }

  // Lays the cells out: as many factors side by side as fit, the rest in further bands below.
  function build(width) {
    listRows();
    const factors = data.factors;
    const narrow = width < 620;
    const room = narrow ? width : width - NAME_WIDTH;
    const most = Math.max(1, Math.floor(room / (SMALLEST_CELL + 8)));
    const across = Math.ceil(factors.length / Math.ceil(factors.length / most));
    const cellWidth = Math.floor((room - 8 * (across - (narrow ? 1 : 0))) / across);
    grid.replaceChildren();
    [cells, names, feet] = [[], [], []];
    for (let first = 0; first < factors.length; first += across) {
      const band = factors.slice(first, first + across).map((_, i) => first + i);
      const block = element("div", { class: "rows",
        style: `grid-template-columns:${narrow ? "" : `${NAME_WIDTH}px `}repeat(${across}, minmax(0, ${cellWidth}px))` });
      rows.forEach((quantity, q) => {
        const value = element("b");
        const interval = element("span");
        names.push({ q, value, interval });
        block.append(element("div", { class: "row-name", style: narrow ? "grid-column:1/-1" : null },
          element("i", { title: quantity.key }, quantity.title), value, interval, first === 0 ? goal(quantity) : null));
        band.forEach((j, i) => block.append(cell(q, j, cellWidth, i === 0)));
        fillRow(block, across - band.length);
      });
      if (!narrow) block.append(element("div"));
      band.forEach((j) => block.append(foot(j)));
      fillRow(block, across - band.length);
      grid.append(block);
    }
  }

  function fillRow(block, count) {
    for (let i = 0; i < count; i++) block.append(element("div"));
  }

  // A select for the quantity's goal.
  function goal(quantity) {
    if (!study.quantities.includes(quantity)) return null;
    const set = (event) => {
      const goals = { ...state.goals, [quantity.key]: event.target.value };
      if (!event.target.value) delete goals[quantity.key];
      state.set({ goals });
    };
    return element("select", { class: "goal", "aria-label": `Goal for ${quantity.title}`, onchange: set },
      ...[["", "no goal"], ["min", "minimise"], ["max", "maximise"]].map(([value, text]) =>
        element("option", { value, selected: value === (state.goals[quantity.key] ?? "") }, text)));
  }

  function cell(q, j, cellWidth, isFirst) {
    const factor = data.factors[j];
    const [low, high] = ranges[q];
    const pad = { left: 4, right: 4, top: 6, bottom: 16 };
    const toX = (v) => pad.left + (cellWidth - pad.left - pad.right) * (v - factor.low) / (factor.high - factor.low);
    const toY = (v) => HEIGHT - pad.bottom - (HEIGHT - pad.top - pad.bottom) * (v - low) / (high - low);
    const box = svg("svg", { class: "cell", width: cellWidth, height: HEIGHT, "aria-hidden": "true" });
    const yTicks = ticks(low, high, 3);
    box.append(svg("path", { class: "grid", d: yTicks.map((t) => `M0 ${toY(t)}H${cellWidth}`).join("") }));
    if (isFirst) {
      for (const t of yTicks) if (toY(t) > 12) box.append(svg("text", { x: 5, y: toY(t) - 3 }, tick(t)));
    }
    const marks = factor.numeric ? [factor.low, factor.high] : factor.levels.map((_, i) => i);
    marks.forEach((v, i) => box.append(svg("text", { x: toX(v), y: HEIGHT - 4,
      "text-anchor": i === 0 ? "start" : i === marks.length - 1 ? "end" : "middle" },
      short(factorValue(factor, v), cellWidth / marks.length / 6))));
    const parts = {
      band: svg("path", { class: "band" }),
      runs: FADE.map(([, opacity]) => svg("path", { class: "runs", opacity })),
      lit: svg("path", { class: "lit-dot" }),
      others: svg("g", { class: "others" }),
      trace: svg("path", { class: "trace" }),
      now: svg("path", { class: "now" }),
      grip: svg("circle", { class: "grip", r: 4.5 }),
    };
    box.append(parts.band, ...parts.runs, parts.lit, parts.others, parts.trace, parts.now, parts.grip);
    const drag = (event) => {
      const x = event.clientX - box.getBoundingClientRect().left;
      const share = (x - pad.left) / (cellWidth - pad.left - pad.right);
      state.setFactor(j, factor.low + share * (factor.high - factor.low));
    };
    box.addEventListener("pointerdown", (event) => { box.setPointerCapture(event.pointerId); drag(event); });
    box.addEventListener("pointermove", (event) => { if (box.hasPointerCapture(event.pointerId)) drag(event); });
    const places = !factor.numeric ? marks
      : Array.from({ length: SAMPLES }, (_, i) => factor.low + (factor.high - factor.low) * i / (SAMPLES - 1));
    const dots = data.points.map((run, i) => (!known(rows[q].observed[i]) || run[j] < factor.low || run[j] > factor.high ? ""
      : `M${toX(run[j]).toFixed(1)} ${toY(rows[q].observed[i]).toFixed(1)}h0`));
    cells.push({ q, j, toX, toY, cellWidth, low, high, places, xs: places.map((v) => toX(v).toFixed(1)), dots, shown: null, ...parts });
    return box;
  }

  const known = (value) => value !== null && Number.isFinite(value);

  const short = (text, length) => (text.length > length ? `${text.slice(0, Math.max(1, Math.floor(length) - 1))}…` : text);

  function foot(j) {
    const value = element("b");
    feet.push({ j, value });
    return element("p", { class: "foot" }, element("span", {}, data.factors[j].title), value);
  }

  // Builds anew, leaving the keyboard where it was.
  function paint(host, width) {
    const focused = document.activeElement?.getAttribute("aria-label");
    build(width);
    compromise.hidden = !rsmkit.goals.wishes().length;
    explain();
    cells.forEach(light);
    move();
    if (focused) [...grid.querySelectorAll("[aria-label]")].find((e) => e.getAttribute("aria-label") === focused)?.focus();
  }

  // Follows the current design: a profile changes only when another factor than its own has moved.
  function move() {
    const point = state.point;
    const now = rows.map((quantity) => quantity.value(point));
    for (const { q, value, interval } of names) {
      const half = halfWidth(rows[q].interval(point));
      value.textContent = number(now[q], half);
      interval.textContent = intervalText(now[q], half);
    }
    for (const { j, value } of feet) value.textContent = factorValue(data.factors[j], point[j]);
    const levels = fadeLevels(point);
    for (const item of cells) {
      if (!item.shown || item.shown.some((v, j) => j !== item.j && v !== point[j])) draw(item, point, levels[item.j]);
      mark(item, point, now[item.q]);
    }
  }

  function intervalText(mean, half) {
    if (!Number.isFinite(half)) return "";
    return half < 1e-9 * Math.abs(mean) ? "exact" : `± ${number(half, half)}`;
  }

  const limited = ({ toY, low, high }, v) => toY(Math.min(2 * high - low, Math.max(2 * low - high, v))).toFixed(1);

  // A line through places; it stops where a value is unknown.
  function joined(xs, ys) {
    let path = "", pen = "M";
    xs.forEach((x, i) => {
      if (ys[i] === "NaN") { pen = "M"; return; }
      path += `${pen}${x} ${ys[i]}`;
      pen = "L";
    });
    return path;
  }

  // The profile of a cell: it changes when another factor than its own moves.
  function draw(item, point, levels) {
    const { q, j, xs, places, band, runs, trace, others, dots } = item;
    const quantity = rows[q];
    item.shown = point;
    const means = quantity.values(point, j, places);
    trace.setAttribute("d", joined(xs, means.map((v) => limited(item, v))));
    const [lower, upper] = limits(quantity, point, item, means);
    const above = lower ? joined(xs, upper) : "";  // nothing where no value is known
    band.setAttribute("d", above ? `${above}${joined(xs.slice().reverse(), lower.reverse()).replace("M", "L")}Z` : "");
    const faded = runs.map(() => "");
    dots.forEach((dot, i) => { if (levels[i] >= 0) faded[levels[i]] += dot; });
    runs.forEach((path, level) => path.setAttribute("d", faded[level]));
    others.replaceChildren(...(state.overlay === j ? [] : overlaid()).map(({ value, colour }) => {
      const moved = point.slice();
      moved[state.overlay] = value;
      return svg("path", { stroke: colour, d: joined(xs, quantity.values(moved, j, places).map((v) => limited(item, v))) });
    }));
  }

  // Both edges of the band in pixels; null without an interval.
  function limits(quantity, point, item, means) {
    const isExact = item.places.length !== SAMPLES;
    const known = isExact ? item.places : item.places.filter((_, i) => i % every === 0);
    const found = quantity.intervals(point, item.j, known);
    if (!found.every(([least, most]) => Number.isFinite(most - least))) return [null, null];
    return [0, 1].map((side) => {
      const away = found.map((ends, i) => ends[side] - means[isExact ? i : every * i]);
      return means.map((mean, i) => limited(item, mean + (isExact ? away[i] : between(away, i / every))));
    });
  }

  // Value of a smooth sequence between its members, by the cubic through the nearest four.
  function between(values, at) {
    const first = Math.min(values.length - 4, Math.max(0, Math.floor(at) - 1));
    const u = at - first;
    return -values[first] * (u - 1) * (u - 2) * (u - 3) / 6 + values[first + 1] * u * (u - 2) * (u - 3) / 2 -
      values[first + 2] * u * (u - 1) * (u - 3) / 2 + values[first + 3] * u * (u - 1) * (u - 2) / 6;
  }

  // The dashed lines through the current design.
  function mark(item, point, mean) {
    const x = item.toX(point[item.j]), y = limited(item, mean);
    item.now.setAttribute("d", `M${x} 0V${HEIGHT - 16}${known(mean) ? `M0 ${y}H${item.cellWidth}` : ""}`);
    item.grip.setAttribute("cx", x);
    item.grip.setAttribute("cy", known(mean) ? y : HEIGHT - 16);
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
    const sums = squares.map((row) => row.reduce((sum, square) => sum + square, 0));
    const scale = Math.max(1, (factors.length - 1) / 2);
    return factors.map((_, j) => squares.map((row, i) => {
      const off = Math.sqrt(Math.max(0, sums[i] - row[j]) / scale);
      return FADE.findIndex(([distance]) => off <= distance);
    }));
  }

  return { open };
})();
