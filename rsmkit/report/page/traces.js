// Traces of a mixture: one quantity while one component after the other moves along its Cox direction, over how far its
// amount is from that of a reference blend. Process factors stay as in the current design.
"use strict";

rsmkit.traces = (function () {
  const { element, section, choice, number, factorValue } = rsmkit.format;
  const SAMPLES = 41;
  const COLOURS = ["#1f6feb", "#d97706", "#1b7c83", "#bf3989", "#8250df", "#57606a", "#2f6f1f", "#d1242f"];
  const DASHES = [null, "7 3", "2 3", "9 3 2 3"];
  let data, state, picked, told;
  let isMiddle = false;  // whether the reference is the middle of the region, not the current design

  function open() {
    ({ data, state } = rsmkit);
    if (!data.mixtures.length) return;
    picked = choice("Show", [...rsmkit.study.quantities.map((q) => [q.key, q.title]), ["desirability", "overall desirability"]], state.quantity,
      (key) => state.set({ quantity: key }));
    const host = element("div");
    told = element("p", { class: "fine" });
    section("traces", "Traces along Cox directions", element("div", { class: "bar" }, picked,
      choice("Reference blend", [["", "the current design"], ["middle", "the centre of the region"]], "", (value) => {
        isMiddle = Boolean(value);
        rsmkit.charts.update(new Set(["traces"]));
      })), host, told);
    rsmkit.charts.add(host, { plot, keys: ["point", "quantity", "goals", "traces", "held"] });
  }

  // The blend where the traces cross.
  function reference() {
    const tied = data.mixtures.flatMap(({ components }) => components);
    return isMiddle ? state.point.map((v, j) => (tied.includes(j) ? data.centre[j] : v)) : state.point;
  }

  function plot() {
    const quantity = rsmkit.slice.chosen();
    const start = reference();
    const components = data.mixtures.flatMap((mixture) => mixture.components);
    const marks = components.map((j, i) => {
      const line = rsmkit.sums.line(start, j, SAMPLES);
      return { kind: "line", name: data.factors[j].label, x: line.map((p) => p[j] - start[j]), y: line.map(quantity.value),
        colour: COLOURS[i % COLOURS.length], dash: DASHES[Math.floor(i / COLOURS.length) % DASHES.length], width: 2 };
    });
    const ends = marks.map(({ x, y }, i) => ({ kind: "dots", x: [x[0], x.at(-1)], y: [y[0], y.at(-1)], colour: COLOURS[i % COLOURS.length], size: 3,
      texts: [0, -1].map((at) => `${data.factors[components[i]].label} ${factorValue(data.factors[components[i]], start[components[i]] + x.at(at))}: ` +
        `${quantity.title} ${number(y.at(at))}`) }));
    told.textContent = `Reference: ${components.map((j) => `${data.factors[j].label} ${factorValue(data.factors[j], start[j])}`).join(", ")}. While one ` +
      "component moves, the others keep their proportions; a trace ends where a bound is met. Steep traces: components that matter here.";
    return { label: `Traces of ${quantity.title} over the components`, height: 340, legend: true,
      x: { title: "amount less that of the reference blend" }, y: { title: quantity.title },
      marks: [...marks, ...ends, { kind: "rule", x: 0, colour: rsmkit.charts.colour("now") }] };
  }

  function update(keys) {
    if (picked && keys.has("quantity")) picked.select.value = state.quantity;
  }

  return { open, update };
})();
