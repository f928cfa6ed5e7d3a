// Contours over three components of a mixture, on a triangle; everything else is held as in the current design, which can be
// dragged about, or moved with the arrow keys. The corners are blends in which one of the three takes all that the least
// amounts of the other two leave.
"use strict";

rsmkit.ternary = (function () {
  const { element, svg, section, choice, number, halfWidth, factorValue, tick, ticks, announce } = rsmkit.format;
  const CELLS = 24;  // along each side
  const LETTER = 6.6;  // pixels
  const RISE = Math.sqrt(0.75);  // height of a triangle with sides of one
  const MARGIN = { side: 52, top: 30, bottom: 46 }, LARGEST = 560;
  const SPOTS = ["top", "left", "right"];
  const SAME = 0.02;  // share of a factor's range within which a run counts as in this triangle
  let data, study, state, quantity, corners, readout, told, parts, at, drawn;
  let chosen = [];  // the three components: top, left, right
  let edges = [];  // of the limits, for dragging

  // Components that the triangle can show: of mixtures with three or more, in no other sum.
  const usable = () => data.mixtures.filter(({ components }) => components.length > 2 &&
    components.every((j) => data.equalities.filter(({ terms }) => terms.some(([i]) => i === j)).length === 1));

  function open() {
    ({ data, study, state } = rsmkit);
    const mixtures = usable();
    if (!mixtures.length) return;
    read();
    const names = mixtures.flatMap(({ components }) => components).map((j) => [String(j), data.factors[j].label]);
    quantity = choice("Show", [...study.quantities.map((q) => [q.key, q.title]), ["desirability", "overall desirability"]], state.quantity,
      (key) => state.set({ quantity: key }));
    corners = SPOTS.map((spot, i) => choice(spot, names, String(chosen[i]), (j) => pick(i, +j)));
    const host = element("div");
    readout = element("p", { class: "fine readout" });
    told = element("p", { class: "legend" });
    section("ternary", "Triangle of three components", element("div", { class: "bar" }, quantity, ...corners), host, told, readout,
      element("p", { class: "fine" }, "Other factors and components are held as in the current design, the red ring: drag it, or use the arrow " +
        "keys. Dots: runs with about the same values of what is held; hollow ones differ there, and stand where the proportions of the three put them; so do hollow stars, " +
        "optima outside this triangle. Colour fills what the bounds allow. Lines in colour: limits, with teeth on the forbidden side; drag " +
        "one, or type it below. Veiled: forbidden by some limit."));
    rsmkit.charts.add(host, { paint, move, keys: ["point", "quantity", "brush", "limits", "goals", "corners"], follows: ["point", "limits"] });
  }

  // A component at a corner changes places with the one that was there; one of another mixture brings its fellows.
  function pick(i, j) {
    const { components } = rsmkit.sums.mixtureOf(j);
    const before = chosen.indexOf(j);
    if (before >= 0) [chosen[before], chosen[i]] = [chosen[i], j];
    else if (components.includes(chosen[i])) chosen[i] = j;
    else {
      const rest = components.filter((other) => other !== j);
      chosen = SPOTS.map((_, k) => (k === i ? j : rest.shift()));
    }
    corners.forEach(({ select }, k) => { select.value = chosen[k]; });
    state.set({ corners: chosen.slice() });
  }

  // Takes the corners of the state where they make a triangle, the first three components where they do not.
  function read() {
    const fits = usable().some(({ components }) => state.corners.every((j) => components.includes(j)));
    chosen = fits && new Set(state.corners).size === 3 ? state.corners.slice() : usable()[0].components.slice(0, 3);
  }

  // The triangle through the current design: amounts at the sides, and how much more there is at a corner.
  function triangle() {
    const shared = chosen.reduce((sum, j) => sum + state.point[j], 0);
    let base = chosen.map((j) => Math.max(data.factors[j].low, 0));
    const least = base.reduce((sum, v) => sum + v, 0);
    if (!(shared - least > 1e-9 * Math.abs(shared))) base = [0, 0, 0];
    return { shared, base, span: shared - base.reduce((sum, v) => sum + v, 0) };
  }

  const amounts = ({ base, span }, shares) => shares.map((share, i) => base[i] + share * span);

  // Shares of the corners; another sum is brought to that of the triangle.
  function shares({ shared, base, span }, point) {
    const sum = chosen.reduce((amount, j) => amount + point[j], 0);
    return chosen.map((j, i) => (point[j] * (sum ? shared / sum : 0) - base[i]) / span);
  }

  function withAmounts(values) {
    const point = state.point.slice();
    chosen.forEach((j, i) => { point[j] = values[i]; });
    return point;
  }

  // Corners of what the bounds leave, as shares (Sutherland & Hodgman, Comm. ACM 17, 1974).
  function region({ base, span }) {
    let found = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    chosen.forEach((j, i) => {
      const { low, high } = data.factors[j];
      for (const [side, bound] of [[1, (low - base[i]) / span], [-1, (high - base[i]) / span]]) {
        const room = (corner) => side * (corner[i] - bound) + 1e-12;
        found = found.flatMap((a, k) => {
          const b = found[(k + 1) % found.length];
          const [from, to] = [room(a), room(b)];
          const crossing = from * to < 0 ? [a.map((v, c) => v + (b[c] - v) * from / (from - to))] : [];
          return from >= 0 ? [a, ...crossing] : crossing;
        });
      }
    });
    return found;
  }

  const isAllowed = (values, slack = 1e-9) => chosen.every((j, i) => {
    const { low, high } = data.factors[j];
    return values[i] >= low - slack * (high - low) && values[i] <= high + slack * (high - low);
  });

  // The nearest amounts inside the bounds with the same sum; what is held stays.
  function nearest(values) {
    const { shared } = triangle();
    const isHeld = chosen.map((j) => state.held.includes(j));
    const moved = (by) => values.map((v, i) => (isHeld[i] ? state.point[chosen[i]]
      : Math.min(data.factors[chosen[i]].high, Math.max(data.factors[chosen[i]].low, v + by))));
    const sum = (by) => moved(by).reduce((total, v) => total + v, 0);
    let [low, high] = [-2 * Math.abs(shared) - 1, 2 * Math.abs(shared) + 1].map((by) => by - 0);
    for (let i = 0; i < 100 && low < high; i++) {
      const middle = 0.5 * (low + high);
      if (sum(middle) < shared) low = middle;
      else high = middle;
    }
    const found = moved(high);
    return Math.abs(found.reduce((total, v) => total + v, -shared)) <= 1e-9 * Math.abs(shared) ? found : chosen.map((j) => state.point[j]);
  }

  const toPixels = ([top, , right]) => [at.left + at.side * (right + 0.5 * top), at.bottom - at.side * RISE * top];

  function toShares([x, y]) {
    const top = (at.bottom - y) / (at.side * RISE);
    const right = (x - at.left) / at.side - 0.5 * top;
    return [top, 1 - top - right, right];
  }

  // Builds the map anew: what does not depend on the design, and places for what does.
  function paint(host, width) {
    const focused = parts && document.activeElement === parts.box;
    const side = Math.min(LARGEST, width - 2 * MARGIN.side);
    const height = side * RISE + MARGIN.top + MARGIN.bottom;
    at = { side, left: (Math.min(width, LARGEST + 2 * MARGIN.side) - side) / 2, bottom: height - MARGIN.bottom };
    const names = chosen.map((j) => data.factors[j].label);
    const box = svg("svg", { class: "map", width: side + 2 * at.left, height, tabindex: "0", role: "img",
      "aria-label": `Contours of ${rsmkit.slice.chosen().title} over ${names.join(", ")}; the arrow keys move the design` });
    const clipped = { "clip-path": "url(#ternary-region)" };
    parts = { box, clip: svg("path"), bands: svg("g", clipped), lines: svg("path", { class: "isolines", ...clipped }), veil: svg("g", { class: "veil", ...clipped }),
      limits: svg("g", { class: "limit-lines", ...clipped }), names: svg("g", { class: "limit-lines" }), labels: svg("g", { class: "levels" }),
      bounds: svg("path", { class: "bounds" }), frame: svg("g"), dots: svg("g"), stars: svg("g"), ring: svg("circle", { class: "ring", r: 7 }) };
    box.append(svg("clipPath", { id: "ternary-region" }, parts.clip), parts.frame, parts.bands, parts.lines, parts.veil, parts.limits, parts.bounds,
      parts.labels, parts.names, parts.dots, parts.stars, parts.ring);
    listen(box);
    host.replaceChildren(box);
    if (focused) box.focus();
    drawn = "";
    move();
  }

  // What the map depends on; places within it do not count.
  function name() {
    const round = (v) => Number(v.toPrecision(10));
    const limited = rsmkit.limits.active().map(({ subject, side, limit }) => [subject.key, side, limit]);
    return JSON.stringify([state.quantity, state.quantity === "desirability" ? state.goals : "", limited, chosen, round(triangle().shared),
      state.point.filter((_, j) => !chosen.includes(j)).map(round), state.brush]);
  }

  function move() {
    const shape = triangle();
    const spot = toPixels(shares(shape, state.point));
    parts.ring.setAttribute("cx", spot[0]);
    parts.ring.setAttribute("cy", spot[1]);
    if (name() === drawn) return;
    drawn = name();
    const places = region(shape).map((corner) => toPixels(corner).map((v) => v.toFixed(1)).join(" "));
    const outline = places.length ? `M${places.join("L")}Z` : "";
    parts.clip.setAttribute("d", outline);
    parts.bounds.setAttribute("d", outline);
    parts.frame.replaceChildren(...frame(shape));
    fill(shape);
    parts.dots.replaceChildren(...runs(shape));
    parts.stars.replaceChildren(...data.searches.map((search) => {
      const point = state.pointOf(search.factors);
      return rsmkit.maps.star(search, toPixels(shares(shape, point)), isHere(point, shape));
    }));
  }

  // Shades, lines and limits. A grid over the shares of right and top corner, a cell beyond the side where the left one is nothing.
  function fill(shape) {
    const values = (measured) => Array.from({ length: CELLS + 1 }, (_, r) => Array.from({ length: CELLS + 1 }, (_, c) =>
      (r + c > CELLS + 2 ? NaN : measured.value(withAmounts(amounts(shape, [r / CELLS, 1 - (r + c) / CELLS, c / CELLS]))))));
    const { z, reach } = rsmkit.cliffs.drawn(rsmkit.slice.chosen(), values);
    const seen = z.flatMap((row, r) => row.filter((v, c) => Number.isFinite(v) &&
      isAllowed(amounts(shape, [r / CELLS, 1 - (r + c) / CELLS, c / CELLS]))));
    seen.push(...region(shape).map((corner) => rsmkit.slice.chosen().value(withAmounts(amounts(shape, corner)))).filter(Number.isFinite));
    const [low, high] = seen.length ? [Math.min(...seen), Math.max(...seen)] : [0, 1];
    const { levels, colours } = rsmkit.maps.shades({ low, high: high > low ? high : low + (Math.abs(low) || 1) });
    const nodes = rsmkit.maps.halved(Array.from({ length: CELLS + 1 }, (_, i) => i / CELLS));
    const [xs, ys] = [nodes.map((v) => at.left + at.side * v), nodes.map((v) => at.bottom - at.side * RISE * v)];
    const trace = (grid, level) => rsmkit.bands.region(grid, level, xs, ys, -0.5 / RISE);
    const regions = levels.map((level) => trace(...reach(level)));
    const whole = `M${[[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((corner) => toPixels(corner).join(" ")).join("L")}Z`;
    parts.bands.replaceChildren(...[whole, ...regions.map((r) => r.fill)].map((d, i) => svg("path", { d, fill: colours[i] })));
    parts.lines.setAttribute("d", regions.map((r) => r.edge).join(""));
    const isClear = (side) => ([x, y]) => [[-side, 0], [side, 0], [0, -8], [0, 8]].every(([dx, dy]) => isAllowed(amounts(shape, toShares([x + dx, y + dy]))));
    const isReadable = (spot, text) => 3.2 * text.length < 0.3 * at.side && isClear(24)(spot);  // longer names stand below alone
    const middle = [at.left + 0.5 * at.side, at.bottom - 0.4 * RISE * at.side];
    const isSeen = ([x, y]) => isAllowed(amounts(shape, toShares([x, y])));
    const fields = new Map(rsmkit.limits.active().map(({ subject }) => [subject.key, subject])
      .map(([key, subject]) => [key, values(subject)]));
    edges = rsmkit.maps.forbidden(fields, trace).map((edge) => ({ ...edge, middles: edge.middles.filter(isSeen) }))
      .map((edge) => (edge.middles.length ? edge : settled(edge, shape)));
    parts.veil.replaceChildren(...edges.map(({ fill: d }) => svg("path", { d })));
    const { lines, names, places } = rsmkit.maps.limitParts(edges, isReadable, toPixels(shares(shape, state.point)));
    parts.limits.replaceChildren(...lines);
    parts.names.replaceChildren(...names);
    parts.labels.replaceChildren(...rsmkit.maps.levelTexts(levels, regions, isClear(12), middle, places));
    told.replaceChildren(...rsmkit.maps.told(edges));
  }

  // A limit whose line does not cross what the bounds allow is kept, or broken, everywhere there.
  function settled(edge, shape) {
    const inside = region(shape);
    if (!inside.length) return edge;
    const centre = inside[0].map((_, i) => inside.reduce((sum, corner) => sum + corner[i], 0) / inside.length);
    const isKept = !(rsmkit.limits.margin(edge.limit, withAmounts(amounts(shape, centre))) < 0);
    return { ...edge, edge: "", fill: isKept ? "" : edge.fill };
  }

  // Lines across at round amounts with their numbers along the sides, and the names at the corners.
  function frame({ base, span }) {
    const outside = [[-6, 4, "end"], [0, 15, "middle"], [7, -2, "start"]];
    const found = [svg("path", { class: "axis", d: `M${[[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((corner) => toPixels(corner).join(" ")).join("L")}Z` })];
    chosen.forEach((_, i) => {
      for (const amount of ticks(base[i], base[i] + span, at.side < 300 ? 3 : 5)) {
        const share = (amount - base[i]) / span;
        if (share < 1e-6 || share > 1 - 1e-6) continue;
        const ends = [1, 2].map((step) => [0, 1, 2].map((k) => (k === i ? share : k === (i + step) % 3 ? 1 - share : 0))).map(toPixels);
        found.push(svg("path", { class: "crossing", d: `M${ends[0].join(" ")}L${ends[1].join(" ")}` }));
        const [dx, dy, anchor] = outside[i];
        found.push(svg("text", { x: ends[0][0] + dx, y: ends[0][1] + dy, "text-anchor": anchor }, tick(amount)));
      }
    });
    const title = (i, x, y) => {
      const text = data.factors[chosen[i]].title, half = 0.5 * LETTER * text.length, width = at.side + 2 * at.left;
      return svg("text", { x: Math.max(half, Math.min(width - half, x)), y, "text-anchor": "middle", class: "axis-name" }, text);
    };
    const [top, left, right] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(toPixels);
    return [...found, title(0, top[0], top[1] - 10), title(1, left[0], left[1] + 32), title(2, right[0], right[1] + 32)];
  }

  // Whether what is held is the same for a point, within rounding for optima and a little for runs.
  function isHere(point, { shared }, slack = 1e-3) {
    const sum = chosen.reduce((total, j) => total + point[j], 0);
    return Math.abs(sum - shared) <= slack * Math.abs(rsmkit.sums.mixtureOf(chosen[0]).total) && data.factors.every((f, j) =>
      chosen.includes(j) || Math.abs(point[j] - state.point[j]) <= slack * (f.high - f.low));
  }

  function runs(shape) {
    const places = (points) => points.filter((point) => chosen.reduce((sum, j) => sum + point[j], 0) > 0).map((point) => [point, shares(shape, point)])
      .filter(([, place]) => place.every((v) => v > -1e-9)).map(([point, place]) => [point, toPixels(place).map((v) => v.toFixed(1))]);
    const all = places(data.points);
    const dots = (list) => list.map(([, [x, y]]) => `M${x} ${y}h0`).join("");
    const rings = (list) => list.map(([, [x, y]]) => `M${x - 2.5} ${y}a2.5 2.5 0 1 0 5 0a2.5 2.5 0 1 0 -5 0`).join("");
    const here = all.filter(([point]) => isHere(point, shape, SAME)), away = all.filter(([point]) => !isHere(point, shape, SAME));
    return [svg("path", { class: "hollow", d: rings(away) }), svg("path", { class: "dot-edge", d: dots(here) }), svg("path", { class: "dot", d: dots(here) }),
      svg("path", { class: "lit-dot", d: dots(places(state.brush ? state.brush.points : [])) })];
  }

  const pixels = (event) => {
    const from = parts.box.getBoundingClientRect();
    return [event.clientX - from.left, event.clientY - from.top];
  };

  function listen(box) {
    let held = null;  // the limit that is being dragged
    box.addEventListener("pointerdown", (event) => {
      box.setPointerCapture(event.pointerId);
      held = edgeAt(pixels(event));
      if (!held) state.set({ point: under(pixels(event)) });
    });
    box.addEventListener("pointermove", (event) => {
      const spot = pixels(event);
      if (!box.hasPointerCapture(event.pointerId)) { tell(spot); return; }
      if (held) rsmkit.limits.set(held.subject, held.side, Number(held.subject.value(under(spot)).toPrecision(4)));
      else state.set({ point: under(spot) });
    });
    box.addEventListener("pointerleave", () => { readout.textContent = ""; });
    box.addEventListener("keydown", (event) => {
      const step = triangle().span / 100;
      const moves = { ArrowRight: [0, -step, step], ArrowLeft: [0, step, -step], ArrowUp: [step, -step / 2, -step / 2], ArrowDown: [-step, step / 2, step / 2] };
      if (!moves[event.key]) return;
      state.set({ point: withAmounts(nearest(chosen.map((j, i) => state.point[j] + moves[event.key][i]))) });
      state.flush();
      announce(sentence(state.point));
      event.preventDefault();
    });
  }

  // The design of the triangle under a place, or nearest to it.
  const under = (spot) => withAmounts(nearest(amounts(triangle(), toShares(spot))));

  // The limit whose line is there, unless the ring is nearer.
  function edgeAt([x, y]) {
    const ring = toPixels(shares(triangle(), state.point));
    return Math.hypot(ring[0] - x, ring[1] - y) < 12 ? null : rsmkit.maps.edgeAt(edges, [x, y]);
  }

  function sentence(point) {
    const shown = rsmkit.slice.chosen();
    const half = halfWidth(shown.interval(point));
    const spread = half > 0 && Number.isFinite(half) ? ` ± ${number(half, half)}` : "";
    return `${chosen.map((j) => `${data.factors[j].label} ${factorValue(data.factors[j], point[j])}`).join(", ")}: ` +
      `${shown.title} ${number(shown.value(point), half)}${spread}`;
  }

  // Says what lies under the pointer: a run near it, or else the prediction.
  function tell([x, y]) {
    const shape = triangle();
    parts.box.style.cursor = edgeAt([x, y]) ? "move" : "";
    const near = data.points.findIndex((point) => {
      const [px, py] = toPixels(shares(shape, point));
      return Math.hypot(px - x, py - y) < 6;
    });
    readout.textContent = near >= 0
      ? `${data.kinds[near]} run ${near + 1}: ${data.factors.map((f, j) => `${f.label} ${factorValue(f, data.points[near][j])}`).join(", ")}: ` +
        `${rsmkit.slice.chosen().title} ${number(rsmkit.slice.chosen().observed[near])}`
      : isAllowed(amounts(shape, toShares([x, y]))) ? sentence(under([x, y])) : "";
  }

  function update(keys) {
    if (!quantity) return;
    if (keys.has("quantity")) quantity.select.value = state.quantity;
    if (!keys.has("corners")) return;
    read();
    corners.forEach(({ select }, k) => { select.value = chosen[k]; });
  }

  return { open, update };
})();
