// Parallel coordinates: one line per design over all factors and quantities; drag along an axis to brush.
"use strict";

rsmkit.parallel = (function () {
  const { element, svg, section, factorValue, number, announce } = rsmkit.format;
  const PLOT = 204, AXIS = 56, LETTER = 6.6, MOST_LINES = 3;  // AXIS: the least width, in which values of five digits can be read
  let data, study, state, box, axes, designs;
  let hint, top = 44, bottom = top + PLOT;
  let now, all, lit, ranges, source;  // source: what the lines are, as a brush names it

  function open() {
    ({ data, study, state } = rsmkit);
    const search = data.searches.find((s) => s.front.length > 1);
    source = search?.name ?? "runs";
    const points = search ? search.front.map((c) => state.pointOf(c.factors)) : data.points;
    axes = [
      ...data.factors.map((factor, j) => ({ title: factor.label, of: (point) => point[j],
        text: (v) => factorValue(factor, factor.numeric ? v : Math.round(v)) })),
      ...study.quantities.map((q) => ({ title: q.title, of: q.value, text: (v) => number(v, Math.abs(v) / 30) })),
    ];
    designs = points.map((point) => ({ point, values: axes.map((axis) => axis.of(point)) }));
    axes.forEach((axis, a) => {
      const values = designs.map((d) => d.values[a]).filter(Number.isFinite);
      [axis.low, axis.high] = [Math.min(...values), Math.max(...values)];
      if (!values.length) [axis.low, axis.high] = [0, 1];
      if (axis.low === axis.high) [axis.low, axis.high] = [axis.low - 1, axis.high + 1];
    });
    ranges = axes.map(() => null);
    const scroller = element("div", { class: "scroller", tabindex: "0", role: "group", "aria-label": "Parallel coordinates" });
    hint = element("p", { class: "fine", hidden: true }, "There are more axes to the right: scroll the picture sideways.");
    section("parallel", "Parallel coordinates", hint, scroller, element("p", { class: "fine" },
      `One line per ${search ? "design of the Pareto front" : "run"}; red: the current design. Drag along an axis to keep ` +
      "only lines through that part; click the axis to free it. By keyboard: arrows move the lower end, with Shift the upper " +
      "end, Escape frees the axis."));
    box = svg("svg", { class: "parallel" });
    scroller.append(box);
    rsmkit.charts.add(scroller, { paint: (_, width) => layout(width), keys: [] });
  }

  function layout(room) {
    const width = Math.max(room, AXIS * axes.length);
    hint.hidden = width <= room;
    axes.forEach((axis, a) => Object.assign(axis, { x: (width / axes.length) * (a + 0.5), lines: broken(axis.title, (width / axes.length - 8) / LETTER) }));
    top = 31 + 13 * Math.max(...axes.map((axis) => axis.lines.length));
    bottom = top + PLOT;
    box.setAttribute("width", width);
    box.setAttribute("height", bottom + 22);
    all = svg("path", { class: "line" });
    lit = svg("path", { class: "lit" });
    now = svg("path", { class: "current" });
    box.replaceChildren(all, lit, now, ...axes.map((axis, a) => axisParts(axis, a)));
    update(new Set(["point", "brush"]));
  }

  const toY = (axis, v) => {
    const share = Math.min(1.03, Math.max(-0.03, ((Number.isFinite(v) ? v : axis.low) - axis.low) / (axis.high - axis.low)));
    return bottom - PLOT * share;
  };

  // A title in lines of so many letters, broken at blanks.
  function broken(title, length) {
    const lines = [""];
    for (const word of title.split(" ")) {
      if (!lines.at(-1) || lines.at(-1).length + 1 + word.length <= length) lines[lines.length - 1] = `${lines.at(-1)} ${word}`.trim();
      else lines.push(word);
    }
    const kept = lines.length > MOST_LINES ? [...lines.slice(0, MOST_LINES - 1), lines.slice(MOST_LINES - 1).join(" ")] : lines;
    return kept.map((line) => rsmkit.plot.cut(line, length));
  }

  function axisParts(axis, a) {
    axis.brush = svg("rect", { class: "brush", x: axis.x - 8, width: 16, height: 0 });
    const grip = svg("rect", { class: "axis-grip", tabindex: "0", role: "group", x: axis.x - 16, y: top - 8, width: 32, height: PLOT + 16 });
    grip.addEventListener("keydown", (event) => {
      const steps = { ArrowUp: 0.05, ArrowDown: -0.05 }[event.key];
      if (event.key === "Escape") brush(a, null);
      else if (steps) brush(a, moved(axis, ranges[a] ?? [axis.low, axis.high], event.shiftKey ? 1 : 0, steps));
      else return;
      event.preventDefault();
    });
    axis.grip = grip;
    let from = null;
    const at = (event) => {
      const y = event.clientY - box.getBoundingClientRect().top;
      const share = (bottom - y) / PLOT;
      return axis.low + Math.min(1, Math.max(0, share)) * (axis.high - axis.low);
    };
    grip.addEventListener("pointerdown", (event) => { from = at(event); grip.setPointerCapture(event.pointerId); });
    grip.addEventListener("pointermove", (event) => {
      if (from !== null) brush(a, [Math.min(from, at(event)), Math.max(from, at(event))]);
    });
    grip.addEventListener("pointerup", (event) => {
      if (Math.abs(at(event) - from) < 0.01 * (axis.high - axis.low)) brush(a, null);
      from = null;
    });
    return svg("g", {},
      svg("title", {}, axis.title),
      ...axis.lines.map((line, i) => svg("text", { x: axis.x, y: top - 30 - 13 * (axis.lines.length - 1 - i), "text-anchor": "middle", class: "axis-name" }, line)),
      svg("text", { x: axis.x, y: top - 13, "text-anchor": "middle" }, axis.text(axis.high)),
      svg("text", { x: axis.x, y: bottom + 17, "text-anchor": "middle" }, axis.text(axis.low)),
      svg("path", { class: "axis", d: `M${axis.x} ${top}V${bottom}` }), axis.brush, grip);
  }

  // A range with one end moved by a share of the axis; null when nothing is left out.
  function moved(axis, range, end, share) {
    const changed = range.slice();
    changed[end] = Math.min(axis.high, Math.max(axis.low, changed[end] + share * (axis.high - axis.low)));
    if (changed[0] > changed[1]) changed[1 - end] = changed[end];
    return changed[0] <= axis.low && changed[1] >= axis.high ? null : changed;
  }

  function brush(a, range) {
    ranges[a] = range;
    const inside = (design) => ranges.every((r, i) => !r || (design.values[i] >= r[0] && design.values[i] <= r[1]));
    const kept = designs.filter(inside);
    const free = ranges.every((r) => !r);
    state.set({ brush: free ? null : { search: source, points: kept.map((d) => d.point),
      rows: designs.flatMap((d, row) => (inside(d) ? [row] : [])), byAxis: true } });
    if (!free) announce(`${kept.length} of ${designs.length} designs kept`);
  }

  const line = (values) => values.map((v, a) => `${a ? "L" : "M"}${axes[a].x.toFixed(1)} ${toY(axes[a], v).toFixed(1)}`).join("");

  function update(keys) {
    if (!all) return;
    if (keys.has("point")) now.setAttribute("d", line(axes.map((axis) => axis.of(state.point))));
    if (!keys.has("brush")) return;
    if (!state.brush?.byAxis) ranges.fill(null);
    const isOwn = state.brush?.search === source, rows = isOwn ? new Set(state.brush.rows) : null;
    const kept = rows ? designs.filter((_, row) => rows.has(row)).map((d) => d.values)
      : (state.brush?.points ?? []).map((point) => axes.map((axis) => axis.of(point)));
    all.setAttribute("d", designs.map((d) => line(d.values)).join(""));
    all.setAttribute("opacity", state.brush ? 0.25 : 1);
    lit.setAttribute("d", kept.map(line).join(""));
    axes.forEach((axis, a) => {
      const range = ranges[a];
      axis.grip.setAttribute("aria-label", `Axis ${axis.title}, kept: ${range ? `${axis.text(range[0])} to ${axis.text(range[1])}` : "all"}`);
      axis.brush.setAttribute("y", range ? toY(axis, range[1]) : 0);
      axis.brush.setAttribute("height", range ? toY(axis, range[0]) - toY(axis, range[1]) : 0);
    });
  }

  return { open, update };
})();
