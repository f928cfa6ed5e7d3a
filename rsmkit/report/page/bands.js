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

  // Where values on a grid (rows along y) reach a level: the region as one path, its edge as another, and the middle
  // of every piece of the edge. Cells of one row that lie inside are joined.
  function region(values, level, xs, ys) {
    let fill = "", edge = "";
    const middles = [];
    for (let r = 0; r + 1 < ys.length; r++) {
      let from = -1;
      const close = (to) => {
        if (from >= 0) fill += `M${xs[from]} ${ys[r]}H${xs[to]}V${ys[r + 1]}H${xs[from]}Z`;
        from = -1;
      };
      for (let c = 0; c + 1 < xs.length; c++) {
        const corners = [values[r][c], values[r][c + 1], values[r + 1][c + 1], values[r + 1][c]];
        const inside = corners.reduce((n, v) => n + (v >= level), 0);
        if (inside === 4) { if (from < 0) from = c; continue; }
        close(c);
        if (inside === 0) continue;
        const crossings = [];
        const outline = [];
        for (let k = 0; k < 4; k++) {
          const [v, next] = [corners[k], corners[(k + 1) % 4]];
          const at = [[xs[c], ys[r]], [xs[c + 1], ys[r]], [xs[c + 1], ys[r + 1]], [xs[c], ys[r + 1]]];
          if (v >= level) outline.push(at[k]);
          if ((v >= level) === (next >= level)) continue;
          const share = (level - v) / (next - v), to = at[(k + 1) % 4];
          const place = Number.isFinite(share) ? [0, 1].map((i) => at[k][i] + share * (to[i] - at[k][i])) : to;
          outline.push(place);
          crossings.push(place);
        }
        fill += `M${outline.map(written).join("L")}Z`;
        for (let k = 0; k + 1 < crossings.length; k += 2) {
          edge += `M${written(crossings[k])}L${written(crossings[k + 1])}`;
          middles.push([0, 1].map((i) => 0.5 * (crossings[k][i] + crossings[k + 1][i])));
        }
      }
      close(xs.length - 1);
    }
    return { fill, edge, middles };
  }

  const written = ([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`;

  return { colour, css, region };
})();
