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

  // Every surface gives predict(point), interval(point) = [low, high] of one new run, and reach(point): what is
  // unknown there over the most that is unknown at any run (above 1 the surface extrapolates).

  function polynomial(model) {
    const { levels, center, half_range: half, coefficients, factor, shifts } = model;
    const products = model.columns.map((powers) =>
      powers.flatMap((power, variable) => Array(power).fill(variable)));
    const count = products.length;
    const rows = new Float64Array(factor.length);  // the terms, then the stretch parameters
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
      for (let c = 0; c < factor[0].length; c++) {
        let inner = 0;
        for (let i = 0; i < factor.length; i++) inner += rows[i] * factor[i][c];
        total += inner * inner;
      }
      return total;
    }

    function interval(point) {
      if (model.sigma === null) return [-Infinity, Infinity];
      const half = model.quantile * model.sigma * Math.sqrt(leverage(point) + 1);
      const mean = predict(point);
      return [mean - half, mean + half];
    }

    return { predict, interval, reach: (point) => leverage(point) / model.largest_leverage };
  }

  // A polynomial of the transformed response.
  function boxCox({ power, inner }) {
    const surface = polynomial(inner);
    const back = (v) => (power === 0 ? Math.exp(v) : Math.max(1 + power * v, 0) ** (1 / power));
    return { predict: (point) => back(surface.predict(point)), interval: (point) => surface.interval(point).map(back),
      reach: surface.reach };
  }

  function gaussianProcess(model) {
    const { levels, center, half_range: half, lengths, runs, weights, cholesky } = model;
    const across = new Float64Array(runs.length);
    const spread = new Float64Array(runs.length);

    function fillCorrelations(point) {
      const scaled = [];
      levels.forEach((level, j) => { if (!level) scaled.push((point[j] - center[j]) / half[j]); });
      levels.forEach((level, j) => {
        for (let i = 0; i < level; i++) scaled.push(Math.round(point[j]) === i ? 1 : 0);
      });
      for (let c = 0; c < scaled.length; c++) scaled[c] /= lengths[c];
      for (let i = 0; i < runs.length; i++) {
        let square = 0;
        for (let c = 0; c < scaled.length; c++) square += (scaled[c] - runs[i][c]) ** 2;
        const r = Math.sqrt(5 * square);
        across[i] = model.kernel === "rbf" ? Math.exp(-0.5 * square) : (1 + r + r * r / 3) * Math.exp(-r);
      }
    }

    function predict(point) {
      fillCorrelations(point);
      let sum = 0;
      for (let i = 0; i < runs.length; i++) sum += across[i] * weights[i];
      return model.mean + model.scale * sum;
    }

    // Variance that the runs leave, as a part of the process variance (forward substitution in its Cholesky factor).
    function variance(point) {
      fillCorrelations(point);
      let left = 1;
      for (let i = 0; i < runs.length; i++) {
        const row = cholesky[i];
        let value = across[i];
        for (let c = 0; c < i; c++) value -= row[c] * spread[c];
        spread[i] = value / row[i];
        left -= spread[i] * spread[i];
      }
      return Math.max(0, left);
    }

    function interval(point) {
      const half = model.half_width * Math.sqrt(variance(point) + model.nugget);
      const mean = predict(point);
      return [mean - half, mean + half];
    }

    return { predict, interval, reach: (point) => (variance(point) + model.nugget) / model.largest_variance };
  }

  const kinds = { polynomial, "box-cox": boxCox, "gaussian process": gaussianProcess };

  const surfaceOf = (model) => kinds[model.kind](model);

  // Multilinear interpolation in a table { axes, values } (row-major).
  function interpolator(table) {
    const { axes, values } = table;
    const strides = axes.map((_, j) => axes.slice(j + 1).reduce((n, axis) => n * axis.length, 1));
    return function (point) {
      let corners = [[0, 1]];
      axes.forEach((axis, j) => {
        let i = axis.findIndex((node) => node > point[j]) - 1;
        if (i < 0) i = point[j] < axis[0] ? 0 : axis.length - 2;
        const share = Math.min(1, Math.max(0, (point[j] - axis[i]) / (axis[i + 1] - axis[i])));
        corners = corners.flatMap(([at, weight]) => [
          [at + i * strides[j], weight * (1 - share)],
          [at + (i + 1) * strides[j], weight * share],
        ]).filter(([, weight]) => weight > 0);
      });
      return corners.reduce((sum, [at, weight]) => sum + weight * (values[at] ?? NaN), 0);
    };
  }

  // Least and largest value over the box, as far as its runs, its corners and the middles of its faces tell.
  function rangeOf(quantity, { factors, points }) {
    const inside = (point) => factors.every((f, j) => point[j] >= f.low && point[j] <= f.high);
    const seen = quantity.observed.filter((v, i) => v !== null && inside(points[i]));
    const middle = factors.map((f) => (f.kind === "categorical" ? 0 : (f.low + f.high) / 2));
    const looked = [middle];
    factors.forEach((f, j) => [f.low, f.high].forEach((end) => looked.push(middle.map((v, i) => (i === j ? end : v)))));
    for (let corner = 0; corner < 2 ** Math.min(factors.length, 10); corner++) {
      looked.push(factors.map((f, j) => ((corner >> j) & 1 ? f.high : f.low)));
    }
    const values = [...seen, ...looked.map(quantity.value)].filter(Number.isFinite);
    return values.length ? [Math.min(...values), Math.max(...values)] : [0, 1];
  }

  // All quantities of a study: responses, then objectives, each with value(point) and interval(point).
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

    const quantities = data.responses.map((r) => {
      const surface = responses.get(r.key);
      return { key: r.key, title: r.title, kind: "response", observed: r.observed, value: surface.predict,
        interval: surface.interval };
    });
    for (const o of data.objectives) {
      const formula = compileFormula(o.formula);
      const own = o.model ? surfaceOf(o.model) : null;
      const value = (point) => formula(lookupAt(point));
      quantities.push({ key: o.key, title: o.title, kind: "objective", value,
        observed: data.points.map((point, i) => formula((name) => observedAt(name, point, i))),
        interval: own ? own.interval : () => [NaN, NaN] });
    }

    function observedAt(name, point, i) {
      const response = data.responses.find((r) => r.key === name);
      return response ? response.observed[i] : lookupAt(point)(name);
    }

    const margins = data.constraints.map((constraint) => {
      const formulas = constraint.formulas.map(compileFormula);
      return { text: constraint.text,
        value: (point) => Math.min(...formulas.map((formula) => formula(lookupAt(point)))) };
    });

    for (const quantity of quantities) quantity.range = rangeOf(quantity, data);

    // Above 1 at least one surface extrapolates.
    const reach = (point) => Math.max(...[...responses.values()].map((surface) => surface.reach(point)));

    // Worst constraint margin; NaN where it cannot be known in the page.
    const margin = (point) => margins.length ? Math.min(...margins.map((m) => m.value(point))) : 1;

    return { quantities, margins, margin, reach };
  }

  return { build, compileFormula, surfaceOf };
})();
