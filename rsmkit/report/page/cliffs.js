// A quantity on a grid, ready to be drawn. Overall desirability falls to nothing as a root does, or at once where something has to
// stay in range: lines drawn through its values at the nodes are stairs there. So its edges are found from what it is made of,
// which is smooth.
"use strict";

rsmkit.cliffs = (function () {
  const PARTS = 4;

  // `gridOf` gives a grid of values of a quantity. `z`: the values; `reach(level)`: a finer grid, and the level on it at which the
  // quantity reaches this one; `rise`: negative where the quantity is nothing because something is unacceptable, null where there is no
  // such thing; `near(r, c)`: both at PARTS times as many places each way within one cell.
  function drawn(quantity, gridOf) {
    const wishes = rsmkit.goals.wishes();
    if (quantity.key === "desirability" && wishes.length) return over(wishes.map((wish) => [rsmkit.goals.full(wish), gridOf(wish)]));
    const z = gridOf(quantity), heights = rsmkit.bands.finer(z);
    return { z, rise: null, reach: (level) => [heights, level] };
  }

  function over(parts) {
    const total = parts.reduce((sum, [wish]) => sum + (wish.goal === "range" ? 0 : wish.importance), 0) || 1;
    const judged = (grids) => grids[0].map((row, r) => row.map((_, c) => node(parts.map(([wish], i) =>
      ({ isRange: wish.goal === "range", share: wish.importance / total, ...rsmkit.goals.rising(wish, grids[i][r][c]) })))));
    const told = (nodes) => ({ z: nodes.map((row) => row.map((at) => at.value)), rise: nodes.map((row) => row.map((at) => Math.min(at.least, at.room))) });
    const grids = parts.map(([, grid]) => grid), halves = grids.map(rsmkit.bands.finer), quarters = halves.map(rsmkit.bands.finer);
    const fine = parts.some(([wish]) => wish.goal === "range") ? withEdges(judged(halves)) : judged(halves);
    const cut = (grid, r, c) => grid.slice(PARTS * r, PARTS * (r + 1) + 1).map((row) => row.slice(PARTS * c, PARTS * (c + 1) + 1));
    return { ...told(judged(grids)), reach: (level) => [fine.map((row) => row.map((at) => beyond(at, level))), 0],
      near: (r, c) => told(judged(quarters.map((grid) => cut(grid, r, c)))) };
  }

  // Of one place: the desirability; the least rise of all goals, its exponent, and the logarithm of what the other goals leave of
  // the whole; how far inside its range everything is that has one.
  function node(told) {
    let room = Infinity, least = 1, exponent = 1, worst = null, value = 1;
    for (const one of told) {
      if (one.isRange) room = one.rise < room || Number.isNaN(one.rise) ? one.rise : room;
      else if (!(one.rise >= least) || worst === null) [worst, least, exponent] = [one, Math.min(1, one.rise), one.exponent * one.share];
    }
    let others = 0;
    for (const one of told) {
      if (one !== worst && !one.isRange && one.rise < 1) others += one.rise > 0 ? one.exponent * one.share * Math.log(one.rise) : 0;
    }
    if (Number.isNaN(least) || Number.isNaN(room)) value = NaN;
    else value = least <= 0 && worst || room < 0 ? 0 : Math.exp(others) * Math.max(0, least) ** exponent;
    return { value, least, exponent, others, room };
  }

  // How far the least rise of a place is above what the level needs of it when the others stay as they are: nothing where the
  // desirability is the level, nearly straight between nodes however steeply the desirability itself falls, and in the same
  // measure, that of its logarithm, whichever goal is the least.
  const beyond = ({ least, exponent, others, room }, level) =>
    Math.min(exponent * (least * Math.exp((others - Math.log(level)) / exponent) - 1), room);

  // Keeps the room of a place only where a range ends beside it, or has ended: a line of equal desirability elsewhere is not of its measure.
  const withEdges = (nodes) => nodes.map((row, r) => row.map((at, c) => {
    const isBeside = [-1, 0, 1].some((i) => [-1, 0, 1].some((j) => nodes[r + i]?.[c + j]?.room < 0));
    return isBeside || !(at.room >= 0) ? at : { ...at, room: Infinity };
  }));

  return { drawn, PARTS };
})();
