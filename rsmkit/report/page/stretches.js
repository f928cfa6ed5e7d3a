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

  // Regularised incomplete beta function by its continued fraction.
  function incompleteBeta(u, a, b) {
    if (u <= 0 || u >= 1) return u <= 0 ? 0 : 1;
    const { fraction } = rsmkit.student, { lnGamma } = rsmkit.counts;
    const front = Math.exp(a * Math.log(u) + b * Math.log1p(-u) - lnGamma(a) - lnGamma(b) + lnGamma(a + b));
    return u < (a + 1) / (a + b + 2) ? front * fraction(a, b, u) / a : 1 - front * fraction(b, a, 1 - u) / b;
  }

  const beta = (u, { parameters: [a, b] }) => incompleteBeta(u, Math.exp(a), Math.exp(b));

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

  // Derivatives of the maps by their parameters, written as in rsmkit.surfaces.estimation.stretch_changes.
  const NEAR = 0.5, COUNT = 10, BETA_STEP = 0.02, CENTRAL = [4 / 5, -1 / 5, 4 / 105, -1 / 280];
  const factorial = (n) => (n ? n * factorial(n - 1) : 1);
  const numbers = (count, f) => Array.from({ length: count }, (_, k) => f(k));
  const ODD = numbers(COUNT, (k) => 1 / factorial(2 * k + 1)), EVEN = numbers(COUNT, (k) => 1 / factorial(2 * k));
  const ATANH = numbers(2 * COUNT, (k) => 1 / (2 * k + 1));
  const polynomial = (coefficients, square) => coefficients.reduceRight((sum, c) => sum * square + c, 0);
  const near = (top, bottom, far) => (x) => (Math.abs(x) < NEAR ? polynomial(top, x * x) / polynomial(bottom, x * x) : far(x));
  const coth = near(EVEN.map((e, k) => e - ODD[k]), ODD, (x) => x / Math.tanh(x) - 1);  // x coth x - 1
  const sinh = near(ODD.map((o, k) => (k ? -o : 0)), ODD, (x) => x / Math.sinh(x) - 1);  // x / sinh x - 1
  const atanh = near(ATANH.map((a) => 1 - a), ATANH, (x) => x / ((1 - x) * (1 + x) * Math.atanh(x)) - 1);

  const exponentialChange = (u, a) =>
    (a === 0 ? 0.5 * u * (u - 1) : exponential(u, a) * (0.5 * (u - 1) + (coth(0.5 * a * u) - coth(0.5 * a)) / a));

  function powerChange(u, { parameters: [p], family, low, high }) {
    const c = family === "power" ? 0.5 : low / (high - low);
    const reach = Math.log1p(1 / c);
    return reach * exponentialChange(Math.log1p(u / c) / reach, p * reach);
  }

  function twosidedChange(u, stretch) {
    const [d] = stretch.parameters;
    if (d === 0) return 0;
    const x = d * (2 * u - 1);
    return (twosided(u, stretch) - 0.5) * (d > 0 ? sinh(x) - sinh(d) : coth(0.5 * x) - coth(0.5 * d)) / d;
  }

  function robertsChange(u, stretch) {
    const b = 1 + Math.exp(-stretch.parameters[0]);
    return (1 - b) * (1 - roberts(u, stretch)) * (atanh((1 - u) / b) - atanh(1 / b)) / b;
  }

  function interiorChange(u, stretch, i) {
    const [r, centre] = stretch.parameters;
    const rise = Math.expm1(r), fall = Math.expm1(-r), up = 1 + rise * centre, down = 1 + fall * centre;
    const middle = 0.5 * (Math.log1p(rise * centre) - Math.log1p(fall * centre));
    const w = u / centre - 1, k = Math.sinh(middle), root = Math.sqrt(1 + (w * k) ** 2), follows = 1 + w * Math.cosh(middle) / root;
    if (i === 0) return (0.5 * centre * ((1 + rise) / up + (1 + fall) / down) * follows - robertsInterior(u, stretch)) / r;
    return (0.5 * (rise / up - fall / down) * follows - k * u / (centre ** 2 * root)) / r;
  }

  function kumaraswamyChange(u, { parameters }, i) {
    if (u <= 0 || u >= 1) return 0;
    const [a, b] = parameters.map(Math.exp), log = Math.log(u), rest = -Math.expm1(a * log);
    return i ? -b * Math.log(rest) * rest ** b : a * b * log * (1 - rest) * rest ** (b - 1);
  }

  function betaChange(u, { parameters }, i) {
    const moved = (step) => incompleteBeta(u, ...parameters.map((p, k) => Math.exp(p) * (k === i ? Math.exp(step) : 1)));
    return CENTRAL.reduce((sum, weight, k) => sum + weight / BETA_STEP * (moved((k + 1) * BETA_STEP) - moved(-(k + 1) * BETA_STEP)), 0);
  }

  const changes = { exp: (u, stretch) => exponentialChange(u, stretch.parameters[0]), power: powerChange, natpower: powerChange,
    twosided: twosidedChange, roberts: robertsChange, roberts_interior: interiorChange, kumaraswamy: kumaraswamyChange, beta: betaChange };

  // Derivative of stretched z by a parameter; `ends` are those of the slopes beyond [0, 1].
  function change(stretch, { parameter, ends }, z) {
    const u = 0.5 * (z + 1);
    const inside = Math.min(1, Math.max(0, u));
    return 2 * (changes[stretch.family](inside, stretch, parameter) + ends[u < 0.5 ? 0 : 1] * (u - inside));
  }

  return { apply, change };
})();
