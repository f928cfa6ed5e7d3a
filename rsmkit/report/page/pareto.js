// Pareto fronts of the searches with several objectives: hover, click to go there, drag a box to brush.
"use strict";

rsmkit.pareto = (function () {
  const { element, svg, section, choice, announce, number } = rsmkit.format;
  let data, state;
  let count = 0;

  function open() {
    ({ data, state } = rsmkit);
    for (const search of data.searches.filter((s) => s.front.length > 1)) openFront(search);
  }

  const quantityOf = (key) => rsmkit.study.quantities.find((q) => q.key === key);

  const titleOf = (key) => quantityOf(key)?.title ?? key;

  function openFront(search) {
    const axes = search.minimize.map((text, i) => [String(i), titleOf(text)]);
    const shown = { x: 0, y: 1 };
    const host = element("div");
    const points = search.front.map((candidate) => state.pointOf(candidate.factors));
    const redraw = () => rsmkit.charts.update(new Set([`front ${search.name}`]));
    const pick = (axis, i) => { shown[axis] = +i; redraw(); };
    const walk = element("input", { type: "range", min: 0, max: points.length - 1, step: 1, value: 0,
      "aria-label": `Design on the front of ${search.name}`, oninput: () => {
        const order = search.front.map((_, row) => row).sort((a, b) => search.front[a].objectives[shown.x] - search.front[b].objectives[shown.x]);
        const row = order[+walk.value];
        walk.setAttribute("aria-valuetext", search.minimize.map((key, i) => `${titleOf(key)} ${number(search.front[row].objectives[i])}`).join(", "));
        state.set({ point: points[row] });
      } });
    section(`front-${++count}`, `Pareto front: ${search.name}`,
      element("div", { class: "bar" },
        choice("across", axes, "0", (i) => pick("x", i)), choice("up", axes, "1", (i) => pick("y", i)),
        element("label", { class: "choice" }, "along the front ", walk),
        element("button", { type: "button", onclick: () => state.set({ brush: null }) }, "Clear brush")),
      host,
      element("p", { class: "fine" }, `${points.length} designs none of which beats another in every objective. Click one to ` +
        "go there; drag a box around some to light them up in every view. Without a mouse: the slider walks along the front, and the axes " +
        "of the parallel coordinates brush with the arrow keys."));
    const drawn = {};
    const paint = (at, width) => {
      Object.assign(drawn, rsmkit.plot.draw(at, width, chart(search, points, shown)), { ring: svg("circle", { class: "ring", r: 7 }) });
      drawn.box.append(drawn.ring);
      here(search, shown, drawn);
    };
    rsmkit.charts.add(host, { paint, move: () => here(search, shown, drawn), keys: ["point", "brush", `front ${search.name}`] });
  }

  // The current design among the objectives, if the page can evaluate them.
  function here(search, { x, y }, { toX, toY, ring }) {
    const [a, b] = [x, y].map((i) => quantityOf(search.minimize[i])?.value(state.point));
    ring.setAttribute("visibility", Number.isFinite(a) && Number.isFinite(b) ? "visible" : "hidden");
    if (!Number.isFinite(a) || !Number.isFinite(b)) return;
    ring.setAttribute("cx", toX(a));
    ring.setAttribute("cy", toY(b));
  }

  function brushed(search, points, found) {
    const rows = found.filter(([mark]) => mark.isFront).map(([, row]) => row);
    if (!rows.length) return;
    state.set({ brush: { search: search.name, rows, points: rows.map((row) => points[row]) } });
    announce(`${rows.length} designs brushed`);
  }

  function chart(search, points, shown) {
    const { x, y } = shown;
    const { colour } = rsmkit.charts;
    const values = search.front.map((candidate) => candidate.objectives);
    const third = search.minimize.map((_, i) => i).find((i) => i !== x && i !== y);
    const rows = state.brush?.search === search.name ? new Set(state.brush.rows) : null;
    const own = third === undefined ? [] : values.map((v) => v[third]);
    const [low, high] = [Math.min(...own), Math.max(...own)];
    const shade = (share) => rsmkit.bands.css(rsmkit.bands.colour(share));
    const words = (v, p) => [...search.minimize.map((key, i) => `${titleOf(key)} ${number(v[i])}`),
      ...data.factors.map((f, j) => `${f.label} ${rsmkit.format.factorValue(f, p[j])}`)].join("\n");
    const front = { kind: "dots", isFront: true, x: values.map((v) => v[x]), y: values.map((v) => v[y]), colour: colour("accent"),
      colours: third === undefined ? undefined : own.map((v) => shade((v - low) / (high - low || 1))),
      opacities: rows ? values.map((_, i) => (rows.has(i) ? 1 : 0.18)) : undefined, texts: values.map((v, i) => words(v, points[i])) };
    const knee = { kind: "dots", x: [search.objectives[x]], y: [search.objectives[y]], shape: "star", size: 6, colour: "#ffdd33", edge: "#222", opacity: 1,
      texts: [`knee: ${search.objectives.map((v) => number(v)).join(", ")}`] };
    return { label: `Pareto front of ${search.name}`, height: 430, x: { title: titleOf(search.minimize[x]) }, y: { title: titleOf(search.minimize[y]) },
      marks: [front, knee], scale: third === undefined ? null : { title: titleOf(search.minimize[third]), low, high, colour: shade },
      pick: (mark, i) => { if (mark.isFront) state.set({ point: points[i] }); },
      brush: (found) => brushed(search, points, found) };
  }

  return { open };
})();
