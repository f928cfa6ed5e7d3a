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
    return JSON.stringify([limited, state.quantity === "desirability" ? state.goals : "", state.quantity, state.x, state.y, state.point.filter((_, j) => j !== state.x && j !== state.y)]);
  }

  function nodes(factor) {
    return Array.from({ length: NODES }, (_, i) => factor.low + (factor.high - factor.low) * i / (NODES - 1));
  }

  function make() {
    const { data, state } = rsmkit;
    const xs = nodes(data.factors[state.x]), ys = nodes(data.factors[state.y]);
    const start = state.point.slice();
    const rows = (along) => ys.map((v) => { start[state.y] = v; return along(start, state.x, xs); });
    const z = rows(chosen().values);
    const values = z.flat().filter(Number.isFinite);
    const [low, high] = values.length ? [Math.min(...values), Math.max(...values)] : [0, 1];
    const fields = new Map();  // what is limited, one grid each
    for (const { subject } of rsmkit.limits.active()) {
      if (!fields.has(subject.key)) fields.set(subject.key, rows(subject.values));
    }
    return { name: name(), xs, ys, z, low, high: high > low ? high : low + (Math.abs(low) || 1), fields };
  }

  // Grid of values with their range, and `fields`: a grid of values of everything that is limited.
  function grid() {
    if (made?.name !== name()) made = make();
    return made;
  }

  return { chosen, name, grid };
})();
