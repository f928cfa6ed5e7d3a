// Monotone maps of [0, 1] onto itself, one per stretched factor; the families and their formulas are those of
// rsmkit.surfaces.stretch. Outside [0, 1] they go on straight, with the slopes that come with the data.
"use strict";

rsmkit.stretches = (function () {
  // Parameters closer than these to the identity use the first Taylor terms.
  const SMALL = 1e-5, SMALL_TWOSIDED = 1e-4;

  const exponential = (u, a) =>
    (Math.abs(a) < SMALL ? u + 0.5 * a * u * (u - 1) : Math.expm1(a * u) / Math.expm1(a));

  function power(u, { parameters: [p], family, low, high }) {
    const c = family === "power" ? 0.5 : low / (high - low);
    const reach = Math.log1p(1 / c);
    return exponential(Math.log1p(u / c) / reach, p * reach);
  }

  function twosided(u, { parameters: [d] }) {
    const v = u - 0.5;
    if (Math.abs(d) < SMALL_TWOSIDED) return u + (d > 0 ? -1 / 3 : 1 / 6) * d * d * v * (v * v - 0.25);
    if (d > 0) return 0.5 * (1 + Math.tanh(d * v) / Math.tanh(0.5 * d));
    return 0.5 * (1 + Math.sinh(-d * v) / Math.sinh(-0.5 * d));
  }

  function roberts(u, { parameters: [q] }) {
    const b = 1 + Math.exp(-q);
    return 1 - Math.log((b + 1 - u) / (b - 1 + u)) / Math.log((b + 1) / (b - 1));
  }

  function robertsInterior(u, { parameters: [r, centre] }) {
    const b = 0.5 * (Math.log1p(Math.expm1(r) * centre) - Math.log1p(Math.expm1(-r) * centre)) / r;
    return b + Math.asinh((u / centre - 1) * Math.sinh(r * b)) / r;
  }

  function kumaraswamy(u, { parameters }) {
    const [a, b] = parameters.map(Math.exp);
    return -Math.expm1(b * Math.log1p(-(u ** a)));
  }

  // Regularised incomplete beta function by its continued fraction (Abramowitz & Stegun 26.5.8, modified Lentz).
  function beta(u, { parameters, log_beta: logBeta }) {
    const [a, b] = parameters.map(Math.exp);
    if (u <= 0 || u >= 1) return u <= 0 ? 0 : 1;
    const front = Math.exp(a * Math.log(u) + b * Math.log1p(-u) - logBeta);
    return u < (a + 1) / (a + b + 2) ? front * fraction(a, b, u) / a : 1 - front * fraction(b, a, 1 - u) / b;
  }

  function fraction(a, b, x) {
    const tiny = 1e-300;
    const away = (v) => (Math.abs(v) < tiny ? tiny : v);
    let c = 1, d = 1 / away(1 - (a + b) * x / (a + 1)), value = d;
    for (let m = 1; m < 500; m++) {
      for (const term of [m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m)),
        -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))]) {
        d = 1 / away(1 + term * d);
        c = away(1 + term / c);
        value *= c * d;
      }
      if (Math.abs(c * d - 1) < 1e-16) break;
    }
    return value;
  }

  function fixed(u, { low, high, formula }) {
    const raw = rsmkit.models.compileFormula(formula);
    const at = (v) => raw(() => low + v * (high - low));
    return (at(u) - at(0)) / (at(1) - at(0));
  }

  const families = { exp: (u, stretch) => exponential(u, stretch.parameters[0]), power, natpower: power, twosided, roberts,
    roberts_interior: robertsInterior, kumaraswamy, beta, fixed };

  // Takes z in [-1, 1] to stretched z; no stretch (null) changes nothing.
  function apply(stretch, z) {
    if (!stretch) return z;
    const u = 0.5 * (z + 1);
    const inside = Math.min(1, Math.max(0, u));
    const beyond = inside === u ? 0 : stretch.slopes[u < 0.5 ? 0 : 1] * (u - inside);
    return 2 * (families[stretch.family](inside, stretch) + beyond) - 1;
  }

  return { apply };
})();
