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
    const rows = new Float64Array(model.factor.rows);  // the terms, then the stretch parameters
    const columns = columnsOf(model.factor);
    const variables = new Float64Array(model.columns[0].length);

    // The variables of each factor, and the terms that they are in.
    const first = levels.map((_, j) => levels.slice(0, j).reduce((v, count) => v + (count ? count - 1 : 1), 0));
    const touched = levels.map((count, j) => products.flatMap((variables, i) =>
      (variables.some((v) => v >= first[j] && v < first[j] + (count ? count - 1 : 1)) ? [i] : [])));

    function place(j, coordinate) {
      if (!levels[j]) variables[first[j]] = coordinate;
      for (let level = 1; level < levels[j]; level++) variables[first[j] + level - 1] = Math.round(coordinate) === level ? 1 : 0;
    }

    const coordinateOf = (j, value) => (levels[j] ? value : rsmkit.stretches.apply(model.stretches[j], (value - center[j]) / half[j]));

    function fillRow(point) {
      for (let j = 0; j < levels.length; j++) place(j, coordinateOf(j, point[j]));
      fillTerms();
    }

    function fillTerm(i) {
      let value = 1;
      for (const variable of products[i]) value *= variables[variable];
      rows[i] = value;
    }

    function fillTerms() {
      for (let i = 0; i < count; i++) fillTerm(i);
    }

    // Goes along a line parallel to the axis of a factor: only the terms that it is in change.
    function walk(point, j, values, use) {
      fillRow(point);
      values.forEach((value, p) => {
        place(j, coordinateOf(j, value));
        for (const i of touched[j]) fillTerm(i);
        use(p);
      });
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

    // The terms at a point.
    function row(point) {
      fillRow(point);
      return rows.slice(0, count);
    }

    // Of the terms that a stretched factor is in: what is left of each without one of the factor, and how often it is there.
    const lowered = shifts.map(({ factor: j }) => touched[j].map((i) => {
      const others = products[i].slice();
      others.splice(others.indexOf(first[j]), 1);
      return { i, others, power: products[i].length - products[i].filter((v) => v !== first[j]).length };
    }));

    // Derivative of the prediction by the parameter of a stretch; the variables are those of the point.
    function slope(point, shift, c) {
      const { factor: j } = shift;
      let total = 0;
      for (const { i, others, power } of lowered[c]) {
        let value = power * coefficients[i];
        for (const variable of others) value *= variables[variable];
        total += value;
      }
      return total * rsmkit.stretches.change(model.stretches[j], shift, (point[j] - center[j]) / half[j]);
    }

    function leverage(point) {
      fillRow(point);
      shifts.forEach((shift, c) => { rows[count + c] = slope(point, shift, c); });
      let total = 0;
      for (const column of columns) total += project(column) ** 2;
      return total;
    }

    function project(column) {
      let inner = 0;
      for (let i = 0; i < column.length; i++) inner += rows[i] * column[i];
      return inner;
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

    function means(point, j, values) {
      const found = [];
      walk(point, j, values, () => found.push(sum()));
      return found;
    }

    // The first column that a term is in.
    const reached = products.map((_, i) => columns.findIndex((column) => i < column.length && column[i] !== 0)).map((c) => (c < 0 ? columns.length : c));

    // The row of a point and its projection; those of the point asked for last are known, as every profile starts there.
    let asked = null, known = null;
    function startOf(point) {
      if (asked?.every((v, j) => v === point[j])) return known;
      fillRow(point);
      [asked, known] = [point.slice(), { start: rows.slice(), projected: Float64Array.from(columns, project) }];
      return known;
    }

    // Leverages along a line, from what the terms that change add to the projection of the row of its point.
    function intervals(point, j, values, noise = 1) {
      if (shifts.length || model.sigma === null) return along((moved) => interval(moved, noise))(point, j, values);
      const { start, projected } = startOf(point), found = [];
      walk(point, j, values, () => {
        const moved = projected.slice();
        for (const i of touched[j]) {
          const change = rows[i] - start[i];
          if (change) for (let c = reached[i]; c < columns.length; c++) if (i < columns[c].length) moved[c] += change * columns[c][i];
        }
        const half = model.quantile * model.sigma * Math.sqrt(moved.reduce((total, v) => total + v * v, 0) + noise);
        found.push([sum() - half, sum() + half]);
      });
      return found;
    }

    return withLines({ predict, row, interval, leverage, combination, means, intervals, reach: (point) => leverage(point) / model.largest_leverage });
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

  // Of ((1 + x) log(1 + x) - x) / x^2.
  const SERIES = Array.from({ length: 16 }, (_, k) => (-1) ** k / ((k + 1) * (k + 2)));

  // A polynomial of the transformed response.
  function boxCox({ power, largest, change, power_error: error, inner }) {
    const surface = polynomial(inner);
    const back = (v) => (power === 0 ? Math.exp(v) : Math.exp(Math.log(Math.max(1 + power * v, 0)) / power));
    // Derivative of the transformed response by the power: v^2 (x - log1p x + x log1p x) / x^2 at x = power v.
    function moved(v) {
      const x = Math.max(power * v, -1 + 1e-16);
      if (Math.abs(x) < 0.1) return v * v * SERIES.reduceRight((sum, c) => sum * x + c, 0);
      return ((1 + x) * Math.log1p(x) - x) / power ** 2;
    }
    function interval(point, noise = 1) {
      if (inner.sigma === null) return [0, Infinity];
      const away = surface.combination(point, change) - moved(surface.predict(point));
      return surface.interval(point, noise, (error * away) ** 2).map(back);
    }
    return withLines({ predict: (point) => Math.min(back(surface.predict(point)), largest), interval,
      reach: surface.reach });
  }

  // Columns that stand one after the other; surfaces with the same runs and terms share theirs.
  function columnsOf({ lengths, packed }) {
    const numbers = unpacked(typeof packed === "number" ? rsmkit.data.packed[packed] : packed);
    let end = 0;
    return lengths.map((length) => numbers.subarray(end, end += length));
  }

  // Numbers from base64 of little-endian doubles.
  function unpacked(text) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    return Float64Array.from({ length: bytes.length / 8 }, (_, i) => view.getFloat64(8 * i, true));
  }

  const glm = (model) => withLines(rsmkit.counts.surface(model, polynomial(model.inner)));

  const mixed = (model) => withLines(rsmkit.mixed.surface(model, polynomial(model.inner)));

  const kinds = { polynomial, mixed, "box-cox": boxCox, "gaussian process": (model) => rsmkit.processes.surface(model), glm };

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

  return { build, compileFormula, surfaceOf, along, unpacked };
})();
