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

  // Where values on a grid reach a level, with the places of its nodes in pixels: the region as one path, its edge inside
  // the grid as another, and for every piece of the edge its middle and the direction in which the values rise. With a
  // shear, places move across by that times how far they are from the first row. Where a value is not finite the region
  // ends at the last node that is.
  function region(values, level, xs, ys, shear = 0) {
    const rows = values.length + 2, columns = values[0].length + 2;  // with a rim of nodes that lie outside, so that every edge is closed
    const grid = new Float64Array(rows * columns).fill(-Infinity);
    values.forEach((row, r) => grid.set(row, (r + 1) * columns + 1));
    const { leads, cells } = edgesOf(grid, level, rows, columns);
    const x = [xs[0], ...xs, xs.at(-1)], y = [ys[0], ...ys, ys.at(-1)];
    // Sets `across` and `down` to where the edge crosses a side of the grid, and `rim` where that is at the rim.
    let across = 0, down = 0, rim = false;
    function go(side) {
      const node = side >> 1, r = Math.floor(node / columns), c = node - r * columns;
      const dr = side & 1, dc = 1 - dr;
      const first = grid[node], second = grid[node + (dr ? columns : 1)];
      const [inner, outer] = first >= level ? [first, second] : [second, first];
      let share = inner === Infinity ? 1 : outer > -Infinity ? (inner - level) / (inner - outer) : 0;
      if (inner !== first) share = 1 - share;
      down = y[r] + share * (y[r + dr] - y[r]);
      across = x[c] + share * (x[c + dc] - x[c]) + shear * (down - ys[0]);
      rim = r === 0 || c === 0 || r + dr === rows - 1 || c + dc === columns - 1;
    }
    let fill = "", edge = "";
    const middles = [];
    for (let start = 0; start < leads.length; start++) {
      if (leads[start] < 0) continue;
      go(start);
      let wasDrawn = false, pen = "M";
      for (let side = start; leads[side] >= 0;) {
        const fromX = across, fromY = down, wasRim = rim, next = leads[side];
        leads[side] = -1;
        go(next);
        const isDrawn = !wasRim && !rim;
        if (isDrawn) {
          edge += wasDrawn ? `L${tenths(across)} ${tenths(down)}` : `M${tenths(fromX)} ${tenths(fromY)}L${tenths(across)} ${tenths(down)}`;
          middles.push([0.5 * (fromX + across), 0.5 * (fromY + down), ...rise(cells[side])]);
        }
        fill += `${pen}${tenths(across)} ${tenths(down)}`;
        pen = "L";
        [side, wasDrawn] = [next, isDrawn];
      }
      fill += "Z";
    }
    return { fill, edge, middles };

    // The direction in which the values rise across a cell.
    function rise(cell) {
      const a = grid[cell], b = grid[cell + 1], d = grid[cell + columns + 1], e = grid[cell + columns];
      const r = Math.floor(cell / columns), c = cell - r * columns;
      const right = (b - a + d - e) / (x[c + 1] - x[c]), up = (e - a + d - b) / (y[r + 1] - y[r]) - shear * right;
      const length = Math.hypot(right, up) || 1;
      return [right / length, up / length];
    }
  }

  // How the edge of what reaches a level runs over a grid: for every side (2 * node for the one to the next column,
  // 2 * node + 1 for the one to the next row) the side that it leads to, or -1, and the cell between. Where two corners of
  // a cell reach the level across a diagonal they are joined.
  function edgesOf(grid, level, rows, columns) {
    const leads = new Int32Array(2 * rows * columns).fill(-1), cells = new Int32Array(2 * rows * columns);
    const sides = [0, 3, 2 * columns, 1];  // of a cell, in the order of its corners; the second belongs to the next node
    const corners = [false, false, false, false];
    for (let r = 0; r + 1 < rows; r++) {
      let b = grid[r * columns] >= level, d = grid[(r + 1) * columns] >= level;
      for (let cell = r * columns; cell < (r + 1) * columns - 1; cell++) {
        const a = b, e = d;
        b = grid[cell + 1] >= level;
        d = grid[cell + columns + 1] >= level;
        if (a === b && b === d && d === e) continue;
        corners[0] = a; corners[1] = b; corners[2] = d; corners[3] = e;
        for (let k = 0; k < 4; k++) {
          if (!corners[k] || corners[(k + 1) % 4]) continue;  // the edge leaves the region here, and comes back where a corner reaches the level again
          let back = (k + 1) % 4;
          while (!corners[(back + 1) % 4]) back = (back + 1) % 4;
          leads[2 * cell + sides[k]] = 2 * cell + sides[back];
          cells[2 * cell + sides[k]] = cell;
        }
      }
    }
    return { leads, cells };
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

  // To a tenth of a pixel; rounding a number is several times faster than toFixed.
  const tenths = (v) => Math.round(10 * v) / 10;

  const bend = (v, i) => (i > 0 && i + 1 < v.length ? v[i - 1] - 2 * v[i] + v[i + 1] : 0);

  return { colour, css, walk, region, finer, tenths };
})();
