// Quantiles of Student's t for any degrees of freedom, to rounding.
"use strict";

rsmkit.student = (function () {
  const MANY = 2000;  // degrees of freedom from which the expansion about the normal law is exact to rounding

  // Coefficients of z, z^3, z^5, ... in the terms of 1 / df, 1 / df^2, ... (Abramowitz & Stegun 26.7.5).
  const ABOUT_NORMAL = [[1 / 4, 1 / 4], [3 / 96, 16 / 96, 5 / 96], [-15 / 384, 17 / 384, 19 / 384, 3 / 384],
    [-945 / 92160, -1920 / 92160, 1482 / 92160, 776 / 92160, 79 / 92160]];

  function expansion(z, df) {
    return ABOUT_NORMAL.reduce((total, row, i) => total + row.reduceRight((sum, c) => sum * z * z + c, 0) * z / df ** (i + 1), z);
  }

  // Gamma(a + 1/2) / Gamma(a), by its asymptotic series above 12.
  function gammaRatio(a) {
    let factor = 1;
    for (; a < 12; a++) factor *= a / (a + 0.5);
    const s = 1 / (a * a);
    return factor * Math.sqrt(a) * Math.exp((-1 / 8 + s * (1 / 192 - s * (1 / 640 - s * (17 / 14336 - s * 31 / 18432)))) / a);
  }

  // Of the regularised incomplete beta function (Abramowitz & Stegun 26.5.8, modified Lentz).
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

  // Probability beyond t > 0.
  function tail(t, df, density) {
    const a = 0.5 * df, whole = df + t * t, x = df / whole, rest = t * t / whole;
    // front = x^a (1 - x)^(1/2) / B(a, 1/2), which is t times the density
    if (x < (a + 1) / (a + 2.5)) return 0.5 * t * density * fraction(a, 0.5, x) / a;
    return 0.5 - t * density * fraction(0.5, a, rest);
  }

  // Where `beyond` of the law lies further out; `z` is that quantile of the normal law. Newton's method in logarithms, in which
  // tails are nearly straight.
  function quantile(df, beyond, z) {
    if (!(df > 0)) return Infinity;
    if (df >= MANY) return expansion(z, df);
    const front = gammaRatio(0.5 * df) / Math.sqrt(Math.PI * df);
    let t = df > 3 ? expansion(z, df) : z;
    for (let i = 0; i < 60; i++) {
      const density = front * Math.exp(-0.5 * (df + 1) * Math.log1p(t * t / df));
      const left = tail(t, df, density);
      const step = left * Math.log(left / beyond) / (t * density);
      t *= Math.exp(Math.min(3, Math.max(-3, step)));
      if (Math.abs(step) < 1e-9) break;  // squared by this step
    }
    return t;
  }

  return { quantile, fraction };
})();
