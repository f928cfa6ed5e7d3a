// Colours of a quantity, and the regions and lines of equal value on a grid.
"use strict";

rsmkit.bands = (function () {
  // Viridis (Smith & van der Walt 2015) at eleven places.
  const VIRIDIS = [[68, 1, 84], [72, 36, 117], [65, 68, 135], [53, 95, 141], [42, 120, 142], [33, 145, 140], [34, 168, 132],
    [68, 191, 112], [122, 209, 81], [189, 223, 38], [253, 231, 37]];

  // Red, green and blue of a share between 0 and 1.
  function colour(share) {
    const place = Math.min(1, Math.max(0, share)) * (VIRIDIS.length - 1);
    const i = Math.min(VIRIDIS.length - 2, Math.floor(place));
    return VIRIDIS[i].map((v, c) => v + (place - i) * (VIRIDIS[i + 1][c] - v));
  }

  const css = (rgb) => `rgb(${rgb.map(Math.round).join(",")})`;

  // Goes over the cells of a grid (rows along y) that reach a level somewhere: use(r, c, outline, crossings) gets the part
  // of the cell at or above the level in grid units, null where it is the whole cell, and where its edge crosses the sides.
  function walk(values, level, use) {
    for (let r = 0; r + 1 < values.length; r++) {
      for (let c = 0; c + 1 < values[r].length; c++) {
        const corners = [values[r][c], values[r][c + 1], values[r + 1][c + 1], values[r + 1][c]];
        const inside = corners.reduce((n, v) => n + (v >= level), 0);
        if (inside === 0) continue;
        if (inside === 4) { use(r, c, null, []); continue; }
        const at = [[c, r], [c + 1, r], [c + 1, r + 1], [c, r + 1]];
        const crossings = [];
        const outline = [];
        for (let k = 0; k < 4; k++) {
          const [v, next] = [corners[k], corners[(k + 1) % 4]];
          if (v >= level) outline.push(at[k]);
          if ((v >= level) === (next >= level)) continue;
          const share = (level - v) / (next - v), to = at[(k + 1) % 4];
          const place = Number.isFinite(share) ? [0, 1].map((i) => at[k][i] + share * (to[i] - at[k][i])) : to;
          outline.push(place);
          crossings.push(place);
        }
        use(r, c, outline, crossings);
      }
    }
  }

  // Where values on a grid reach a level, with the places of its nodes in pixels: the region as one path, its edge as
  // another, and for every piece of the edge its middle and the direction in which the values rise. Cells of one row that
  // lie inside are joined. With a shear, places move across by that times how far they are from the first row.
  function region(values, level, xs, ys, shear = 0) {
    let fill = "", edge = "", from = -1, row = -1, to = -1;
    const middles = [];
    const close = () => {
      const corners = [[from, row], [to, row], [to, row + 1], [from, row + 1]];
      if (from >= 0) fill += `M${corners.map((place) => written(pixels(place))).join("L")}Z`;
      from = -1;
    };
    const between = (nodes, v) => nodes[Math.floor(v)] + (v % 1 ? (v % 1) * (nodes[Math.floor(v) + 1] - nodes[Math.floor(v)]) : 0);
    const pixels = ([x, y]) => [between(xs, x) + shear * (between(ys, y) - ys[0]), between(ys, y)];
    walk(values, level, (r, c, outline, crossings) => {
      if (from >= 0 && (r !== row || c !== to || outline)) close();
      if (!outline) {
        if (from < 0) [from, row] = [c, r];
        to = c + 1;
        return;
      }
      fill += `M${outline.map((place) => written(pixels(place))).join("L")}Z`;
      const [a, b, d, e] = [values[r][c], values[r][c + 1], values[r + 1][c + 1], values[r + 1][c]];
      const rise = [(b - a + d - e) / (xs[c + 1] - xs[c]), (e - a + d - b) / (ys[r + 1] - ys[r])];
      rise[1] -= shear * rise[0];
      const length = Math.hypot(...rise) || 1;
      for (let k = 0; k + 1 < crossings.length; k += 2) {
        const ends = [pixels(crossings[k]), pixels(crossings[k + 1])];
        edge += `M${written(ends[0])}L${written(ends[1])}`;
        middles.push([0.5 * (ends[0][0] + ends[1][0]), 0.5 * (ends[0][1] + ends[1][1]), rise[0] / length, rise[1] / length]);
      }
    });
    close();
    return { fill, edge, middles };
  }

  // A grid of twice as many cells each way, the values between as the curvature asks: what is smooth looks smooth.
  const finer = (values) => transposed(transposed(values.map(doubled)).map(doubled));

  const transposed = (values) => values[0].map((_, c) => values.map((row) => row[c]));

  // Middles lie off the chord by an eighth of the second difference: of the smaller one of both sides, so that nothing
  // swings over at an edge.
  function doubled(v) {
    const last = v.length - 1;
    const found = [v[0]];
    for (let i = 0; i < last; i++) {
      const [before, after] = [bend(v, Math.max(1, i)), bend(v, Math.min(last - 1, i + 1))];
      const least = before * after > 0 ? Math.sign(before) * Math.min(Math.abs(before), Math.abs(after)) : 0;
      found.push((v[i] + v[i + 1]) / 2 - least / 8);
      found.push(v[i + 1]);
    }
    return found;
  }

  const written = ([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`;

  const bend = (v, i) => (i > 0 && i + 1 < v.length ? v[i - 1] - 2 * v[i] + v[i + 1] : 0);

  return { colour, css, walk, region, finer };
})();
