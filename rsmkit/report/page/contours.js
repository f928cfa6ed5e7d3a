// Contours of one quantity over two factors, the others held. The current design can be dragged about, or moved with
// the arrow keys.
"use strict";

rsmkit.contours = (function () {
  const { element, svg, section, choice, number, halfWidth, factorValue, tick, ticks, announce } = rsmkit.format;
  const HEIGHT = 420;
  const PAD = { left: 62, right: 14, top: 10, bottom: 46 };
  let data, study, state, choices, readout, told, parts, drawn, place;
  let edges = [];  // of the limits, for dragging

  function open() {
    ({ data, study, state } = rsmkit);
    const numeric = data.factors.map((f, j) => [String(j), f.label]).filter(([j]) => data.factors[j].numeric);
    if (!numeric.some(([i]) => numeric.some(([j]) => rsmkit.sums.areFree(+i, +j)))) return;
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
        "Veiled: forbidden by some limit." +
        (data.equalities.length ? " What gives way to the two factors does so in proportion; where it cannot, nothing is drawn." : "")),
      rsmkit.limits.table());
    const keys = ["point", "x", "y", "quantity", "brush", "limits", "goals", ...(data.equalities.length ? ["held"] : [])];
    rsmkit.charts.add(flat, { paint, move, keys, follows: ["point", "limits"] });
    rsmkit.surface.open(solid, keys);
  }

  // Choosing the factor of the other axis swaps the two; where one settles the other, as in a mixture of two, the other
  // axis takes the next factor that is free.
  function pick(axis, j) {
    const other = axis === "x" ? "y" : "x";
    if (state[other] === j) { state.set({ [axis]: j, [other]: state[axis] }); return; }
    const free = [state[other], ...data.factors.keys()].find((i) => data.factors[i].numeric && rsmkit.sums.areFree(i, j));
    if (free === undefined) { update(new Set(["x"])); return; }
    state.set({ [axis]: j, [other]: free });
  }

  // The slice at values of its two factors, the sums kept; null where that cannot be.
  const at = (values) => rsmkit.sums.placed(state.point, [[state.x, values[0]], [state.y, values[1]]]);

  // Builds the map anew: axes, what does not depend on the design, and places for what does.
  function paint(host, width) {
    const focused = parts && document.activeElement === parts.box;
    const [fx, fy] = [data.factors[state.x], data.factors[state.y]];
    const right = width - PAD.right, bottom = HEIGHT - PAD.bottom;
    place = {
      right, bottom,
      x: (v) => PAD.left + (right - PAD.left) * (v - fx.low) / (fx.high - fx.low),
      y: (v) => bottom - (bottom - PAD.top) * (v - fy.low) / (fy.high - fy.low),
      backX: (x) => fx.low + (x - PAD.left) / (right - PAD.left) * (fx.high - fx.low),
      backY: (y) => fy.low + (bottom - y) / (bottom - PAD.top) * (fy.high - fy.low),
      back: (event) => {
        const from = parts.box.getBoundingClientRect();
        return [place.backX(event.clientX - from.left), place.backY(event.clientY - from.top)];
      },
    };
    const box = svg("svg", { class: "map", width, height: HEIGHT, tabindex: "0", role: "img",
      "aria-label": `Contours of ${rsmkit.slice.chosen().title} over ${fx.label} and ${fy.label}; the arrow keys move the design` });
    parts = { box, bands: svg("g"), lines: svg("path", { class: "isolines" }), veil: svg("g", { class: "veil" }), limits: svg("g", { class: "limit-lines" }), beyond: svg("path", { class: "beyond" }), names: svg("g", { class: "limit-lines" }), stars: svg("g"),
      labels: svg("g", { class: "levels" }), ring: svg("circle", { class: "ring", r: 7 }) };
    const brushed = state.brush ? state.brush.points : [];
    box.append(parts.bands, parts.lines, parts.veil, parts.limits, parts.beyond, parts.labels, parts.names,
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
  function isInSlice(point) {
    const here = at([point[state.x], point[state.y]]);
    return here !== null && data.factors.every((f, j) => Math.abs(point[j] - here[j]) <= 1e-3 * (f.high - f.low));
  }

  function star(search) {
    const at = state.pointOf(search.factors);
    return rsmkit.maps.star(search, [place.x(at[state.x]), place.y(at[state.y])], isInSlice(at));
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
      const point = held && under(event);
      if (point) rsmkit.limits.set(held.subject, held.side, Number(held.subject.value(point).toPrecision(4)));
      else if (!held) goTo(place.back(event));
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

  // Where the sums do not allow both values, the design goes as far as it can, one factor after the other.
  function goTo(values) {
    const asked = [state.x, state.y].map((j, i) => state.snap(data.factors[j], values[i]));
    const point = at(asked) ?? rsmkit.sums.moved(rsmkit.sums.moved(state.point, state.x, asked[0]), state.y, asked[1]);
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
    return rsmkit.maps.edgeAt(edges, [x, y]);
  }

  // The point of the slice under the pointer.
  function under(event) {
    const inside = (v, j) => Math.min(data.factors[j].high, Math.max(data.factors[j].low, v));
    const values = place.back(event);
    return at([inside(values[0], state.x), inside(values[1], state.y)]);
  }

  // Says what lies under the pointer: a run near it, or else the prediction.
  function tell(event) {
    const from = parts.box.getBoundingClientRect();
    const near = data.points.findIndex((p) => Math.hypot(place.x(p[state.x]) + from.left - event.clientX,
      place.y(p[state.y]) + from.top - event.clientY) < 6);
    parts.box.style.cursor = edgeAt(event) ? "move" : "";
    const point = under(event);
    const snapped = point && at([state.x, state.y].map((j) => state.snap(data.factors[j], point[j])));
    const quantity = rsmkit.slice.chosen();
    readout.textContent = near < 0 ? (snapped ? sentence(snapped) : "No design: the sums cannot be kept there.")
      : `${data.kinds[near]} run ${near + 1}: ${data.factors.map((f, j) => `${f.label} ${factorValue(f, data.points[near][j])}`).join(", ")}: ` +
        `${quantity.title} ${number(quantity.observed[near])}`;
  }

  // Follows the design: the ring, and the levels and limits when another factor, or a limit, has moved.
  function move() {
    const here = [place.x(state.point[state.x]), place.y(state.point[state.y])];
    parts.ring.setAttribute("cx", here[0]);
    parts.ring.setAttribute("cy", here[1]);
    const name = rsmkit.slice.name() + JSON.stringify(state.limits);
    if (name === drawn) return;
    drawn = name;
    const { xs, ys, z, reach, room, low, high, fields } = rsmkit.slice.grid();
    const at = [rsmkit.maps.halved(xs).map((v) => +place.x(v).toFixed(1)), rsmkit.maps.halved(ys).map((v) => +place.y(v).toFixed(1))];
    const { levels, colours } = rsmkit.maps.shades({ low, high });
    const regions = levels.map((level) => rsmkit.bands.region(...reach(level), ...at));
    const whole = `M${at[0][0]} ${at[1][0]}H${at[0].at(-1)}V${at[1].at(-1)}H${at[0][0]}Z`;
    parts.beyond.setAttribute("d", room ? rsmkit.bands.region(rsmkit.bands.finer(room.map((row) => row.map((v) => -v))), Number.MIN_VALUE, ...at).fill : "");
    const isKnown = z.some((row) => row.some(Number.isFinite));
    parts.bands.replaceChildren(...(isKnown ? [whole, ...regions.map((r) => r.fill)].map((d, i) => svg("path", { d, fill: colours[i] }))
      : [svg("text", { class: "unknown", x: 0.5 * (PAD.left + place.right), y: 0.4 * HEIGHT, "text-anchor": "middle" }, "not evaluated in the page")]));
    parts.lines.setAttribute("d", regions.map((r) => r.edge).join(""));
    const isIn = (x, y) => !room || rsmkit.sums.placed(state.point, [[state.x, place.backX(x)], [state.y, place.backY(y)]]) !== null;
    const isWithin = (side, above, below) => ([x, y]) => isIn(x, y) && x > PAD.left + side && x < place.right - side && y > PAD.top + above && y < place.bottom - below;
    parts.stars.replaceChildren(...data.searches.map(star));
    edges = rsmkit.maps.forbidden(fields, (grid, level) => rsmkit.bands.region(grid, level, ...at)).map((edge) => inside(edge, isIn));
    parts.veil.replaceChildren(...edges.map(({ fill }) => svg("path", { d: fill })));
    const { lines, names, places } = rsmkit.maps.limitParts(edges, (at, text) => 6.4 * text.length < 0.55 * (place.right - PAD.left) && isWithin(8 + 3.2 * text.length, 14, 12)(at), here);
    parts.limits.replaceChildren(...lines);
    parts.names.replaceChildren(...names);
    parts.labels.replaceChildren(...rsmkit.maps.levelTexts(levels, regions, isWithin(22, 10, 8), [0.5 * place.right, 0.5 * place.bottom], places));
    told.replaceChildren(...rsmkit.maps.told(edges));
  }

  // A limit whose line lies beyond what the sums allow is kept, or broken, everywhere else.
  function inside(edge, isIn) {
    if (!data.equalities.length) return edge;
    const middles = edge.middles.filter(([x, y]) => isIn(x, y));
    if (middles.length || !edge.middles.length) return { ...edge, middles };
    return { ...edge, middles, edge: "", fill: rsmkit.limits.margin(edge.limit, state.point) < 0 ? edge.fill : "" };
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
