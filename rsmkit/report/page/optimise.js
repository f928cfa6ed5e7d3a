// The search of the page: the best design for the goals within the limits. Desirabilities have edges (at a target, at
// the ends of a scale) where gradients jump; in their place stand variables t, each at most its ramp, so that all is smooth:
//   maximise the sum of c log t, with t <= ramp(value), t <= 1, and every limit kept
// by an augmented Lagrangian (Nocedal & Wright 2006, ch. 17) whose inner problem is solved in the box by BFGS.
"use strict";

rsmkit.optimise = (function () {
  const SCATTERED = 400;  // points tried before
  const STARTS = 4;
  const STEP = 1e-4;  // of derivatives, in shares of a factor's range
  const LEAST = 1e-9;  // least t

  // What is to be done as numbers: functions of the values at a point. `values(point)` lists what everything else is made of.
  function posed() {
    const { study, goals, limits } = rsmkit;
    const wishes = goals.wishes().map((quantity) => ({ quantity, wish: goals.full(quantity) }));
    const counted = wishes.filter(({ wish }) => wish.goal !== "range");
    const total = counted.reduce((sum, { wish }) => sum + wish.importance, 0) || 1;
    const measured = [];
    const measure = (value, spread) => { measured.push(value); return { at: measured.length - 1, spread: spread || 1 }; };
    const gaps = [];  // kept where sign * (value - limit) / spread >= 0
    const gap = ({ at, spread }, sign, limit) => gaps.push({ at, sign, limit, spread });
    for (const { subject, sign, limit } of limits.active()) {
      if (Number.isFinite(subject.value(rsmkit.state.point))) gap(measure(subject.value, subject.spread), sign, limit);
    }
    for (const sum of rsmkit.data.equalities) {  // kept from both sides
      const place = measure((point) => limits.away(sum, point), 1);
      gap(place, 1, 0);
      gap(place, -1, 0);
    }
    const ramps = [];  // t <= (value - from) / length
    let plain = null;  // one quantity to minimise, or with sign -1 to maximise, as it is
    for (const { quantity, wish } of wishes) {
      const [low, high] = quantity.range;
      const place = measure(quantity.value, high - low);
      if (wish.goal === "range") { gap(place, 1, wish.low); gap(place, -1, wish.high); continue; }
      const isPlain = counted.length === 1 && wish.goal !== "target" && rsmkit.state.goals[quantity.key].low === undefined &&
        rsmkit.state.goals[quantity.key].high === undefined;
      if (isPlain) { plain = { ...place, sign: wish.goal === "min" ? 1 : -1 }; continue; }
      const share = wish.importance / total;
      if (wish.goal === "max") ramps.push({ at: place.at, from: wish.low, length: wish.high - wish.low, power: wish.weight * share });
      if (wish.goal === "min") ramps.push({ at: place.at, from: wish.high, length: wish.low - wish.high, power: wish.weight * share });
      if (wish.goal !== "target") continue;
      ramps.push({ at: place.at, from: wish.low, length: wish.target - wish.low, power: wish.weight * share });
      ramps.push({ at: place.at, from: wish.high, length: wish.target - wish.high, power: wish.above * share });
    }
    return { values: (point) => measured.map((value) => value(point)), gaps, ramps, plain };
  }

  // What a point is worth, to be made small: first by how much it breaks limits, then the objective. Where some value is
  // unacceptable the desirability is flat at zero; there it counts how far away the acceptable ones are.
  function worth({ gaps, ramps, plain }, values) {
    const broken = gaps.reduce((sum, { at, sign, limit, spread }) => {
      const away = sign * (values[at] - limit) / spread;
      return sum + (away < -1e-6 ? -away : 0);
    }, 0);
    if (plain) return [broken, plain.sign * values[plain.at]];
    let product = 1, short = 0;
    for (const { at, from, length, power } of ramps) {
      const share = (values[at] - from) / length;
      product *= Math.min(1, Math.max(0, share)) ** power;
      short += Math.max(0, -share);
    }
    return [broken, short - product];
  }

  const isBetter = (a, b) => (a[0] !== b[0] ? a[0] < b[0] : a[1] < b[1]);

  const pause = () => new Promise((done) => setTimeout(done));

  // The best point for the state's goals, limits and held factors: { point, isFeasible, words, value }.
  async function best() {
    const { data, state, goals } = rsmkit;
    const { factors } = data;
    const problem = posed();
    const isFree = factors.map((_, j) => !state.held.includes(j));
    const inside = (point) => rsmkit.sums.repaired(point.map((v, j) => (isFree[j] ? state.snap(factors[j], v) : state.point[j])));
    const tried = (point) => ({ point, worth: worth(problem, problem.values(point)) });
    const scattered = Array.from({ length: SCATTERED }, (_, i) =>
      factors.map((f, j) => f.low + (f.high - f.low) * ((0.5 + (i + 1) * step(j, factors.length)) % 1)));
    const known = [...data.points, ...data.searches.map((search) => state.pointOf(search.factors))];
    const looked = [state.point, ...known, ...scattered].map((point) => tried(inside(point)));
    looked.sort((a, b) => (isBetter(a.worth, b.worth) ? -1 : 1));
    const cell = ({ point }) => factors.map((f, j) => (f.continuous ? "" : point[j])).join();
    const starts = [];
    for (const look of looked) if (starts.length < STARTS && !starts.some((start) => cell(start) === cell(look))) starts.push(look);
    starts.push(...looked.filter((look) => !starts.includes(look)).slice(0, Math.max(1, STARTS - starts.length)));
    const improved = async ({ point }) => {
      await pause();
      return tried(inside(local(problem, point, isFree)));
    };
    let found = null;
    for (const start of starts) {
      const made = await improved(start);
      for (const one of [start, made]) if (!found || isBetter(one.worth, found.worth)) found = one;
    }
    for (let isMoving = true; isMoving;) {  // to the neighbouring whole numbers, levels and categories
      isMoving = false;
      for (const near of neighbours(found.point, isFree)) {
        const made = await improved({ point: near });
        if (made.worth[0] > found.worth[0] || made.worth[1] >= found.worth[1] - 1e-9 * Math.abs(found.worth[1])) continue;
        [found, isMoving] = [made, true];
      }
    }
    const { number } = rsmkit.format;
    const words = problem.plain ? goals.wishes().map((q) => `${q.title} ${number(q.value(found.point))}`).join(", ")
      : `overall desirability ${goals.desirability(found.point).toFixed(4)}`;
    return { point: found.point, isFeasible: found.worth[0] === 0, value: found.worth[1], words };
  }

  function neighbours(point, isFree) {
    return rsmkit.data.factors.flatMap((factor, j) => {
      if (!isFree[j] || factor.continuous) return [];
      const at = factor.levels.indexOf(point[j]);
      const values = !factor.numeric ? factor.levels.map((_, i) => i).filter((i) => i !== point[j])
        : factor.levels.length ? [factor.levels[at - 1], factor.levels[at + 1]].filter((v) => v !== undefined)
          : [point[j] - 1, point[j] + 1].filter((v) => v >= factor.low && v <= factor.high);
      return values.map((value) => point.map((v, i) => (i === j ? value : v)));
    });
  }

  // Steps of the additive recurrence that spreads points evenly in any dimension (Roberts 2018).
  function step(j, k) {
    let ratio = 2;
    for (let i = 0; i < 30; i++) ratio = (1 + ratio) ** (1 / (k + 1));
    return (1 / ratio) ** (j + 1);
  }

  // The best point near a start, over the continuous factors that are not held.
  function local({ values, gaps, ramps, plain }, start, isFree) {
    const { factors } = rsmkit.data;
    const moved = factors.map((f, j) => j).filter((j) => isFree[j] && factors[j].continuous);
    const k = moved.length;
    if (!k) return start;
    const span = (j) => factors[j].high - factors[j].low;
    const pointAt = (z) => {
      const point = start.slice();
      moved.forEach((j, i) => { point[j] = factors[j].low + span(j) * z[i]; });
      return point;
    };
    // Values and their derivatives by the factors, to second order also at the ends of the box.
    const slopes = (z) => {
      const here = values(pointAt(z));
      const at = (i, by) => values(pointAt(z.map((v, c) => (c === i ? v + by : v))));
      const columns = moved.map((_, i) => {
        if (z[i] >= STEP && z[i] <= 1 - STEP) {
          const [below, above] = [at(i, -STEP), at(i, STEP)];
          return here.map((_, m) => (above[m] - below[m]) / (2 * STEP));
        }
        const by = z[i] < STEP ? STEP : -STEP;
        const [one, two] = [at(i, by), at(i, 2 * by)];
        return here.map((v, m) => (4 * one[m] - 3 * v - two[m]) / (2 * by));
      });
      return { here, columns };
    };
    const size = k + ramps.length;
    const lambdas = new Array(gaps.length + ramps.length).fill(0);
    let penalty = 10;
    // The objective, and what has to be at least 0, with derivatives: rows of constraints are [value, derivatives].
    const evaluated = (z) => {
      const { here, columns } = slopes(z);
      const gradient = new Array(size).fill(0);
      let objective = 0;
      if (plain) {
        objective = plain.sign * here[plain.at] / plain.spread;
        for (let i = 0; i < k; i++) gradient[i] = plain.sign * columns[i][plain.at] / plain.spread;
      }
      ramps.forEach(({ power }, r) => {
        objective -= power * Math.log(z[k + r]);
        gradient[k + r] = -power / z[k + r];
      });
      const rows = gaps.map(({ at, sign, limit, spread }) => [sign * (here[at] - limit) / spread, columns.map((column) => sign * column[at] / spread), -1]);
      rows.push(...ramps.map(({ at, from, length }, r) => [(here[at] - from) / length - z[k + r], columns.map((column) => column[at] / length), r]));
      return { objective, gradient, rows };
    };
    const lagrangian = (z) => {
      const { objective, gradient, rows } = evaluated(z);
      let value = objective;
      const slope = gradient.slice();
      rows.forEach(([row, by, r], c) => {
        const pull = Math.max(0, lambdas[c] - penalty * row);
        value += (pull * pull - lambdas[c] * lambdas[c]) / (2 * penalty);
        if (!pull) return;
        for (let i = 0; i < k; i++) slope[i] -= pull * by[i];
        if (r >= 0) slope[k + r] += pull;
      });
      return [value, slope, rows];
    };
    let z = moved.map((j) => Math.min(1, Math.max(0, (start[j] - factors[j].low) / span(j))));
    const first = values(start);
    z.push(...ramps.map(({ at, from, length }) => Math.min(1, Math.max(1e-3, (first[at] - from) / length))));
    const low = z.map((_, i) => (i < k ? 0 : LEAST));
    let missed = Infinity;
    for (let round = 0; round < 25; round++) {
      z = inBox(lagrangian, z, low);
      const rows = lagrangian(z)[2];
      const worst = rows.reduce((most, [row], c) => Math.max(most, Math.abs(Math.min(row, lambdas[c] / penalty))), 0);
      rows.forEach(([row], c) => { lambdas[c] = Math.max(0, lambdas[c] - penalty * row); });
      if (!(worst > 1e-10)) break;
      if (worst > 0.25 * missed) penalty = Math.min(1e6, 5 * penalty);
      missed = worst;
    }
    return pointAt(z);
  }

  // The minimum of a smooth function within [low, 1] near a start, by BFGS over the variables that are not held by a bound.
  function inBox(f, start, low) {
    const n = start.length;
    let z = start, [value, slope] = f(z);
    let inverse = identity(n);
    for (let round = 0; round < 80; round++) {
      const isHeld = z.map((v, i) => (v <= low[i] && slope[i] > 0) || (v >= 1 && slope[i] < 0));
      const steepest = slope.map((v, i) => (isHeld[i] ? 0 : -v));
      if (Math.max(...steepest.map(Math.abs)) < 1e-10) break;
      let way = inverse.map((row, i) => (isHeld[i] ? 0 : row.reduce((sum, v, c) => sum + v * steepest[c], 0)));
      if (!(dot(way, slope) < 0)) [inverse, way] = [identity(n), steepest];
      const longest = Math.max(...way.map(Math.abs));
      let share = Math.min(1, 0.5 / longest), next = null, after = null;
      for (; share * longest > 1e-13; share /= 3) {
        next = z.map((v, i) => Math.min(1, Math.max(low[i], v + share * way[i])));
        after = f(next);
        if (after[0] <= value + 1e-4 * dot(slope, next.map((v, i) => v - z[i]))) break;
        after = null;
      }
      if (!after) {
        if (round && inverse.some((row, i) => row.some((v, c) => v !== Number(i === c)))) { inverse = identity(n); continue; }
        break;
      }
      const s = next.map((v, i) => v - z[i]), y = after[1].map((v, i) => (isHeld[i] ? 0 : v - slope[i]));
      update(inverse, s, y);
      [z, value, slope] = [next, after[0], after[1]];
    }
    return z;
  }

  const identity = (n) => Array.from({ length: n }, (_, i) => Array.from({ length: n }, (_, c) => Number(i === c)));

  const dot = (a, b) => a.reduce((sum, v, i) => sum + v * b[i], 0);

  function update(inverse, s, y) {
    const along = dot(s, y);
    if (!(along > 1e-14 * Math.sqrt(dot(s, s) * dot(y, y)))) return;
    const hy = inverse.map((row) => dot(row, y));
    const scale = (along + dot(y, hy)) / along ** 2;
    for (let i = 0; i < s.length; i++) {
      for (let c = 0; c < s.length; c++) inverse[i][c] += scale * s[i] * s[c] - (hy[i] * s[c] + s[i] * hy[c]) / along;
    }
  }

  return { best };
})();
