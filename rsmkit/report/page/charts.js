// Charts drawn by plotly: created when they scroll into view, redrawn when something they show has changed.
"use strict";

rsmkit.charts = (function () {
  const charts = [];
  const config = { displaylogo: false, responsive: true, displayModeBar: "hover",
    modeBarButtonsToRemove: ["toImage", "resetCameraLastSave3d"] };
  const watcher = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const chart = charts.find((c) => c.host === entry.target);
      chart.visible = entry.isIntersecting;
      if (chart.visible && chart.stale) draw(chart);
    }
  }, { rootMargin: "150px" });

  // Adds a chart to a host element. `build()` returns { traces, layout }; `keys` are the parts of the state that
  // it shows; `ready(host)` is called once, to attach plotly's events.
  function add(host, build, keys, ready = () => {}) {
    host.classList.add("chart");
    charts.push({ host, build, keys: new Set([...keys, "theme"]), ready, visible: false, stale: true, made: false });
    watcher.observe(host);
  }

  function draw(chart) {
    if (typeof Plotly === "undefined") return;  // its script is the last of the page
    chart.stale = false;
    const { traces, layout } = chart.build();
    Plotly.react(chart.host, traces, dressed(layout), config);
    if (!chart.made) {
      chart.made = true;
      chart.ready(chart.host);
    }
  }

  function update(keys) {
    for (const chart of charts) {
      if (![...keys].some((key) => chart.keys.has(key))) continue;
      chart.stale = true;
      if (chart.visible) draw(chart);
    }
  }

  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

  // The layout with the page's colours and fonts.
  function dressed(layout) {
    const axis = { gridcolor: colour("line"), zerolinecolor: colour("line"), linecolor: colour("line"),
      automargin: true, exponentformat: "e" };
    const made = { margin: { l: 56, r: 16, t: 12, b: 44 }, paper_bgcolor: "rgba(0,0,0,0)",
      plot_bgcolor: "rgba(0,0,0,0)", font: { color: colour("ink"), size: 12, family: "system-ui, sans-serif" },
      hoverlabel: { font: { family: "system-ui, sans-serif" } }, uirevision: "keep", showlegend: false,
      legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 }, ...layout };
    for (const key of ["xaxis", "yaxis", "yaxis2"]) {
      if (made[key]) made[key] = { ...axis, ...made[key] };
    }
    if (made.scene) {
      for (const key of ["xaxis", "yaxis", "zaxis"]) {
        made.scene[key] = { gridcolor: colour("line"), color: colour("soft"), backgroundcolor: "rgba(0,0,0,0)",
          exponentformat: "e", ...made.scene[key] };
      }
    }
    return made;
  }

  // Draws what is visible, once plotly is there.
  function start() {
    for (const chart of charts) if (chart.visible && chart.stale) draw(chart);
  }

  return { add, update, start, colour };
})();
