// Polynomials of runs made in groups that are a sample: intervals of Kenward and Roger, whose degrees of freedom differ
// from point to point; those of rsmkit.surfaces.models.mixed.
"use strict";

rsmkit.mixed = (function () {
  const FELT = 1e-7;  // share of a variance that must not depend on what cannot be estimated

  // x' M x of a symmetric matrix, of which the rows up to the diagonal stand one after the other.
  function quadratic(triangle, x) {
    let total = 0;
    for (let i = 0, at = 0; i < x.length; i++) {
      let inner = 0;
      for (let j = 0; j < i; j++) inner += triangle[at++] * x[j];
      total += x[i] * (2 * inner + triangle[at++] * x[i]);
    }
    return total;
  }

  // `polynomial` is the surface of the fixed part.
  function surface(model, polynomial) {
    const { unpacked } = rsmkit.models;
    const { variances, spread, unknown, beyond, normal } = model;
    const [adjusted, known, ...changes] = model.matrices.map(unpacked);
    const total = variances.reduce((sum, v) => sum + v, 0);

    // Degrees of freedom of a variance with its slopes by those of groups and runs.
    function degrees(value, slopes) {
      const felt = unknown.some((direction) => Math.abs(slopes.reduce((sum, s, i) => sum + s * direction[i], 0)) * variances.at(-1) > FELT * value);
      if (felt || !(value > 0)) return NaN;
      const error = slopes.reduce((sum, s, i) => sum + s * slopes.reduce((inner, r, j) => inner + spread[i][j] * r, 0), 0);
      return 2 * value * value / error;
    }

    function interval(point, noise = 1) {
      const row = polynomial.row(point);
      const df = degrees(quadratic(known, row) + noise * total, changes.map((change) => quadratic(change, row) + noise));
      const half = rsmkit.student.quantile(Math.min(df, 1e12), beyond, normal) * Math.sqrt(quadratic(adjusted, row) + noise * total);
      const mean = polynomial.predict(point);
      return [mean - half, mean + half];
    }

    const reach = (point) => quadratic(adjusted, polynomial.row(point)) / model.largest;

    return { predict: polynomial.predict, means: polynomial.means, interval, reach };
  }

  return { surface };
})();
