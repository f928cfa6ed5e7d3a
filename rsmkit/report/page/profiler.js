// The prediction profiler: every quantity against every factor through the current design, with prediction
// intervals, the runs faded by their distance from the slice, and current values that can be dragged.
"use strict";

rsmkit.profiler = (function () {
  const { element, svg, section, number, halfWidth, factorValue, tick, ticks } = rsmkit.format;
  const SAMPLES = 41;
  const HEIGHT = 104;
  const NAME_WIDTH = 150;
  const SMALLEST_CELL = 104;
  const FADE = [[0.35, 0.9], [0.9, 0.42], [1.8, 0.14]];  // [distance in coded units, opacity]
  let grid, badge, compromise, data, study, state;
  let cells = [];
  let names = [];
  let rows = [];
  let controls = [];
  let ranges = [];
  let width = 0;

  function open() {
    ({ data, study, state } = rsmkit);
    badge = element("span", { class: "badge", role: "status", hidden: true }, "extrapolating");
    compromise = element("button", { type: "button", hidden: true,
      onclick: () => state.set({ point: rsmkit.goals.bestPoint() }) }, "Best compromise");
    const bar = element("div", { class: "bar" },
      ...data.searches.map((search) => element("button",
        { type: "button", onclick: () => state.set({ point: state.pointOf(search.factors) }) },
        `Optimum ${search.name}`)),
      element("button", { type: "button", onclick: () => state.set({ point: data.factors.map(state.centre) }) },
        "Centre"),
      compromise, badge);
    grid = element("div", { class: "profiler" });
    section("profiler", "Prediction profiler", bar, grid, element("p", { class: "fine" },
      "Drag a dashed line, or use the sliders. Bands hold one new run with 95 % probability; dots are the runs, " +
      "fading with their distance from the current design."));
    new ResizeObserver(() => {
      if (grid.clientWidth && Math.abs(grid.clientWidth - width) > 1) { build(); update(new Set(["point", "goals"])); }
    }).observe(grid);
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
  function build() {
    width = grid.clientWidth;
    listRows();
    const factors = data.factors;
    const narrow = width < 620;
    const room = narrow ? width : width - NAME_WIDTH;
    const most = Math.max(1, Math.floor(room / (SMALLEST_CELL + 8)));
    const across = Math.ceil(factors.length / Math.ceil(factors.length / most));
    const cellWidth = Math.floor((room - 8 * (across - (narrow ? 1 : 0))) / across);
    grid.replaceChildren();
    [cells, names, controls] = [[], [], []];
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
      band.forEach((j) => block.append(control(j)));
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
      for (const t of yTicks) box.append(svg("text", { x: 5, y: toY(t) - 3 }, tick(t)));
    }
    const marks = factor.kind === "categorical" ? factor.levels.map((_, i) => i) : [factor.low, factor.high];
    marks.forEach((v, i) => box.append(svg("text", { x: toX(v), y: HEIGHT - 4,
      "text-anchor": i === 0 ? "start" : i === marks.length - 1 ? "end" : "middle" }, factorValue(factor, v))));
    const parts = {
      band: svg("path", { class: "band" }),
      runs: FADE.map(([, opacity]) => svg("path", { class: "runs", opacity })),
      trace: svg("path", { class: "trace" }),
      now: svg("path", { class: "now" }),
      grip: svg("circle", { class: "grip", r: 4.5 }),
    };
    box.append(parts.band, ...parts.runs, parts.trace, parts.now, parts.grip);
    const drag = (event) => {
      const x = event.clientX - box.getBoundingClientRect().left;
      const share = (x - pad.left) / (cellWidth - pad.left - pad.right);
      state.setFactor(j, factor.low + share * (factor.high - factor.low));
    };
    box.addEventListener("pointerdown", (event) => { box.setPointerCapture(event.pointerId); drag(event); });
    box.addEventListener("pointermove", (event) => { if (box.hasPointerCapture(event.pointerId)) drag(event); });
    cells.push({ q, j, toX, toY, cellWidth, low, high, ...parts });
    return box;
  }

  function control(j) {
    const factor = data.factors[j];
    const made = { j };
    const step = factor.kind === "continuous" ? (factor.high - factor.low) / 200 : 1;
    const parts = [element("span", {}, factor.title)];
    if (factor.kind === "categorical") {
      made.pick = element("select", { "aria-label": factor.title, onchange: (e) => state.setFactor(j, +e.target.value) },
        ...factor.levels.map((level, i) => element("option", { value: i }, level)));
      parts.push(made.pick);
    } else {
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
        "aria-label": `${factor.title}, value`, onchange: (e) => state.setFactor(j, +e.target.value) });
      parts.push(made.slider, made.field);
    }
    controls.push(made);
    return element("div", { class: "control" }, ...parts);
  }

  function update(keys) {
    if (!cells.length) return;
    if (keys.has("goals")) restart();
    else if (!keys.has("point")) return;
    const point = state.point;
    const now = rows.map((quantity) => quantity.value(point));
    for (const { q, value, interval } of names) {
      const mean = now[q];
      const half = halfWidth(rows[q].interval(point));
      value.textContent = number(mean, half);
      interval.textContent = intervalText(mean, half);
    }
    for (const item of cells) draw(item, point, now[item.q]);
    for (const { j, slider, field, pick } of controls) {
      if (pick) { pick.value = point[j]; continue; }
      slider.value = point[j];
      slider.setAttribute("aria-valuetext", factorValue(data.factors[j], point[j]));
      if (document.activeElement !== field) field.value = factorValue(data.factors[j], point[j]);
    }
    badge.hidden = study.reach(point) <= 1 + 1e-9;
  }

  // Builds anew, leaving the keyboard where it was.
  function restart() {
    const focused = document.activeElement?.getAttribute("aria-label");
    build();
    compromise.hidden = !rsmkit.goals.wishes().length;
    if (focused) [...grid.querySelectorAll("[aria-label]")].find((e) => e.getAttribute("aria-label") === focused)?.focus();
  }

  function intervalText(mean, half) {
    if (!Number.isFinite(half)) return "";
    return half < 1e-9 * Math.abs(mean) ? "exact" : `± ${number(half, half)}`;
  }

  function draw({ q, j, toX, toY, cellWidth, low, high, band, runs, trace, now, grip }, point, mean) {
    const quantity = rows[q];
    const factor = data.factors[j];
    const count = factor.kind === "categorical" ? factor.levels.length : SAMPLES;
    const moved = point.slice();
    const limit = (v) => Math.min(2 * high - low, Math.max(2 * low - high, v));
    let line = "", upper = "", lower = "";
    for (let i = 0; i < count; i++) {
      moved[j] = factor.low + (factor.high - factor.low) * i / (count - 1);
      const value = quantity.value(moved);
      const [least, most] = quantity.interval(moved);
      const x = toX(moved[j]).toFixed(1);
      line += `${i ? "L" : "M"}${x} ${toY(limit(value)).toFixed(1)}`;
      if (Number.isFinite(most - least)) {
        upper += `${i ? "L" : "M"}${x} ${toY(limit(most)).toFixed(1)}`;
        lower = `L${x} ${toY(limit(least)).toFixed(1)}${lower}`;
      }
    }
    trace.setAttribute("d", line);
    band.setAttribute("d", upper && `${upper}${lower}Z`);
    now.setAttribute("d", `M${toX(point[j])} 0V${HEIGHT - 16}M0 ${toY(limit(mean))}H${cellWidth}`);
    grip.setAttribute("cx", toX(point[j]));
    grip.setAttribute("cy", toY(limit(mean)));
    const dots = runs.map(() => "");
    data.points.forEach((run, i) => {
      const y = quantity.observed[i];
      if (y === null || run[j] < factor.low || run[j] > factor.high) return;
      const level = FADE.findIndex(([distance]) => offSlice(run, point, j) <= distance);
      if (level >= 0) dots[level] += `M${toX(run[j]).toFixed(1)} ${toY(y).toFixed(1)}h0`;
    });
    runs.forEach((path, level) => path.setAttribute("d", dots[level]));
  }

  // Distance of a run from the slice along factor j, in coded units of two other factors.
  function offSlice(run, point, j) {
    let sum = 0;
    data.factors.forEach((factor, i) => {
      if (i === j) return;
      const step = (run[i] - point[i]) / (0.5 * (factor.high - factor.low));
      sum += factor.kind === "categorical" ? 4 * (step !== 0) : step * step;
    });
    return Math.sqrt(sum / Math.max(1, (data.factors.length - 1) / 2));  // random points are far apart in many factors
  }

  return { open, update };
})();
