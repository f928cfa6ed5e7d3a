// What maps of contours have in common, over two factors as on a triangle: shades, levels on their lines, limits with teeth, stars.
"use strict";

rsmkit.maps = (function () {
  const { element, svg, tick, ticks } = rsmkit.format;
  const LINES = 14;
  const LETTER = 6.4;  // pixels

  // Round levels between the least and the largest value, with the colour of what lies from each to the next; the first
  // colour is that of what lies below the first level.
  function shades({ low, high }) {
    const levels = ticks(low, high, LINES).filter((level) => level > low + 1e-9 * (high - low));  // nothing lies below the least value
    const step = levels[1] - levels[0] || high - low;
    const colours = [levels[0] - step, ...levels].map((level) => rsmkit.bands.css(rsmkit.bands.colour((level + 0.5 * step - low) / (high - low))));
    return { levels, colours };
  }

  // Every level on its line, far from the levels written before and from names [x, y, half width], and near the middle of the map.
  function levelTexts(levels, regions, isClear, middle, names = []) {
    const taken = names.flatMap(([x, y, half]) => [-1, -0.5, 0, 0.5, 1].map((share) => [x + share * half, y]));
    const room = (at) => taken.reduce((least, t) => Math.min(least, Math.hypot(t[0] - at[0], 2 * (t[1] - at[1]))), 60) -
      0.06 * Math.hypot(at[0] - middle[0], at[1] - middle[1]);
    return levels.flatMap((level, i) => {
      const best = regions[i].middles.filter(isClear).reduce((kept, at) => (room(at) > kept[0] ? [room(at), at] : kept), [18, null])[1];
      if (!best) return [];
      taken.push(best);
      return [svg("text", { x: best[0].toFixed(1), y: (best[1] + 3.5).toFixed(1), "text-anchor": "middle" }, tick(level))];
    });
  }

  // Where each limit that holds now forbids: `fields` maps subjects to grids, `trace(grid, level)` finds regions on them.
  function forbidden(fields, trace) {
    const finer = new Map([...fields].map(([key, grid]) => [key, rsmkit.bands.finer(grid)]));
    return rsmkit.limits.active().map((limit) => ({ limit,
      ...trace(finer.get(limit.subject.key).map((row) => row.map((v) => -limit.sign * v)), -limit.sign * limit.limit + Number.MIN_VALUE) }));
  }

  // Every limit's line with teeth on the forbidden side, and its name where there is room, far from others and from the ring.
  function limitParts(edges, isClear, ring) {
    const taken = [[...ring, 10]];
    const lines = [], names = [];
    for (const { limit, edge, middles } of edges) {
      let teeth = "", last = null;
      for (const [x, y, right, down] of middles) {
        if (!Number.isFinite(right) || (last && Math.hypot(x - last[0], y - last[1]) < 9)) continue;
        teeth += `M${x.toFixed(1)} ${y.toFixed(1)}l${(6 * right).toFixed(1)} ${(6 * down).toFixed(1)}`;
        last = [x, y];
      }
      const clear = middles.filter((m) => isClear(m, limit.text) && taken.every(([a, b, half]) => Math.abs(a - m[0]) > half + 0.5 * LETTER * limit.text.length || Math.abs(b - m[1]) > 16));
      const room = (m, i) => taken.reduce((least, t) => Math.min(least, Math.hypot(t[0] - m[0], 2 * (t[1] - m[1]))), 120) - 40 * Math.abs(i / clear.length - 0.5);
      const spot = clear.map((m, i) => [room(m, i), m]).reduce((kept, one) => (one[0] > kept[0] ? one : kept), [-Infinity, null])[1];
      lines.push(svg("path", { class: "casing", d: edge }), svg("path", { d: edge + teeth, stroke: limit.colour }));
      if (!spot) continue;
      taken.push([...spot.slice(0, 2), 0.5 * LETTER * limit.text.length]);
      names.push(svg("text", { x: spot[0].toFixed(1), y: (spot[1] - 5).toFixed(1), "text-anchor": "middle", style: `fill:${limit.colour}` }, limit.text));
    }
    return { lines, names, places: taken };
  }

  // The limits in words below a map.
  const told = (edges) => edges.map(({ limit, edge, fill }) => element("span", { class: "key", style: `--key:${limit.colour}` },
    limit.text + (edge ? "" : fill ? ": nowhere kept here" : whole(limit))));

  const whole = ({ subject }) => (Number.isFinite(subject.value(rsmkit.state.point)) ? ": kept everywhere here"
    : ": cannot be shown, it depends on what the page cannot evaluate");

  // The limit whose line passes a place in pixels.
  function edgeAt(edges, [x, y]) {
    const away = ({ middles }) => middles.reduce((least, m) => Math.min(least, Math.hypot(m[0] - x, m[1] - y)), Infinity);
    const nearest = edges.reduce((best, edge) => (away(edge) < away(best) ? edge : best), { middles: [] });
    return away(nearest) < 9 ? nearest.limit : null;
  }

  function star(search, [x, y], isHere) {
    const corners = Array.from({ length: 10 }, (_, i) => {
      const [angle, size] = [Math.PI * (i / 5 - 0.5), i % 2 ? 4 : 9.5];
      return `${(x + size * Math.cos(angle)).toFixed(1)} ${(y + size * Math.sin(angle)).toFixed(1)}`;
    });
    return svg("path", { class: isHere ? "star" : "star away", d: `M${corners.join("L")}Z` }, svg("title", {}, `optimum ${search.name}`));
  }

  // Nodes and the middles between them.
  const halved = (nodes) => nodes.flatMap((v, i) => (i ? [0.5 * (nodes[i - 1] + v), v] : [v]));

  return { shades, levelTexts, forbidden, limitParts, told, edgeAt, star, halved };
})();
