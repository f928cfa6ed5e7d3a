// Pareto fronts of the searches with several objectives: hover, click to go there, drag a box to brush.
"use strict";

rsmkit.pareto = (function () {
  const { element, section, choice, announce, number, plain } = rsmkit.format;
  let data, state;
  let count = 0;

  function open() {
    ({ data, state } = rsmkit);
    for (const search of data.searches.filter((s) => s.front.length > 1)) openFront(search);
  }

  const quantityOf = (key) => rsmkit.study.quantities.find((q) => q.key === key);

  const titleOf = (key) => quantityOf(key)?.title ?? key;

  const plainTitle = (key) => plain(titleOf(key));

  function openFront(search) {
    const axes = search.minimize.map((text, i) => [String(i), titleOf(text)]);
    const shown = { x: 0, y: 1 };
    const host = element("div", { role: "img", "aria-label": `Pareto front of ${search.name}` });
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
    rsmkit.charts.add(host, { build: () => chart(search, points, shown), keys: ["point", "brush", `front ${search.name}`],
      move: (made) => Plotly.relayout(made, { shapes: here(search, shown) }), ready: (made) => listen(made, search, points) });
  }

  function listen(host, search, points) {
    host.on("plotly_click", (event) => {
      const hit = event.points.find((p) => p.curveNumber === 0);
      if (hit) state.set({ point: points[hit.pointIndex] });
    });
    host.on("plotly_selected", (event) => {
      const rows = (event?.points ?? []).filter((p) => p.curveNumber === 0).map((p) => p.pointIndex);
      if (!rows.length) return;
      state.set({ brush: { search: search.name, rows, points: rows.map((row) => points[row]) } });
      announce(`${rows.length} designs brushed`);
    });
  }

  // The current design among the objectives, if the page can evaluate them.
  function here(search, { x, y }) {
    const values = [x, y].map((i) => quantityOf(search.minimize[i])?.value(state.point));
    return values.every(Number.isFinite) ? [rsmkit.charts.ring(...values)] : [];
  }

  function chart(search, points, shown) {
    const { x, y } = shown;
    const { colour } = rsmkit.charts;
    const values = search.front.map((candidate) => candidate.objectives);
    const third = search.minimize.map((_, i) => i).find((i) => i !== x && i !== y);
    const brushed = state.brush?.search === search.name ? state.brush.rows : null;
    const traces = [{ type: "scatter", mode: "markers", x: values.map((v) => v[x]), y: values.map((v) => v[y]),
      selectedpoints: brushed, selected: { marker: { opacity: 1 } }, unselected: { marker: { opacity: 0.18 } },
      text: points.map((p) => data.factors.map((f, j) => plain(`${f.label} ${rsmkit.format.factorValue(f, p[j])}`)).join("<br>")),
      marker: { size: 8, ...(third === undefined ? { color: colour("accent") } : { color: values.map((v) => v[third]),
        colorscale: "Viridis", showscale: true, colorbar: { title: { text: plainTitle(search.minimize[third]), side: "right" },
          thickness: 10, exponentformat: "e" } }) },
      hovertemplate: "%{text}<br>%{x:.5g}, %{y:.5g}<extra></extra>" }];
    traces.push({ type: "scatter", mode: "markers", x: [search.objectives[x]], y: [search.objectives[y]],
      marker: { symbol: "star", size: 15, color: "#ffdd33", line: { color: "#222", width: 1 } },
      hovertemplate: `knee: ${search.objectives.map((v) => number(v)).join(", ")}<extra></extra>` });
    return { traces, layout: { height: 430, dragmode: "select", shapes: here(search, shown), hovermode: "closest",
      xaxis: { title: { text: plainTitle(search.minimize[x]) } }, yaxis: { title: { text: plainTitle(search.minimize[y]) } },
      uirevision: `${x} ${y}` } };
  }

  return { open };
})();
