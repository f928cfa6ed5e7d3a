// Runs that the reader has marked in one view; every other view lights them up.
"use strict";

rsmkit.runs = (function () {
  const { element, announce } = rsmkit.format;
  const SOURCE = "runs";
  const LIT = "#ff9f1c";
  const MOST_NAMED = 24;
  const PALETTE = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#8a7a00", "#56b4e9", "#7b4ab5", "#a05a2c", "#5c6675", "#c0392b"];
  const strips = [];

  const rows = () => (rsmkit.state.brush?.search === SOURCE ? rsmkit.state.brush.rows : []);

  const label = (run) => rsmkit.data.run_labels[run];

  // Marks these runs and no others; numbers are rows of the runs on the page, negative ones are not drawn.
  function mark(wanted) {
    const known = [...new Set(wanted)].filter((run) => run >= 0).sort((a, b) => a - b);
    rsmkit.state.set({ brush: known.length
      ? { search: SOURCE, rows: known, points: known.map((run) => rsmkit.data.points[run]) } : null });
    announce(known.length ? `${known.length} runs marked in every view` : "No run is marked");
  }

  function toggle(run) {
    const now = rows();
    mark(now.includes(run) ? now.filter((other) => other !== run) : [...now, run]);
  }

  // What rsmkit.plot needs to let dots of runs be marked: by a box around them, by a click, by Enter.
  const marking = { pick: (mark, i) => mark.runs && toggle(mark.runs[i]),
    brush: (found) => rsmkit.runs.mark(found.filter(([mark]) => mark.runs).map(([mark, i]) => mark.runs[i])) };

  // Colours of dots of runs: marked ones stand out; others have the colour that `own` says.
  function colours(runs, own) {
    const lit = new Set(rows());
    return runs.map((run, i) => (lit.has(run) ? LIT : own(i)));
  }

  // A line that says which runs are marked, with a button to unmark them.
  function strip() {
    const made = element("p", { class: "fine marked" });
    strips.push(made);
    fill(made);
    return made;
  }

  function fill(made) {
    const now = rows();
    if (!now.length) {
      made.replaceChildren("Draw a box around dots, or press Enter on one, to mark runs in every view.");
      return;
    }
    const named = now.slice(0, MOST_NAMED).map(label).join(", ");
    made.replaceChildren(`Marked in every view: ${now.length === 1 ? "run" : "runs"} ${named}${now.length > MOST_NAMED ? ", …" : ""} `,
      element("button", { type: "button", class: "small", onclick: () => mark([]) }, "Unmark"));
  }

  function update(keys) {
    if (keys.has("brush")) strips.forEach(fill);
  }

  return { open: () => {}, update, mark, toggle, rows, label, colours, marking, strip, PALETTE, LIT };
})();
