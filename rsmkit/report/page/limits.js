// Limits: what is allowed of each response or formula, at least and at most; those of the study to begin with.
"use strict";

rsmkit.limits = (function () {
  const { element, number, typed } = rsmkit.format;
  const COLOURS = ["#d97706", "#8250df", "#0969da", "#bf3989", "#1b7c83", "#8a4b08", "#57606a", "#2f6f1f"];
  const SIDES = [["low", "at least", "≥"], ["high", "at most", "≤"]];
  let fields = [];

  const colourOf = (subject) => COLOURS[rsmkit.study.subjects.indexOf(subject) % COLOURS.length];

  // Lower and upper limit of a subject now, null for none.
  const of = (subject) => rsmkit.state.limits[subject.key] ?? subject.given;

  // Every limit that holds now: { subject, side, limit, colour, sign, text }; the margin is sign * (value - limit).
  function active() {
    return rsmkit.study.subjects.flatMap((subject) => SIDES.flatMap(([side, , sign], i) => {
      const limit = of(subject)[i];
      return limit === null ? [] : [{ subject, side, limit, colour: colourOf(subject), sign: i ? -1 : 1,
        text: `${subject.title} ${sign} ${number(limit, Math.abs(limit) / 1e4)}` }];
    }));
  }

  // By how much a point keeps a limit; what lies on it keeps it.
  function margin({ subject, limit, sign }, point) {
    const away = sign * (subject.value(point) - limit);
    return Math.abs(away) <= subject.tolerance ? Math.max(0, away) : away;
  }

  // The limits that a point breaks; those that the page cannot evaluate are told apart as `unknown`.
  function judged(point) {
    const sums = rsmkit.data.equalities.filter((sum) => Math.abs(away(sum, point)) > 1e-6 * Math.max(1, Math.abs(sum.value)))
      .map((sum) => ({ text: sum.text, margin: -Math.abs(away(sum, point)) }));
    const told = active().map((limit) => ({ ...limit, margin: margin(limit, point) }));
    return { broken: [...sums, ...told.filter((limit) => limit.margin < 0)], unknown: told.filter((limit) => Number.isNaN(limit.margin)), all: told };
  }

  // By how much a point leaves a sum that the space keeps, such as that of a mixture.
  const away = ({ terms, value }, point) => terms.reduce((sum, [j, coefficient]) => sum + coefficient * point[j], -value);

  function set(subject, side, limit) {
    const now = of(subject).slice();
    now[side === "low" ? 0 : 1] = Number.isFinite(limit) ? limit : null;
    rsmkit.state.set({ limits: { ...rsmkit.state.limits, [subject.key]: now } });
  }

  // A table to type them into; an empty field is no limit.
  function table() {
    fields = [];
    const field = (subject, side, words) => {
      const input = element("input", { type: "number", step: "any", "aria-label": `${subject.title}, ${words}`,
        onchange: () => set(subject, side, input.value === "" ? NaN : +input.value) });
      fields.push({ subject, side, input });
      return element("td", {}, input);
    };
    const rows = rsmkit.study.subjects.map((subject) => element("tr", {},
      element("th", { scope: "row" }, element("span", { class: "key", style: `--key:${colourOf(subject)}` }), subject.title),
      ...SIDES.map(([side, words]) => field(subject, side, words))));
    const made = element("table", { class: "limits" }, element("caption", {}, "Limits"),
      element("thead", {}, element("tr", {}, element("td"), ...SIDES.map(([, words]) => element("th", { scope: "col" }, words)))),
      element("tbody", {}, ...rows));
    update(new Set(["limits"]));
    return element("div", {}, element("div", { class: "scroller", tabindex: "0", role: "group", "aria-label": "Limits" }, made),
      element("button", { type: "button", onclick: () => rsmkit.state.set({ limits: {} }) }, "Limits of the study"));
  }

  function update(keys) {
    if (!keys.has("limits")) return;
    for (const { subject, side, input } of fields) {
      const limit = of(subject)[side === "low" ? 0 : 1];
      if (document.activeElement !== input) input.value = limit === null ? "" : typed(limit);
    }
  }

  return { active, margin, judged, away, set, table, update };
})();
