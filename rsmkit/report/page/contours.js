// Contours and the three-dimensional surface of one quantity over two factors, the others held.
"use strict";

rsmkit.contours = (function () {
  const { element, section, choice, number, plain } = rsmkit.format;
  const FLAT = 25, SOLID = 17;  // grid lines of the contours and of the surface
  let data, study, state, choices;
  let drawn = "", solid = "";  // what the contours and the surface were computed for

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
    rsmkit.charts.add(flat, { build: contourChart, keys: ["point", "x", "y", "quantity", "brush"], move: moveContours,
      ready: (host) => host.on("plotly_click", goTo) });
    rsmkit.charts.add(solid, { build: surfaceChart, keys: ["point", "x", "y", "quantity"], move: moveSurface });
  }

  function goTo(event) {
    const point = state.point.slice();
    point[state.x] = state.snap(data.factors[state.x], event.points[0].x);
    point[state.y] = state.snap(data.factors[state.y], event.points[0].y);
    state.set({ point });
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

  const chosen = () => study.quantities.find((q) => q.key === state.quantity);

  // Values of a function on a grid of the two factors through the current design.
  function grid(f, count) {
    const { x, y } = state;
    const nodes = (factor) => Array.from({ length: count },
      (_, i) => factor.low + (factor.high - factor.low) * i / (count - 1));
    const xs = nodes(data.factors[x]), ys = nodes(data.factors[y]);
    const moved = state.point.slice();
    return { x: xs, y: ys, z: ys.map((v) => xs.map((u) => { moved[x] = u; moved[y] = v; return f(moved); })) };
  }

  const violation = (point) => -study.margin(point);

  const isViolated = (rows) => rows.some((row) => row.some((v) => v > 0));

  // Identifies the slice through the box that the contours show.
  const slice = () => JSON.stringify(state.point.filter((_, j) => j !== state.x && j !== state.y));

  const rings = () => [rsmkit.charts.ring(state.point[state.x], state.point[state.y])];

  function moveContours(host) {
    if (slice() === drawn) {
      Plotly.relayout(host, { shapes: rings() });
      return;
    }
    drawn = slice();
    const z = [grid(chosen().value, FLAT).z];
    const shade = data.constraints.length ? grid(violation, FLAT).z : null;
    if (shade && (isViolated(shade) || isViolated(host.data[1].z))) z.push(shade);
    Plotly.update(host, { z }, { shapes: rings() }, z.map((_, i) => i));
  }

  function contourChart() {
    const { x, y } = state;
    const { colour } = rsmkit.charts;
    drawn = slice();
    const traces = [{ type: "contour", ...grid(chosen().value, FLAT), colorscale: "Viridis", ncontours: 18,
      line: { width: 0.6, color: "rgba(255,255,255,0.55)" }, contours: { coloring: "fill" },
      colorbar: { thickness: 10, outlinewidth: 0, exponentformat: "e" },
      hovertemplate: `${plain(data.factors[x].label)} %{x:.4g}<br>${plain(data.factors[y].label)} %{y:.4g}<br>%{z:.5g}<extra></extra>` }];
    if (data.constraints.length) {
      traces.push({ type: "contour", ...grid(violation, FLAT), showscale: false, hoverinfo: "skip",
        contours: { start: 0, end: 0, size: 1, coloring: "fill" }, autocontour: false,
        colorscale: [[0, "rgba(110,110,110,0)"], [1, "rgba(110,110,110,0.75)"]], line: { color: colour("ink"), width: 1.5 } });
    }
    const { observed } = chosen();
    const runs = data.points.map((run, i) => [run[x], run[y], observed[i], data.kinds[i]]);
    traces.push(marks(runs, { color: "#fff", size: 6, line: { color: "#222", width: 1 } },
      runs.map(([, , v, kind]) => `${kind} run: ${number(v)}`)));
    if (state.brush) {
      traces.push(marks(state.brush.points.map((p) => [p[x], p[y]]), { color: "#ff9f1c", size: 5 }, "brushed"));
    }
    const best = data.searches.map((search) => state.pointOf(search.factors));
    traces.push(marks(best.map((p) => [p[x], p[y]]), { symbol: "star", color: "#ffdd33", size: 15,
      line: { color: "#222", width: 1 } }, data.searches.map((search) => `optimum ${search.name}`)));
    const range = (f) => [f.low - 0.02 * (f.high - f.low), f.high + 0.02 * (f.high - f.low)];
    return { traces, layout: { height: 420, shapes: rings(),
      xaxis: { title: { text: plain(data.factors[x].title) }, range: range(data.factors[x]) },
      yaxis: { title: { text: plain(data.factors[y].title) }, range: range(data.factors[y]) }, hovermode: "closest",
      uirevision: `${x} ${y}` } };
  }

  function marks(points, marker, text) {
    return { type: "scatter", mode: "markers", x: points.map((p) => p[0]), y: points.map((p) => p[1]), marker, text,
      hovertemplate: "%{text}<extra></extra>" };
  }

  function surfaceChart() {
    const { x, y, point } = state;
    solid = slice();
    const traces = [
      { type: "surface", ...grid(chosen().value, SOLID), colorscale: "Viridis", showscale: false, hoverinfo: "x+y+z" },
      { type: "scatter3d", mode: "markers", x: [point[x]], y: [point[y]], z: [chosen().value(point)],
        marker: { color: rsmkit.charts.colour("now"), size: 6 }, hovertemplate: "current design<extra></extra>" },
    ];
    return { traces, layout: { height: 420, margin: { l: 0, r: 0, t: 0, b: 0 }, scene: {
      xaxis: { title: { text: plain(data.factors[x].label) } }, yaxis: { title: { text: plain(data.factors[y].label) } },
      zaxis: { title: { text: "" } }, camera: { eye: { x: 0.9, y: -1.9, z: 0.9 } } } } };
  }

  function moveSurface(host) {
    const { x, y, point } = state;
    const marker = { x: [[point[x]]], y: [[point[y]]], z: [[chosen().value(point)]] };
    if (slice() === solid) {
      Plotly.restyle(host, marker, [1]);
      return;
    }
    solid = slice();
    const surface = grid(chosen().value, SOLID);
    Plotly.restyle(host, { x: [surface.x, ...marker.x], y: [surface.y, ...marker.y], z: [surface.z, ...marker.z] }, [0, 1]);
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
