// Gaussian processes: predictions and variances from their runs, weights and Cholesky factors.
"use strict";

rsmkit.processes = (function () {
  const LANES = 8;  // points that go through a Cholesky factor together

  // The rows of a lower triangle that stand one after the other.
  function triangle(numbers) {
    const rows = [];
    for (let at = 0; at < numbers.length; at += rows.length) rows.push(numbers.subarray(at, at + rows.length + 1));
    return rows;
  }

  function surface(model) {
    const { unpacked } = rsmkit.models;
    const { levels, center, half_range: half, lengths, weights } = model;
    const width = lengths.length;
    const runs = unpacked(model.runs);
    const count = runs.length / width;
    const cholesky = triangle(unpacked(model.cholesky));
    const scaled = new Float64Array(width);
    const squares = new Float64Array(count);  // squared distances of the runs from a point
    const across = new Float64Array(count);  // their correlations with it

    // Columns of a point: numeric factors on [-1, 1], then indicators of levels, all in correlation lengths.
    function fillScaled(point) {
      let c = 0;
      for (let j = 0; j < levels.length; j++) if (!levels[j]) scaled[c++] = (point[j] - center[j]) / half[j];
      for (let j = 0; j < levels.length; j++) {
        for (let i = 0; i < levels[j]; i++) scaled[c++] = Math.round(point[j]) === i ? 1 : 0;
      }
      for (c = 0; c < width; c++) scaled[c] /= lengths[c];
    }

    function fillSquares(point) {
      fillScaled(point);
      for (let i = 0, at = 0; i < count; i++) {
        let square = 0;
        for (let c = 0; c < width; c++, at++) square += (scaled[c] - runs[at]) * (scaled[c] - runs[at]);
        squares[i] = square;
      }
    }

    function correlation(square) {
      if (model.kernel === "rbf") return Math.exp(-0.5 * square);
      const r = Math.sqrt(5 * square);
      return (1 + r + r * r / 3) * Math.exp(-r);
    }

    function meanOf(correlations) {
      let sum = 0;
      for (let i = 0; i < count; i++) sum += correlations[i] * weights[i];
      return model.mean + sum;
    }

    function predict(point) {
      fillSquares(point);
      for (let i = 0; i < count; i++) across[i] = correlation(squares[i]);
      return meanOf(across);
    }

    // Variances that the runs leave at up to LANES points, as parts of the process variance, from the correlations of
    // each run with all of them: forward substitution in the Cholesky factor, all points in registers. An estimated mean
    // is a last row, for which the table holds ones, and adds to the variance.
    function variances(table) {
      const left = new Float64Array(LANES).fill(1);
      for (let i = 0, base = 0; i < cholesky.length; i++, base += LANES) {
        const row = cholesky[i];
        let v0 = table[base], v1 = table[base + 1], v2 = table[base + 2], v3 = table[base + 3];
        let v4 = table[base + 4], v5 = table[base + 5], v6 = table[base + 6], v7 = table[base + 7];
        for (let c = 0, at = 0; c < i; c++, at += LANES) {
          const f = row[c];
          v0 -= f * table[at]; v1 -= f * table[at + 1]; v2 -= f * table[at + 2]; v3 -= f * table[at + 3];
          v4 -= f * table[at + 4]; v5 -= f * table[at + 5]; v6 -= f * table[at + 6]; v7 -= f * table[at + 7];
        }
        table.set([v0, v1, v2, v3, v4, v5, v6, v7], base);
        for (let p = 0; p < LANES; p++) {
          const value = table[base + p] /= row[i];
          left[p] += i < count ? -value * value : value * value;
        }
      }
      return left.map((v) => Math.max(0, v));
    }

    const emptyTable = () => new Float64Array(LANES * cholesky.length).fill(1);

    // Mean and variance at a point; those of the point asked for last are known, as every view asks for the current design.
    let asked = null, found = null;
    function at(point) {
      if (asked?.every((v, j) => v === point[j])) return found;
      const mean = predict(point), table = emptyTable();
      for (let i = 0; i < count; i++) table[LANES * i] = across[i];
      [asked, found] = [point.slice(), { mean, left: variances(table)[0] }];
      return found;
    }

    const around = (mean, left, noise) => {
      const half = model.half_width * Math.sqrt(left + noise * model.nugget);
      return [mean - half, mean + half];
    };

    // Calls use(p, correlations) for each place on a line; only the moved column is computed anew.
    function walk(point, j, values, use) {
      const moved = point.slice();
      if (levels[j]) {
        values.forEach((value, p) => { moved[j] = value; predict(moved); use(p, across); });
        return;
      }
      const column = levels.slice(0, j).filter((level) => !level).length;
      moved[j] = center[j];
      fillSquares(moved);
      for (let i = 0; i < count; i++) squares[i] -= (scaled[column] - runs[i * width + column]) ** 2;
      values.forEach((value, p) => {
        const here = (value - center[j]) / half[j] / lengths[column];
        for (let i = 0; i < count; i++) {
          const step = here - runs[i * width + column];
          across[i] = correlation(Math.max(0, squares[i]) + step * step);
        }
        use(p, across);
      });
    }

    function means(point, j, values) {
      const found = [];
      walk(point, j, values, (p, correlations) => found.push(meanOf(correlations)));
      return found;
    }

    // Intervals at `count` points; visit(use) calls use(p, correlations) for each.
    function together(count, noise, visit) {
      const tables = Array.from({ length: Math.ceil(count / LANES) }, emptyTable);
      const middles = [];
      visit((p, correlations) => {
        middles.push(meanOf(correlations));
        const table = tables[Math.floor(p / LANES)];
        for (let i = 0, at = p % LANES; i < correlations.length; i++, at += LANES) table[at] = correlations[i];
      });
      const left = tables.map(variances);
      return middles.map((mean, p) => around(mean, left[Math.floor(p / LANES)][p % LANES], noise));
    }

    const intervals = (point, j, values, noise = 1) => together(values.length, noise, (use) => walk(point, j, values, use));

    const intervalsAt = (points, noise = 1) => together(points.length, noise, (use) => points.forEach((point, p) => {
      predict(point);
      use(p, across);
    }));

    const interval = (point, noise = 1) => around(at(point).mean, at(point).left, noise);

    const reach = (point) => (at(point).left + model.nugget) / model.largest_variance;

    return { predict, interval, reach, means, intervals, intervalsAt };
  }

  return { surface };
})();
