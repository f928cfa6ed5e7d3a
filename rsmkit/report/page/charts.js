// Charts: drawn when they scroll into view and whenever something they show has changed, by plotly or by themselves.
"use strict";

rsmkit.charts = (function () {
  const FRAME = 16;  // milliseconds
  const charts = [];
  const colours = new Map();
  const config = { displaylogo: false, responsive: true, displayModeBar: "hover",
    modeBarButtonsToRemove: ["toImage"] };
  const watcher = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const chart = charts.find((c) => c.host === entry.target);
      chart.visible = entry.isIntersecting;
    }
    work();
  }, { rootMargin: "150px" });
  const sizes = new ResizeObserver((entries) => {
    for (const { target, contentRect } of entries) {
      const chart = charts.find((c) => c.host === target);
      if (Math.abs(contentRect.width - chart.width) < 1) continue;
      chart.width = contentRect.width;
      chart.stale = true;
    }
    work();
  });

  // Adds a chart to a host element. It is drawn by `paint(host, width)`, or by plotly from `build()`, which
  // returns { traces, layout }; `keys` are the parts of the state that it shows; `move(host)` follows the current design where
  // that is cheaper than drawing anew; `ready(host)` is called once, to attach plotly's events.
  function add(host, { paint = null, build = null, keys, move = null, ready = () => {} }) {
    host.classList.add("chart");
    charts.push({ host, paint, build, move, ready, keys: new Set([...keys, "theme"]), visible: false, stale: true,
      moved: false, made: false, width: host.clientWidth, drawn: 0 });
    watcher.observe(host);
    if (paint) sizes.observe(host);
  }

  function draw(chart) {
    if (chart.build && typeof Plotly === "undefined") return;  // its script is the last of the page
    if (chart.made && !chart.stale) {
      chart.move(chart.host);
    } else if (chart.paint) {
      if (!chart.width) return;
      chart.paint(chart.host, chart.width);
    } else {
      const { traces, layout } = chart.build();
      Plotly.react(chart.host, traces, dressed(layout), config);
    }
    chart.stale = chart.moved = false;
    chart.drawn = performance.now();
    if (chart.made) return;
    chart.made = true;
    chart.host.dataset.drawn = "true";
    chart.ready(chart.host);
  }

  // Draws what is out of date and in sight, longest waiting first, for one frame's time at most; the rest follows in
  // the next frames.
  function work() {
    const started = performance.now();
    const waiting = charts.filter((chart) => chart.visible && (chart.stale || chart.moved));
    for (const chart of waiting.sort((a, b) => a.drawn - b.drawn)) {
      if (performance.now() - started > FRAME) {
        requestAnimationFrame(work);
        return;
      }
      draw(chart);
    }
  }

  // Draws every chart at once, seen or not: paper has no scrolling.
  function drawAll() {
    for (const chart of charts) if (chart.stale || chart.moved) draw(chart);
  }

  function update(keys) {
    if (keys.has("theme")) colours.clear();
    for (const chart of charts) {
      const shown = [...keys].filter((key) => chart.keys.has(key));
      if (shown.length === 1 && shown[0] === "point" && chart.move) chart.moved = true;
      else if (shown.length) chart.stale = true;
    }
    work();
  }

  // A ring at a point of a two-dimensional chart: moving a shape costs a tenth of redrawing a trace.
  function ring(x, y) {
    return { type: "circle", xsizemode: "pixel", ysizemode: "pixel", xanchor: x, yanchor: y, x0: -7, x1: 7, y0: -7, y1: 7,
      fillcolor: colour("now"), line: { color: "#fff", width: 2 } };
  }

  // A colour of the page; asking the browser is slow, so each is asked for once per theme.
  function colour(name) {
    if (!colours.has(name)) {
      colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
    }
    return colours.get(name);
  }

  // The layout with the page's colours and fonts.
  function dressed(layout) {
    const axis = { gridcolor: colour("line"), zerolinecolor: colour("line"), linecolor: colour("line"),
      automargin: true, exponentformat: "e" };
    const made = { margin: { l: 56, r: 16, t: 12, b: 44 }, paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)", font: { color: colour("ink"), size: 12, family: "system-ui, sans-serif" },
      hoverlabel: { font: { family: "system-ui, sans-serif" } }, uirevision: "keep", showlegend: false,
      legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 }, ...layout };
    for (const key of ["xaxis", "yaxis", "yaxis2"]) {
      if (!made[key]) continue;
      made[key] = { ...axis, ...made[key] };
      if (made[key].title) made[key].title = { standoff: 12, ...made[key].title };
    }
    return made;
  }

  return { add, update, start: work, drawAll, ring, colour };
})();
