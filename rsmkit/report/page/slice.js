// The slice through the box that contours and surface show: one quantity over two factors, the others held.
"use strict";

rsmkit.slice = (function () {
  const NODES = 25;
  let made = null;

  const chosen = () => rsmkit.study.quantities.find((q) => q.key === rsmkit.state.quantity) ?? rsmkit.goals.quantity();

  // What the slice depends on: the quantity, what is limited, its two factors and the values of the others.
  function name() {
    const { state } = rsmkit;
    const limited = rsmkit.limits.active().map(({ subject }) => subject.key);
    return JSON.stringify([limited, state.quantity === "desirability" ? state.goals : "", state.quantity, state.x, state.y, others(), rsmkit.data.equalities.length ? state.held : []]);
  }

  // What is held; of what gives way to the two factors, how much there is in the middle of the slice, wherever the design is.
  function others() {
    const { data, state, sums } = rsmkit;
    const both = [state.x, state.y];
    const middle = both.some(sums.involves) ? sums.placed(state.point, both.map((j) => [j, data.centre[j]])) : null;
    return (middle?.map((v) => Number(v.toPrecision(9))) ?? state.point).filter((_, j) => !both.includes(j));
  }

  function nodes(factor) {
    return Array.from({ length: NODES }, (_, i) => factor.low + (factor.high - factor.low) * i / (NODES - 1));
  }

  function make() {
    const { data, state } = rsmkit;
    const xs = nodes(data.factors[state.x]), ys = nodes(data.factors[state.y]);
    const start = state.point.slice();
    const isTied = rsmkit.sums.involves(state.x) || rsmkit.sums.involves(state.y);
    const ties = isTied ? ys.map((v) => tied(start, xs, v)) : null;
    const rows = (quantity) => ties ? ties.map(({ points }) => points.map((point) => (point ? quantity.value(point) : NaN)))
      : ys.map((v) => { start[state.y] = v; return quantity.values(start, state.x, xs); });
    const room = ties?.map((row) => row.room);
    const { z, rise, reach, near } = rsmkit.cliffs.drawn(chosen(), rows);
    const values = z.flatMap((row, r) => row.filter((v, c) => Number.isFinite(v) && !(room?.[r][c] < 0)));
    const [low, high] = values.length ? [Math.min(...values), Math.max(...values)] : [0, 1];
    const fields = new Map();  // what is limited, one grid each
    for (const { subject } of rsmkit.limits.active()) {
      if (!fields.has(subject.key)) fields.set(subject.key, rows(subject));
    }
    const across = ys.map((_, r) => xs.map((u, c) => ties?.[r].points[c]?.[state.x] ?? u));
    return { name: name(), xs, ys, z, rise, reach, near, room, across, low, high: high > low ? high : low + (Math.abs(low) || 1), fields };
  }

  // A row of the slice where sums tie factors: the designs, and how far inside the sums' bounds each node is, in units of x;
  // beyond them the design at the bound goes on, so that what is drawn can be cut off at a smooth edge.
  function tied(start, xs, v) {
    const { state, sums } = rsmkit;
    const fixed = [[state.y, v]];
    const base = sums.placed(start, fixed);
    if (!base) return { points: xs.map(() => null), room: xs.map(() => -Infinity) };
    const [least, most] = [xs[0], xs.at(-1)].map((end) => sums.moved(base, state.x, end, fixed));
    const [from, to] = [least[state.x], most[state.x]];
    const rounding = 1e-9 * (xs.at(-1) - xs[0]);
    return { room: xs.map((u) => Math.min(u - from, to - u) + rounding),
      points: xs.map((u) => (u <= from ? least : u >= to ? most : sums.placed(base, [...fixed, [state.x, u]]))) };
  }

  // Grid of values with their range; `rise`, `reach` and `near` as cliffs.js tells; `across`, where the nodes truly lie; `room`, where sums tie factors; `fields`: a grid of values of everything that is limited.
  function grid() {
    if (made?.name !== name()) made = make();
    return made;
  }

  return { chosen, name, grid };
})();
