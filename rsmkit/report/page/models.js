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

  // A polynomial in working coordinates: { predict(point), leverage(point), halfWidth(point) }.
  function polynomial(model) {
    const { levels, center, half_range: half, coefficients, factor } = model;
    const products = model.columns.map((powers) =>
      powers.flatMap((power, variable) => Array(power).fill(variable)));
    const count = products.length;
    const row = new Float64Array(count);
    const variables = new Float64Array(model.columns[0].length);

    function fillRow(point) {
      let v = 0;
      for (let j = 0; j < levels.length; j++) {
        if (levels[j]) {
          for (let level = 1; level < levels[j]; level++) {
            variables[v++] = Math.round(point[j]) === level ? 1 : 0;
          }
        } else {
          variables[v++] = (point[j] - center[j]) / half[j];
        }
      }
      for (let i = 0; i < count; i++) {
        let value = 1;
        for (const variable of products[i]) value *= variables[variable];
        row[i] = value;
      }
    }

    function predict(point) {
      fillRow(point);
      let sum = 0;
      for (let i = 0; i < count; i++) sum += row[i] * coefficients[i];
      return sum;
    }

    function leverage(point) {
      fillRow(point);
      let sum = 0;
      for (let c = 0; c < factor[0].length; c++) {
        let inner = 0;
        for (let i = 0; i < count; i++) inner += row[i] * factor[i][c];
        sum += inner * inner;
      }
      return sum;
    }

    // Half the prediction interval of one new run; Infinity when no degrees of freedom are left.
    function halfWidth(point) {
      if (model.sigma === null) return Infinity;
      return model.quantile * model.sigma * Math.sqrt(leverage(point) + 1);
    }

    return { predict, leverage, halfWidth, largestLeverage: model.largest_leverage };
  }

  const kinds = { polynomial };

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

  // All quantities of a study: responses, then objectives, each with value(point) and halfWidth(point).
  function build(data) {
    const responses = new Map(data.responses.map((r) => [r.key, kinds[r.model.kind](r.model)]));
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
        halfWidth: surface.halfWidth, surface };
    });
    for (const o of data.objectives) {
      const formula = compileFormula(o.formula);
      const own = o.model ? kinds[o.model.kind](o.model) : null;
      const value = (point) => formula(lookupAt(point));
      quantities.push({ key: o.key, title: o.title, kind: "objective", value,
        observed: data.points.map((point, i) => formula((name) => observedAt(name, point, i))),
        halfWidth: own ? own.halfWidth : () => NaN, surface: own });
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

    // Largest leverage of the point over that of any run: above 1 the surfaces extrapolate.
    function reach(point) {
      return Math.max(...[...responses.values()].map((s) => s.leverage(point) / s.largestLeverage));
    }

    // Worst constraint margin; NaN where it cannot be known in the page.
    const margin = (point) => margins.length ? Math.min(...margins.map((m) => m.value(point))) : 1;

    return { quantities, margins, margin, reach };
  }

  return { build, compileFormula, interpolator };
})();
