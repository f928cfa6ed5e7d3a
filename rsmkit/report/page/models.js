// Evaluates the fitted surfaces and the study's formulas. Term order, coordinates and coefficients come from the
// data, so that the numbers are Python's. Points are arrays in natural units, one entry per factor; a
// categorical factor's entry is the index of its level.
"use strict";
var rsmkit = {};

rsmkit.models = (function () {
  const constants = { pi: Math.PI };
  const operations = {
    "+": (...x) => x.reduce((a, b) => a + b),
    "-": (a, b) => a - b,
    "*": (a, b) => a * b,
    "/": (a, b) => a / b,
    "**": (a, b) => Math.pow(a, b),
    neg: (a) => -a,
    min: Math.min,
    max: Math.max,
    abs: Math.abs, sqrt: Math.sqrt, exp: Math.exp, log: Math.log, log10: Math.log10,
    sin: Math.sin, cos: Math.cos, tan: Math.tan, tanh: Math.tanh,
  };

  // Turns a nested-list formula into a function of a lookup (name -> number).
  function compileFormula(formula) {
    if (typeof formula === "number") return () => formula;
    if (typeof formula === "string") {
      return formula in constants ? () => constants[formula] : (lookup) => lookup(formula);
    }
    const operation = operations[formula[0]];
    const parts = formula.slice(1).map(compileFormula);
    if (parts.length === 1) return (lookup) => operation(parts[0](lookup));
    if (parts.length === 2) return (lookup) => operation(parts[0](lookup), parts[1](lookup));
    return (lookup) => operation(...parts.map((part) => part(lookup)));
  }

  // Every surface gives predict(point), interval(point, noise) = [low, high] of one new run, or with noise 0 of the mean, reach(point): what is
  // unknown there over the most that is unknown at any run (above 1 the surface extrapolates); and the same along
  // a line, means(point, j, values) and intervals(point, j, values, noise), or at any points, intervalsAt(points, noise),
  // where that can be had for less.

  function polynomial(model) {
    const { levels, center, half_range: half, coefficients, shifts } = model;
    const products = model.columns.map((powers) =>
      powers.flatMap((power, variable) => Array(power).fill(variable)));
    const count = products.length;
    const rows = new Float64Array(model.factor.length);  // the terms, then the stretch parameters
    const columns = model.factor[0].map((_, c) => {  // without the zeros at their ends: the factor is triangular
      const column = model.factor.map((row) => row[c]);
      return Float64Array.from(column.slice(0, column.findLastIndex((v) => v !== 0) + 1));
    });
    const z = new Float64Array(levels.length);
    const variables = new Float64Array(model.columns[0].length);

    function fillRow(point) {
      for (let j = 0; j < levels.length; j++) {
        z[j] = levels[j] ? point[j] : rsmkit.stretches.apply(model.stretches[j], (point[j] - center[j]) / half[j]);
      }
      fillTerms();
    }

    function fillTerms() {
      let v = 0;
      for (let j = 0; j < levels.length; j++) {
        if (!levels[j]) variables[v++] = z[j];
        for (let level = 1; level < levels[j]; level++) variables[v++] = Math.round(z[j]) === level ? 1 : 0;
      }
      for (let i = 0; i < count; i++) {
        let value = 1;
        for (const variable of products[i]) value *= variables[variable];
        rows[i] = value;
      }
    }

    function sum() {
      let total = 0;
      for (let i = 0; i < count; i++) total += rows[i] * coefficients[i];
      return total;
    }

    function predict(point) {
      fillRow(point);
      return sum();
    }

    // Derivative of the prediction by the parameter of a stretch.
    function slope(point, { factor: j, plus, minus, step }) {
      const [above, below] = [plus, minus].map((stretch) => {
        fillRow(point);
        z[j] = rsmkit.stretches.apply(stretch, (point[j] - center[j]) / half[j]);
        fillTerms();
        return sum();
      });
      return (above - below) / (2 * step);
    }

    function leverage(point) {
      shifts.forEach((shift, c) => { rows[count + c] = slope(point, shift); });
      fillRow(point);
      let total = 0;
      for (const column of columns) {
        let inner = 0;
        for (let i = 0; i < column.length; i++) inner += rows[i] * column[i];
        total += inner * inner;
      }
      return total;
    }

    // `more` is a variance beside that of a run.
    function interval(point, noise = 1, more = 0) {
      if (model.sigma === null) return [-Infinity, Infinity];
      const half = model.quantile * Math.sqrt(model.sigma ** 2 * (leverage(point) + noise) + more);
      const mean = predict(point);
      return [mean - half, mean + half];
    }

    // Value of other coefficients, those of stretches among them, in place of the fitted ones.
    function combination(point, others) {
      leverage(point);  // fills the row of the stretches too
      return others.reduce((total, value, i) => total + rows[i] * value, 0);
    }

    return withLines({ predict, interval, leverage, combination, reach: (point) => leverage(point) / model.largest_leverage });
  }

  // The values of a function along a line parallel to the axis of factor j.
  const along = (f) => (point, j, values) => {
    const moved = point.slice();
    return values.map((value) => { moved[j] = value; return f(moved); });
  };

  // Adds the functions along a line to a surface that has no better way than point by point.
  function withLines(surface) {
    const intervals = (point, j, values, noise) => along((moved) => surface.interval(moved, noise))(point, j, values);
    const intervalsAt = (points, noise) => points.map((point) => surface.interval(point, noise));
    return { means: along(surface.predict), intervals, intervalsAt, ...surface };
  }

  // A polynomial of the transformed response.
  function boxCox({ power, largest, change, power_error: error, inner }) {
    const surface = polynomial(inner);
    const back = (v) => (power === 0 ? Math.exp(v) : Math.max(1 + power * v, 0) ** (1 / power));
    // Derivative of the transformed response by the power.
    function moved(v) {
      if (power === 0) return 0.5 * v * v;
      const u = Math.max(1 + power * v, 1e-300);
      return (u * Math.log(u) - u + 1) / power ** 2;
    }
    function interval(point, noise = 1) {
      if (inner.sigma === null) return [0, Infinity];
      const away = surface.combination(point, change) - moved(surface.predict(point));
      return surface.interval(point, noise, (error * away) ** 2).map(back);
    }
    return withLines({ predict: (point) => Math.min(back(surface.predict(point)), largest), interval,
      reach: surface.reach });
  }

  const LANES = 8;  // points that go through a Cholesky factor together

  // Numbers from base64 of little-endian doubles.
  function unpacked(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    return Float64Array.from({ length: bytes.length / 8 }, (_, i) => view.getFloat64(8 * i, true));
  }

  // The rows of a lower triangle that stand one after the other.
  function triangle(numbers) {
    const rows = [];
    for (let at = 0; at < numbers.length; at += rows.length) rows.push(numbers.subarray(at, at + rows.length + 1));
    return rows;
  }

  function gaussianProcess(model) {
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

  const glm = (model) => withLines(rsmkit.counts.surface(model, polynomial(model.inner)));

  const kinds = { polynomial, "box-cox": boxCox, "gaussian process": gaussianProcess, glm };

  // A surface of a kind that cannot be evaluated here: nothing is known of it but its runs.
  const undrawn = withLines({ predict: () => NaN, interval: () => [NaN, NaN], reach: () => 0 });

  const surfaceOf = (model) => (model ? kinds[model.kind](model) : undrawn);

  const MOST_CUBIC = 3;  // axes of a table along which cubics are passed: four nodes each

  // Interpolation in a table { factors, axes, values } (row-major): by cubics through the nearest four nodes of each axis
  // (Lagrange), or linearly where axes are many or have few nodes.
  function interpolator({ factors, axes, values }) {
    const strides = axes.map((_, a) => axes.slice(a + 1).reduce((n, axis) => n * axis.length, 1));
    return function (point) {
      let corners = [[0, 1]];
      axes.forEach((axis, a) => {
        const at = Math.min(axis.at(-1), Math.max(axis[0], point[factors[a]]));
        const count = Math.min(axis.length, axes.length <= MOST_CUBIC ? 4 : 2);
        const next = axis.findIndex((node) => node > at);
        const before = next < 0 ? axis.length - 2 : next - 1;
        const first = Math.min(axis.length - count, Math.max(0, before - count / 2 + 1));
        const nodes = axis.slice(first, first + count);
        const weights = nodes.map((node, i) => nodes.reduce((w, other, k) => (k === i ? w : w * (at - other) / (node - other)), 1));
        corners = corners.flatMap(([place, weight]) => weights.map((w, i) => [place + (first + i) * strides[a], weight * w]))
          .filter(([, weight]) => weight !== 0);
      });
      return corners.reduce((sum, [place, weight]) => sum + weight * (values[place] ?? NaN), 0);
    };
  }

  // Least and largest value over the box, as far as its runs, its corners and the middles of its faces tell.
  function rangeOf(quantity, { factors, points }) {
    const inside = (point) => factors.every((f, j) => point[j] >= f.low && point[j] <= f.high);
    const seen = quantity.observed.filter((v, i) => v !== null && inside(points[i]));
    const middle = factors.map((f) => (f.numeric ? (f.low + f.high) / 2 : 0));
    const looked = [middle];
    factors.forEach((f, j) => [f.low, f.high].forEach((end) => looked.push(middle.map((v, i) => (i === j ? end : v)))));
    for (let corner = 0; corner < 2 ** Math.min(factors.length, 10); corner++) {
      looked.push(factors.map((f, j) => ((corner >> j) & 1 ? f.high : f.low)));
    }
    const values = [...seen, ...looked.map(rsmkit.sums.repaired).map(quantity.value)].filter(Number.isFinite);
    return values.length ? [Math.min(...values), Math.max(...values)] : [0, 1];
  }

  // All quantities of a study: responses, then objectives, each with value(point) and interval(point), and along
  // a line values(point, j, values) and intervals(point, j, values), at points intervalsAt(points).
  function build(data) {
    const responses = new Map(data.responses.map((r) => [r.key, surfaceOf(r.model)]));
    const position = new Map(data.factors.map((factor, j) => [factor.name, j]));
    const functions = new Map(Object.entries(data.functions)
      .filter(([, table]) => table !== null)
      .map(([name, table]) => [name, interpolator(table)]));

    function lookupAt(point) {
      return (name) => {
        if (responses.has(name)) return responses.get(name).predict(point);
        if (position.has(name)) return point[position.get(name)];
        return functions.has(name) ? functions.get(name)(point) : NaN;
      };
    }

    // A formula along a line, from the responses along that line.
    const lineOf = (formula) => (point, j, values) => {
      const lines = new Map();
      const moved = point.slice();
      return values.map((value, p) => {
        moved[j] = value;
        const rest = lookupAt(moved);
        return formula((name) => {
          if (!responses.has(name)) return rest(name);
          if (!lines.has(name)) lines.set(name, responses.get(name).means(point, j, values));
          return lines.get(name)[p];
        });
      });
    };

    const quantities = data.responses.map((r) => {
      const surface = responses.get(r.key);
      return { key: r.key, title: r.title, kind: "response", observed: r.observed, value: surface.predict,
        interval: surface.interval, values: surface.means, intervals: surface.intervals, intervalsAt: surface.intervalsAt };
    });
    for (const o of data.objectives) {
      const formula = compileFormula(o.formula);
      const own = o.model ? surfaceOf(o.model) : null;
      const value = (point) => formula(lookupAt(point));
      quantities.push({ key: o.key, title: o.title, kind: "objective", value,
        observed: data.points.map((point, i) => formula((name) => observedAt(name, point, i))),
        interval: own ? own.interval : () => [NaN, NaN], values: lineOf(formula),
        intervals: own ? own.intervals : (point, j, values) => values.map(() => [NaN, NaN]),
        intervalsAt: own ? own.intervalsAt : (points) => points.map(() => [NaN, NaN]) });
    }

    function observedAt(name, point, i) {
      const response = data.responses.find((r) => r.key === name);
      return response ? response.observed[i] : lookupAt(point)(name);
    }

    for (const quantity of quantities) quantity.range = rangeOf(quantity, data);

    // What can be limited: whatever the constraints limit, then every other response. given: lower and upper limit
    // of the study, null for none.
    const subjects = new Map();
    for (const { subject, formula, side, limit } of data.constraints.flatMap((constraint) => constraint.limits)) {
      if (!subjects.has(subject)) subjects.set(subject, subjectOf(subject, compileFormula(formula), functionsIn(formula)));
      const { given } = subjects.get(subject);
      if (side === "low") given[0] = Math.max(given[0] ?? -Infinity, limit);
      else given[1] = Math.min(given[1] ?? Infinity, limit);
    }
    for (const { key } of data.responses) {
      if (!subjects.has(key)) subjects.set(key, subjectOf(key, (lookup) => lookup(key), false));
    }

    function functionsIn(formula) {
      return Array.isArray(formula) ? formula.slice(1).some(functionsIn) : formula in data.functions;
    }

    // A table is exact to about a thousandth, the surfaces to rounding; an optimum lies on its limits to about 1e-8.
    function subjectOf(key, formula, isTabulated) {
      const value = (point) => formula(lookupAt(point));
      const seen = data.points.map(value).filter(Number.isFinite);
      const spread = seen.length ? Math.max(...seen) - Math.min(...seen) : 1;
      return { key, title: data.responses.find((r) => r.key === key)?.title ?? key, value, values: lineOf(formula), given: [null, null],
        spread, tolerance: (isTabulated ? 1e-3 : 1e-6) * spread };
    }

    // Above 1 at least one surface extrapolates.
    const reach = (point) => Math.max(...[...responses.values()].map((surface) => surface.reach(point)));

    return { quantities, subjects: [...subjects.values()], reach };
  }

  return { build, compileFormula, surfaceOf, along };
})();
