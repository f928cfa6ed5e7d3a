// Contours of one quantity over two factors, the others held. The current design can be dragged about, or moved with
// the arrow keys.
"use strict";

rsmkit.contours = (function () {
  const { element, svg, section, choice, number, halfWidth, factorValue, tick, ticks, announce } = rsmkit.format;
  const HEIGHT = 420, LINES = 14;
  const PAD = { left: 62, right: 14, top: 10, bottom: 46 };
  let data, study, state, choices, readout, told, parts, drawn, place;
  let edges = [];  // of the limits, for dragging

  function open() {
    ({ data, study, state } = rsmkit);
    const numeric = data.factors.map((f, j) => [String(j), f.label]).filter(([j]) => data.factors[j].numeric);
    if (numeric.length < 2) return;
    choices = {
      quantity: choice("Show", [...study.quantities.map((q) => [q.key, q.title]), ["desirability", "overall desirability"]], state.quantity,
        (key) => state.set({ quantity: key })),
      x: choice("across", numeric, String(state.x), (j) => pick("x", +j)),
      y: choice("up", numeric, String(state.y), (j) => pick("y", +j)),
    };
    const flat = element("div");
    const solid = element("div");
    readout = element("p", { class: "fine readout" });
    told = element("p", { class: "legend" });
    section("contours", "Contours and surface",
      element("div", { class: "bar" }, choices.quantity, choices.x, choices.y),
      element("div", { class: "pair" }, element("div", {}, flat, told), solid), readout,
      element("p", { class: "fine" }, "Red: the current design; drag it, or use the arrow keys. Stars: optima, hollow where they lie " +
        "outside this slice. Dots: runs. Lines in colour: limits, with teeth on the forbidden side; drag one, or type it below. " +
        "Veiled: forbidden by some limit."),
      rsmkit.limits.table());
    const keys = ["point", "x", "y", "quantity", "brush", "limits", "goals"];
    rsmkit.charts.add(flat, { paint, move, keys, follows: ["point", "limits"] });
    rsmkit.surface.open(solid, keys);
  }

  // Choosing the factor of the other axis swaps the two.
  function pick(axis, j) {
    const other = axis === "x" ? "y" : "x";
    state.set(state[other] === j ? { [axis]: j, [other]: state[axis] } : { [axis]: j });
  }

  // Builds the map anew: axes, what does not depend on the design, and places for what does.
  function paint(host, width) {
    const focused = parts && document.activeElement === parts.box;
    const [fx, fy] = [data.factors[state.x], data.factors[state.y]];
    const right = width - PAD.right, bottom = HEIGHT - PAD.bottom;
    place = {
      right, bottom,
      x: (v) => PAD.left + (right - PAD.left) * (v - fx.low) / (fx.high - fx.low),
      y: (v) => bottom - (bottom - PAD.top) * (v - fy.low) / (fy.high - fy.low),
      back: (event) => {
        const from = parts.box.getBoundingClientRect();
        const share = [(event.clientX - from.left - PAD.left) / (right - PAD.left),
          (bottom - event.clientY + from.top) / (bottom - PAD.top)];
        return [fx.low + share[0] * (fx.high - fx.low), fy.low + share[1] * (fy.high - fy.low)];
      },
    };
    const box = svg("svg", { class: "map", width, height: HEIGHT, tabindex: "0", role: "img",
      "aria-label": `Contours of ${rsmkit.slice.chosen().title} over ${fx.label} and ${fy.label}; the arrow keys move the design` });
    parts = { box, bands: svg("g"), lines: svg("path", { class: "isolines" }), veil: svg("g", { class: "veil" }), limits: svg("g", { class: "limit-lines" }), stars: svg("g"),
      labels: svg("g", { class: "levels" }), ring: svg("circle", { class: "ring", r: 7 }) };
    const brushed = state.brush ? state.brush.points : [];
    box.append(parts.bands, parts.lines, parts.veil, parts.labels, parts.limits,
      svg("path", { class: "dot-edge", d: dots(data.points) }), svg("path", { class: "dot", d: dots(data.points) }),
      svg("path", { class: "lit-dot", d: dots(brushed) }), parts.stars,
      ...axisTexts(fx, fy, right, bottom), parts.ring);
    listen(box);
    host.replaceChildren(box);
    if (focused) box.focus();
    drawn = "";
    move();
  }

  const dots = (points) => points.map((p) => `M${place.x(p[state.x]).toFixed(1)} ${place.y(p[state.y]).toFixed(1)}h0`).join("");

  // Whether a point agrees with the current design in every factor but the two of the map.
  const isInSlice = (point) => data.factors.every((f, j) => j === state.x || j === state.y ||
    Math.abs(point[j] - state.point[j]) <= 1e-3 * (f.high - f.low));

  function star(search) {
    const at = state.pointOf(search.factors);
    const corners = Array.from({ length: 10 }, (_, i) => {
      const [angle, size] = [Math.PI * (i / 5 - 0.5), i % 2 ? 4 : 9.5];
      return `${(place.x(at[state.x]) + size * Math.cos(angle)).toFixed(1)} ${(place.y(at[state.y]) + size * Math.sin(angle)).toFixed(1)}`;
    });
    return svg("path", { class: isInSlice(at) ? "star" : "star away", d: `M${corners.join("L")}Z` }, svg("title", {}, `optimum ${search.name}`));
  }

  function axisTexts(fx, fy, right, bottom) {
    const xs = ticks(fx.low, fx.high, Math.max(2, Math.min(6, (right - PAD.left) / 80))), ys = ticks(fy.low, fy.high, 6);
    const middle = (PAD.top + bottom) / 2;
    return [
      svg("path", { class: "axis", d: `M${PAD.left} ${PAD.top}H${right}V${bottom}H${PAD.left}Z` }),
      ...xs.map((v) => svg("text", { x: place.x(v), y: bottom + 16, "text-anchor": "middle" }, tick(v))),
      ...ys.map((v) => svg("text", { x: PAD.left - 6, y: place.y(v) + 4, "text-anchor": "end" }, tick(v))),
      svg("text", { x: (PAD.left + right) / 2, y: HEIGHT - 8, "text-anchor": "middle", class: "axis-name" }, fx.title),
      svg("text", { x: 13, y: middle, "text-anchor": "middle", class: "axis-name", transform: `rotate(-90 13 ${middle})` }, fy.title),
    ];
  }

  function listen(box) {
    let held = null;  // the limit that is being dragged
    box.addEventListener("pointerdown", (event) => {
      box.setPointerCapture(event.pointerId);
      held = edgeAt(event);
      if (!held) goTo(place.back(event));
    });
    box.addEventListener("pointermove", (event) => {
      if (!box.hasPointerCapture(event.pointerId)) { tell(event); return; }
      if (held) rsmkit.limits.set(held.subject, held.side, Number(held.subject.value(under(event)).toPrecision(4)));
      else goTo(place.back(event));
    });
    box.addEventListener("pointerleave", () => { readout.textContent = ""; });
    box.addEventListener("keydown", (event) => {
      const moves = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
      if (!moves[event.key]) return;
      const step = (j) => (data.factors[j].continuous ? (data.factors[j].high - data.factors[j].low) / 100 : 1);
      goTo([state.x, state.y].map((j, i) => state.point[j] + moves[event.key][i] * step(j)));
      state.flush();
      announce(sentence(state.point));
      event.preventDefault();
    });
  }

  function goTo(values) {
    const point = state.point.slice();
    [state.x, state.y].forEach((j, i) => { point[j] = state.snap(data.factors[j], values[i]); });
    state.set({ point });
  }

  function sentence(point) {
    const quantity = rsmkit.slice.chosen();
    const half = halfWidth(quantity.interval(point));
    const spread = half > 0 && Number.isFinite(half) ? ` ± ${number(half, half)}` : "";
    return `${[state.x, state.y].map((j) => `${data.factors[j].label} ${factorValue(data.factors[j], point[j])}`).join(", ")}: ` +
      `${quantity.title} ${number(quantity.value(point), half)}${spread}`;
  }

  // The limit whose line is under the pointer, unless the ring is nearer.
  function edgeAt(event) {
    const from = parts.box.getBoundingClientRect();
    const [x, y] = [event.clientX - from.left, event.clientY - from.top];
    if (Math.hypot(place.x(state.point[state.x]) - x, place.y(state.point[state.y]) - y) < 12) return null;
    const away = ({ middles }) => middles.reduce((least, m) => Math.min(least, Math.hypot(m[0] - x, m[1] - y)), Infinity);
    const nearest = edges.reduce((best, edge) => (away(edge) < away(best) ? edge : best), { middles: [] });
    return away(nearest) < 9 ? nearest.limit : null;
  }

  // The point of the slice under the pointer.
  function under(event) {
    const point = state.point.slice();
    const values = place.back(event);
    [state.x, state.y].forEach((j, i) => { point[j] = Math.min(data.factors[j].high, Math.max(data.factors[j].low, values[i])); });
    return point;
  }

  // Says what lies under the pointer: a run near it, or else the prediction.
  function tell(event) {
    const from = parts.box.getBoundingClientRect();
    const near = data.points.findIndex((p) => Math.hypot(place.x(p[state.x]) + from.left - event.clientX,
      place.y(p[state.y]) + from.top - event.clientY) < 6);
    parts.box.style.cursor = edgeAt(event) ? "move" : "";
    const point = under(event);
    for (const j of [state.x, state.y]) point[j] = state.snap(data.factors[j], point[j]);
    const quantity = rsmkit.slice.chosen();
    readout.textContent = near < 0 ? sentence(point)
      : `${data.kinds[near]} run ${near + 1}: ${data.factors.map((f, j) => `${f.label} ${factorValue(f, data.points[near][j])}`).join(", ")}: ` +
        `${quantity.title} ${number(quantity.observed[near])}`;
  }

  // Follows the design: the ring, and the levels and limits when another factor, or a limit, has moved.
  function move() {
    parts.ring.setAttribute("cx", place.x(state.point[state.x]));
    parts.ring.setAttribute("cy", place.y(state.point[state.y]));
    const name = rsmkit.slice.name() + JSON.stringify(state.limits);
    if (name === drawn) return;
    drawn = name;
    const { xs, ys, z, low, high, fields } = rsmkit.slice.grid();
    const at = [halved(xs).map((v) => +place.x(v).toFixed(1)), halved(ys).map((v) => +place.y(v).toFixed(1))];
    const levels = ticks(low, high, LINES);
    const step = levels[1] - levels[0] || high - low;
    const heights = rsmkit.bands.finer(z);
    const regions = levels.map((level) => rsmkit.bands.region(heights, level, ...at));
    const shades = [`M${at[0][0]} ${at[1][0]}H${at[0].at(-1)}V${at[1].at(-1)}H${at[0][0]}Z`, ...regions.map((r) => r.fill)];
    parts.bands.replaceChildren(...shades.map((d, i) => svg("path", { d,
      fill: rsmkit.bands.css(rsmkit.bands.colour(((i ? levels[i - 1] : levels[0] - step) + 0.5 * step - low) / (high - low))) })));
    parts.lines.setAttribute("d", regions.map((r) => r.edge).join(""));
    parts.labels.replaceChildren(...labels(levels, regions));
    parts.stars.replaceChildren(...data.searches.map(star));
    drawLimits(fields, at);
  }

  // Nodes and the middles between them.
  const halved = (nodes) => nodes.flatMap((v, i) => (i ? [0.5 * (nodes[i - 1] + v), v] : [v]));

  // The veil over what is forbidden, and every limit's line with its name and teeth on the forbidden side.
  function drawLimits(fields, at) {
    const finer = new Map([...fields].map(([key, grid]) => [key, rsmkit.bands.finer(grid)]));
    edges = rsmkit.limits.active().map((limit) => {
      const grid = finer.get(limit.subject.key).map((row) => row.map((v) => -limit.sign * v));
      return { limit, values: grid, ...rsmkit.bands.region(grid, -limit.sign * limit.limit + Number.MIN_VALUE, ...at) };
    });
    parts.veil.replaceChildren(...edges.map(({ fill }) => svg("path", { d: fill })));
    const taken = [];
    parts.limits.replaceChildren(...edges.flatMap(({ limit, edge, middles }) => {
      let teeth = "", last = null;
      for (const [x, y, right, down] of middles) {
        if (!Number.isFinite(right) || (last && Math.hypot(x - last[0], y - last[1]) < 9)) continue;
        teeth += `M${x.toFixed(1)} ${y.toFixed(1)}l${(6 * right).toFixed(1)} ${(6 * down).toFixed(1)}`;
        last = [x, y];
      }
      const clear = middles.filter(([x, y]) => x > PAD.left + 40 && x < place.right - 40 && y > PAD.top + 14 && y < place.bottom - 12 &&
        taken.every(([a, b]) => Math.abs(a - x) > 90 || Math.abs(b - y) > 16));
      const spot = clear[Math.floor(clear.length / 2)];
      if (spot) taken.push(spot);
      return [svg("path", { class: "casing", d: edge }), svg("path", { d: edge + teeth, stroke: limit.colour }),
        ...(spot ? [svg("text", { x: spot[0].toFixed(1), y: (spot[1] - 5).toFixed(1), "text-anchor": "middle", style: `fill:${limit.colour}` }, limit.text)] : [])];
    }));
    told.replaceChildren(...edges.map(({ limit, edge, fill }) => element("span", { class: "key", style: `--key:${limit.colour}` },
      limit.text + (edge ? "" : fill ? ": nowhere kept here" : whole(limit)))));
  }

  const whole = ({ subject }) => (Number.isFinite(subject.value(state.point)) ? ": kept everywhere here"
    : ": cannot be shown, it depends on a function of too many factors");

  // Writes every level on its line, far from the levels written before and near the middle.
  function labels(levels, regions) {
    const taken = [];
    const { right, bottom } = place;
    return levels.flatMap((level, i) => {
      const inside = regions[i].middles.filter(([x, y]) => x > PAD.left + 22 && x < right - 22 && y > PAD.top + 10 && y < bottom - 8);
      const room = (at) => Math.min(60, ...taken.map((t) => Math.hypot(t[0] - at[0], 2 * (t[1] - at[1])))) -
        0.06 * Math.hypot(at[0] - 0.5 * right, at[1] - 0.5 * bottom);
      const best = inside.reduce((kept, at) => (room(at) > kept[0] ? [room(at), at] : kept), [18, null])[1];
      if (!best) return [];
      taken.push(best);
      return [svg("text", { x: best[0].toFixed(1), y: (best[1] + 3.5).toFixed(1), "text-anchor": "middle" }, tick(level))];
    });
  }

  function update(keys) {
    if (!choices) return;
    if (keys.has("quantity")) choices.quantity.select.value = state.quantity;
    if (keys.has("x") || keys.has("y")) {
      choices.x.select.value = state.x;
      choices.y.select.value = state.y;
    }
  }

  return { open, update };
})();
