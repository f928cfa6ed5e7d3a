// Refinements: true runs made around an optimum, wave by wave.
"use strict";

rsmkit.refinement = (function () {
  const { element, section, choice, number } = rsmkit.format;
  const SCALE = "Each wave is measured on the scale of the front known by then, from the least to the largest value of each objective in it: where the " +
    "front has grown at its ends, the same runs dominate a smaller share.";
  let names, shown, list, note;

  function open() {
    const { data } = rsmkit;
    names = Object.keys(data.refinements);
    if (!names.length) return;
    shown = names[0];
    const host = element("div");
    list = element("ol", { class: "fine" });
    note = element("p", { class: "fine" });
    section("refinement", "Refinement with true runs",
      element("div", { class: "bar" },
        choice("Search", names.map((name) => [name, name]), shown, (name) => { shown = name; fill(); }),
        element("button", { type: "button", onclick: goThere }, "Go to the refined design")),
      host, note, list);
    rsmkit.charts.add(host, { plot: chart, keys: ["refinement"] });
    fill();
  }

  const refinement = () => rsmkit.data.refinements[shown];

  const goThere = () => rsmkit.state.set({ point: rsmkit.state.pointOf(refinement().factors) });

  function fill() {
    const { waves, reason, objective, runs, measure, verdict, sentence } = refinement();
    list.replaceChildren(...waves.map((wave) => element("li", {}, wave.sentence.replace(/^wave \d+: /, "").replaceAll("+-", "±"))),
      ...(verdict ? [element("li", {}, `${verdict}: ${sentence}`)] : []),
      element("li", {}, `stopped after ${runs} runs: ${reason}; ${measure} ${number(objective, Math.abs(objective) / 1e4)}`));
    note.textContent = measure === "hypervolume" ? SCALE : "";
    rsmkit.charts.update(new Set(["refinement"]));
  }

  function chart() {
    const { waves, start_runs: before, measure, feasible } = refinement();
    const { colour } = rsmkit.charts;
    // a run below what was best after its wave did not become the best: it breaks a limit
    const made = waves.flatMap((wave) => wave.objectives.map((value) => ({ value, wave: wave.number,
      isBroken: feasible && measure !== "hypervolume" && value !== null && wave.best !== null && value < wave.best })))
      .map((run, i) => ({ ...run, x: before + i + 1 }));
    const dots = (isBroken, mark) => {
      const kept = made.filter((run) => run.isBroken === isBroken);
      return kept.length ? [{ kind: "dots", x: kept.map(({ x }) => x), y: kept.map(({ value }) => value), ...mark,
        texts: kept.map(({ x, wave, value }) => `run ${x}, wave ${wave}: ${number(value)}${isBroken ? ", breaks a limit" : ""}`) }] : [];
    };
    const ends = waves.map((_, w) => before + waves.slice(0, w + 1).reduce((sum, wave) => sum + wave.objectives.length, 0));
    return { label: "Objective, or hypervolume, of every run of the refinement", height: 300, legend: true,
      x: { title: "simulator runs" }, y: { title: measure }, marks: [
        ...dots(false, { name: "run", colour: colour("accent") }), ...dots(true, { name: "lower, but breaks a limit", colour: colour("soft"), isHollow: true }),
        { kind: "line", name: measure === "hypervolume" ? "after each wave" : "best so far", x: ends, y: waves.map((wave) => wave.best), colour: colour("now"), isStepped: true }] };
  }

  return { open, SCALE };
})();
