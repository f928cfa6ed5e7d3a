// Contours and the three-dimensional surface of one quantity over two factors, the others held.
"use strict";

rsmkit.contours = (function () {
  const { element, section, choice, number, factorValue } = rsmkit.format;
  const GRID = 37;
  let data, study, state, choices;
  let cached = { key: "", grid: null };

  function open() {
    ({ data, study, state } = rsmkit);
    const numeric = data.factors.map((f, j) => [String(j), f.label]).filter(([j]) => data.factors[j].kind !== "categorical");
    if (numeric.length < 2) return;
    choices = {
      quantity: choice("Show", study.quantities.map((q) => [q.key, q.title]), state.quantity,
        (key) => state.set({ quantity: key })),
      x: choice("across", numeric, String(state.x), (j) => pick("x", +j)),
      y: choice("up", numeric, String(state.y), (j) => pick("y", +j)),
    };
    const flat = element("div", { role: "img", "aria-label": "Contours of the chosen quantity" });
    const solid = element("div", { role: "img", "aria-label": "Surface of the chosen quantity" });
    section("contours", "Contours and surface",
      element("div", { class: "bar" }, choices.quantity, choices.x, choices.y),
      element("div", { class: "pair" }, flat, solid),
      element("p", { class: "fine" }, legend()));
    const keys = ["point", "x", "y", "quantity", "brush"];
    rsmkit.charts.add(flat, contourChart, keys, (host) => {
      host.on("plotly_click", (event) => {
        const point = state.point.slice();
        point[state.x] = state.snap(data.factors[state.x], event.points[0].x);
        point[state.y] = state.snap(data.factors[state.y], event.points[0].y);
        state.set({ point });
      });
    });
    rsmkit.charts.add(solid, surfaceChart, ["point", "x", "y", "quantity"]);
  }

  function legend() {
    const unknown = Object.values(data.functions).some((table) => table === null);
    const shade = !data.constraints.length ? ""
      : unknown ? " The region that the constraints forbid is not shown: it depends on functions of too many factors."
        : ` Grey: forbidden by ${data.constraints.map((c) => c.text).join(", ")}.`;
    return `Red: the current design; click to move it. Stars: optima. Dots: runs.${shade}`;
  }

  // Choosing the factor of the other axis swaps the two.
  function pick(axis, j) {
    const other = axis === "x" ? "y" : "x";
    state.set(state[other] === j ? { [axis]: j, [other]: state[axis] } : { [axis]: j });
  }

  // Values of the quantity and of the worst margin on the grid through the current design.
  function grid() {
    const { x, y, point, quantity } = state;
    const others = point.filter((_, j) => j !== x && j !== y);
    const key = JSON.stringify([x, y, quantity, others]);
    if (cached.key === key) return cached.grid;
    const chosen = study.quantities.find((q) => q.key === quantity);
    const nodes = (factor) => Array.from({ length: GRID },
      (_, i) => factor.low + (factor.high - factor.low) * i / (GRID - 1));
    const xs = nodes(data.factors[x]), ys = nodes(data.factors[y]);
    const moved = point.slice();
    const over = (f) => ys.map((v) => xs.map((u) => { moved[x] = u; moved[y] = v; return f(moved); }));
    cached = { key, grid: { xs, ys, z: over(chosen.value),
      margin: data.constraints.length ? over(study.margin) : null } };
    return cached.grid;
  }

  function contourChart() {
    const { xs, ys, z, margin } = grid();
    const { x, y, point } = state;
    const { colour } = rsmkit.charts;
    const chosen = study.quantities.find((q) => q.key === state.quantity);
    const traces = [{ type: "contour", x: xs, y: ys, z, colorscale: "Viridis", ncontours: 14, line: { width: 0.8 },
      contours: { coloring: "heatmap", showlabels: true, labelfont: { size: 10, color: "#fff" }, labelformat: ".3~g" },
      colorbar: { thickness: 10, outlinewidth: 0, exponentformat: "e" },
      hovertemplate: `${data.factors[x].label} %{x:.4g}<br>${data.factors[y].label} %{y:.4g}<br>%{z:.5g}<extra></extra>` }];
    if (margin && margin.some((row) => row.some((m) => m < 0))) {
      traces.push({ type: "contour", x: xs, y: ys, z: margin, showscale: false, hoverinfo: "skip",
        contours: { type: "constraint", operation: "<", value: 0 }, fillcolor: "rgba(110,110,110,0.72)",
        line: { color: colour("ink"), width: 1.5 } });
    }
    const runs = data.points.map((run, i) => [run[x], run[y], chosen.observed[i], data.kinds[i]]);
    traces.push(marks(runs, { color: "#fff", size: 6, line: { color: "#222", width: 1 } },
      runs.map(([, , v, kind]) => `${kind} run: ${number(v)}`)));
    if (state.brush) {
      traces.push(marks(state.brush.points.map((p) => [p[x], p[y]]), { color: "#ff9f1c", size: 5 }, "brushed"));
    }
    const best = data.searches.map((search) => state.pointOf(search.factors));
    traces.push(marks(best.map((p) => [p[x], p[y]]), { symbol: "star", color: "#ffdd33", size: 15,
      line: { color: "#222", width: 1 } }, data.searches.map((search) => `optimum ${search.name}`)));
    traces.push(marks([[point[x], point[y]]], { color: colour("now"), size: 12, line: { color: "#fff", width: 2 } },
      "current design"));
    const range = (f) => [f.low - 0.02 * (f.high - f.low), f.high + 0.02 * (f.high - f.low)];
    return { traces, layout: { height: 420,
      xaxis: { title: { text: data.factors[x].title }, range: range(data.factors[x]) },
      yaxis: { title: { text: data.factors[y].title }, range: range(data.factors[y]) }, hovermode: "closest",
      uirevision: `${x} ${y}` } };
  }

  function marks(points, marker, text) {
    return { type: "scatter", mode: "markers", x: points.map((p) => p[0]), y: points.map((p) => p[1]), marker, text,
      hovertemplate: "%{text}<extra></extra>" };
  }

  function surfaceChart() {
    const { xs, ys, z } = grid();
    const { x, y, point } = state;
    const chosen = study.quantities.find((q) => q.key === state.quantity);
    const traces = [
      { type: "surface", x: xs, y: ys, z, colorscale: "Viridis", showscale: false, opacity: 0.94, hoverinfo: "x+y+z" },
      { type: "scatter3d", mode: "markers", x: [point[x]], y: [point[y]], z: [chosen.value(point)],
        marker: { color: rsmkit.charts.colour("now"), size: 6 }, hovertemplate: "current design<extra></extra>" },
    ];
    return { traces, layout: { height: 420, margin: { l: 0, r: 0, t: 0, b: 0 }, scene: {
      xaxis: { title: { text: data.factors[x].label } }, yaxis: { title: { text: data.factors[y].label } },
      zaxis: { title: { text: "" } }, camera: { eye: { x: 1.5, y: -1.6, z: 0.9 } } } } };
  }

  function update(keys) {
    if (!choices) return;
    if (keys.has("quantity")) choices.quantity.select.value = state.quantity;
    if (keys.has("x") || keys.has("y")) {
      choices.x.select.value = state.x;
      choices.y.select.value = state.y;
    }
  }

  return { open, update };
})();
