// Desirability: goals for several quantities combined into one number between 0 and 1 (Derringer & Suich 1980).
"use strict";

rsmkit.goals = (function () {
  const STARTS = 5;  // points refined
  const SCATTERED = 400;  // points tried before

  const wishes = () => rsmkit.study.quantities.filter((q) => rsmkit.state.goals[q.key]);

  // Geometric mean of the single desirabilities, linear between the least and the largest value in the box.
  function desirability(point) {
    const wished = wishes();
    let product = 1;
    for (const quantity of wished) {
      const [low, high] = quantity.range;
      const share = Math.min(1, Math.max(0, (quantity.value(point) - low) / (high - low || 1)));
      product *= rsmkit.state.goals[quantity.key] === "max" ? share : 1 - share;
    }
    return product ** (1 / wished.length);
  }

  // What the search maximises: infeasible points count by how far they miss.
  function score(point) {
    const { broken } = rsmkit.limits.judged(point);
    return broken.length ? Math.min(...broken.map(({ margin, subject }) => margin / (subject.spread || 1))) : desirability(point);
  }

  // The feasible point of greatest desirability: scattered and known points, the best refined by shrinking steps.
  function bestPoint() {
    const { factors, points, searches } = rsmkit.data;
    const { snap, pointOf } = rsmkit.state;
    const inside = (point) => point.map((v, j) => snap(factors[j], v));
    const scattered = Array.from({ length: SCATTERED }, (_, i) =>
      factors.map((f, j) => f.low + (f.high - f.low) * ((0.5 + (i + 1) * step(j, factors.length)) % 1)));
    const known = [...points, ...searches.map((search) => pointOf(search.factors))];
    const tried = [rsmkit.state.point, ...known, ...scattered].map(inside).map((point) => [score(point), point]);
    const starts = tried.sort((a, b) => b[0] - a[0]).slice(0, STARTS).map(([, point]) => point);
    return starts.map((start) => refine(start, inside)).sort((a, b) => score(b) - score(a))[0];
  }

  // Steps of the additive recurrence that spreads points evenly in any dimension (Roberts 2018).
  function step(j, k) {
    let ratio = 2;
    for (let i = 0; i < 30; i++) ratio = (1 + ratio) ** (1 / (k + 1));
    return (1 / ratio) ** (j + 1);
  }

  function refine(start, inside) {
    const { factors } = rsmkit.data;
    let best = start, value = score(start), size = 0.25;
    while (size > 1e-5) {
      let better = false;
      for (let j = 0; j < factors.length; j++) {
        for (const sign of [1, -1]) {
          const moved = best.slice();
          moved[j] += factors[j].continuous ? sign * size * (factors[j].high - factors[j].low) : sign;
          const tried = inside(moved), found = score(tried);
          if (found > value) [best, value, better] = [tried, found, true];
        }
      }
      if (!better) size /= 2;
    }
    return best;
  }

  // Desirability as one more quantity, for the profiler.
  const quantity = () => ({ key: "desirability", title: "desirability", value: desirability, interval: () => [NaN, NaN],
    values: rsmkit.models.along(desirability), intervals: (point, j, values) => values.map(() => [NaN, NaN]),
    observed: rsmkit.data.points.map(() => null), range: [0, 1] });

  return { wishes, desirability, bestPoint, quantity };
})();
