// Sums that the space keeps: mixtures, and other linear equalities of factors. Nothing on the page leaves them: whoever
// moves one factor takes the others along. A component moves along its Cox direction (Cox, Biometrika 58, 1971): the rest
// of its mixture gives way in proportion to its amounts, and what meets a bound stays there.
"use strict";

rsmkit.sums = (function () {
  const EDGE = 1e-12;  // share of a total that is rounding
  const ROUNDING = 1e-13;  // share of the largest amount of a sum that may be missing
  const HALVINGS = 48;

  const involves = (j) => rsmkit.data.equalities.some(({ terms }) => terms.some(([i]) => i === j));

  const mixtureOf = (j) => rsmkit.data.mixtures.find(({ components }) => components.includes(j));

  const coefficients = () => rsmkit.data.equalities.map(({ terms }) => new Map(terms));

  // Factors that may give way when those of `fixed` are set.
  const others = (fixed) => rsmkit.data.factors.map((_, j) => j)
    .filter((j) => involves(j) && !fixed.includes(j) && !rsmkit.state.held.includes(j));

  // How readily each of the free factors gives way: components by their amounts, in equal parts where there is none of any.
  function willing(point, free) {
    const { factors, mixtures } = rsmkit.data;
    const found = new Map(free.map((j) => [j, (factors[j].high - factors[j].low) ** 2]));
    for (const { components, total } of mixtures) {
      const rest = components.filter((j) => found.has(j));
      const sum = rest.reduce((amount, j) => amount + point[j], 0);
      for (const j of rest) found.set(j, sum > EDGE * total ? point[j] * total : total * total);
    }
    return found;
  }

  // All alike, where amounts do not count, or are nothing where something has to move.
  const alike = (free) => new Map(free.map((j) => [j, (mixtureOf(j)?.total ?? rsmkit.data.factors[j].high - rsmkit.data.factors[j].low) ** 2]));

  // The change of the free factors, by weight as small as can be, that adds `wanted` to each of the sums: Map, or null.
  function change(wanted, weights) {
    const rows = coefficients();
    const matrix = rows.map((a) => rows.map((b) => [...weights].reduce((sum, [j, w]) => sum + w * (a.get(j) ?? 0) * (b.get(j) ?? 0), 0)));
    const pulls = solved(matrix, wanted);
    const found = new Map([...weights].map(([j, w]) => [j, w * rows.reduce((sum, a, r) => sum + pulls[r] * (a.get(j) ?? 0), 0)]));
    const isMet = rows.every((a, r) => Math.abs([...found].reduce((sum, [j, v]) => sum + v * (a.get(j) ?? 0), -wanted[r])) <=
      1e-9 * Math.max(...wanted.map(Math.abs)));
    return isMet ? found : null;
  }

  // Gaussian elimination; what a matrix does not determine is zero.
  function solved(matrix, right) {
    const rows = matrix.map((row, r) => [...row, right[r]]), n = rows.length;
    const least = 1e-13 * Math.max(...matrix.flat().map(Math.abs));
    const pivots = [];
    for (let c = 0; c < n; c++) {
      const from = pivots.length;
      const best = rows.slice(from).reduce((k, row, i) => (Math.abs(row[c]) > Math.abs(rows[k][c]) ? from + i : k), from);
      if (from >= n || !(Math.abs(rows[best][c]) > least)) continue;
      [rows[from], rows[best]] = [rows[best], rows[from]];
      rows.forEach((row, r) => {
        if (r === from) return;
        const share = row[c] / rows[from][c];
        for (let i = c; i <= n; i++) row[i] -= share * rows[from][i];
      });
      pivots.push(c);
    }
    const found = new Array(n).fill(0);
    pivots.forEach((c, r) => { found[c] = rows[r][n] / rows[r][c]; });
    return found;
  }

  // The point with the sums kept by what is free, inside the bounds; null where that cannot be. What meets a bound stays there.
  function kept(point, free, weigh) {
    const { factors, equalities } = rsmkit.data;
    const isOff = (x) => equalities.some((sum) => Math.abs(rsmkit.limits.away(sum, x)) > ROUNDING * Math.max(size(sum, x), 1e-300));
    const size = (sum, x) => sum.terms.reduce((most, [j, c]) => Math.max(most, Math.abs(c * x[j])), Math.abs(sum.value));
    let left = free;
    const x = point.slice();
    for (let round = 0; round <= free.length; round++) {
      for (const j of left) x[j] = point[j];
      for (let again = 0; again < 2 && left.length; again++) {  // the second takes the rounding out
        const wanted = equalities.map((sum) => -rsmkit.limits.away(sum, x));
        if (wanted.every((v) => v === 0)) break;
        const step = change(wanted, weigh(x, left)) ?? change(wanted, alike(left));
        if (!step) break;
        for (const [j, v] of step) x[j] += v;
      }
      const beyond = left.filter((j) => x[j] < factors[j].low || x[j] > factors[j].high);
      if (!beyond.length) return isOff(x) ? null : x;
      for (const j of beyond) x[j] = Math.min(factors[j].high, Math.max(factors[j].low, x[j]));
      if (!isOff(x)) return x;
      left = left.filter((j) => !beyond.includes(j));
    }
    return isOff(x) ? null : x;
  }

  // The point with some factors at given values, [[j, value], ...]; null where the sums cannot be kept so.
  function placed(point, values) {
    const x = point.slice();
    for (const [j, value] of values) x[j] = value;
    if (!values.some(([j]) => involves(j))) return x;
    return kept(x, others(values.map(([j]) => j)), willing);
  }

  // The point with one factor at a value, or as far on the way there as the sums allow; `fixed` stay at theirs.
  function moved(point, j, value, fixed = []) {
    const { low, high } = rsmkit.data.factors[j];
    const asked = Math.min(high, Math.max(low, value));
    const whole = placed(point, [...fixed, [j, asked]]);
    if (whole) return whole;
    let best = point, [near, far] = [0, 1];
    for (let i = 0; i < HALVINGS; i++) {
      const share = 0.5 * (near + far);
      const made = placed(point, [...fixed, [j, point[j] + share * (asked - point[j])]]);
      if (made) [best, near] = [made, share];
      else far = share;
    }
    return best;
  }

  // A near point on the sums, with what is held where it is; the point itself where there is none.
  function repaired(point) {
    const { factors, equalities } = rsmkit.data;
    if (!equalities.length) return point;
    const free = others([]);
    const inside = point.map((v, j) => (free.includes(j) ? Math.min(factors[j].high, Math.max(factors[j].low, v)) : v));
    if (equalities.every((sum) => Math.abs(rsmkit.limits.away(sum, inside)) <= EDGE * Math.abs(sum.value))) return inside;
    return kept(inside, free, (_, left) => alike(left)) ?? point;
  }

  // How every factor changes while one grows by one: its Cox direction. Null where nothing may give way.
  function along(point, j) {
    const found = point.map((_, i) => Number(i === j));
    if (!involves(j)) return found;
    const asked = coefficients().map((a) => -(a.get(j) ?? 0)), free = others([j]);
    const step = change(asked, willing(point, free)) ?? change(asked, alike(free));
    if (!step) return null;
    for (const [i, v] of step) found[i] = v;
    return found;
  }

  // How far back and forth a point can go along a direction until a bound is met.
  function reach(point, direction) {
    let [low, high] = [-Infinity, Infinity];
    direction.forEach((slope, i) => {
      if (Math.abs(slope) <= EDGE) return;
      const factor = rsmkit.data.factors[i];
      const ends = [(factor.low - point[i]) / slope, (factor.high - point[i]) / slope].sort((a, b) => a - b);
      [low, high] = [Math.max(low, ends[0]), Math.min(high, ends[1])];
    });
    return [Math.min(0, low), Math.max(0, high)];
  }

  // Points along the direction of a factor, from bound to bound.
  function line(point, j, count) {
    const direction = along(point, j) ?? point.map(() => 0);
    const [low, high] = direction[j] ? reach(point, direction) : [0, 0];
    return Array.from({ length: count }, (_, i) => {
      const by = low + (high - low) * i / (count - 1);
      return point.map((v, c) => v + by * direction[c]);
    });
  }

  // Whether two factors can be set at once, whatever the sums ask: neither settles the other.
  function areFree(a, b) {
    if (a === b) return false;
    if (!involves(a) && !involves(b)) return true;
    const weights = new Map(rsmkit.data.factors.map((f, j) => [j, (f.high - f.low) ** 2]).filter(([j]) => involves(j) && j !== a && j !== b));
    return [a, b].every((j) => !involves(j) || change(coefficients().map((row) => -(row.get(j) ?? 0)), weights));
  }

  return { involves, mixtureOf, placed, moved, repaired, along, reach, line, areFree };
})();
