// Charts: drawn when they come into view and whenever something they show has changed.
"use strict";

rsmkit.charts = (function () {
  const FRAME = 16;  // milliseconds
  const charts = [];
  const colours = new Map();
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
      if (!contentRect.width || Math.abs(contentRect.width - chart.width) < 1) continue;
      chart.width = contentRect.width;
      chart.stale = true;
    }
    work();
  });

  // Adds a chart to a host element: `paint(host, width)` draws it, `plot()` returns what rsmkit.plot is to draw; `keys`
  // are the parts of the state that it shows; `move(host)` follows the current design where that is cheaper than
  // drawing anew, as it is where only `follows` has changed. A chart that is out of sight, or in a view that is not chosen, costs nothing.
  function add(host, { paint = null, plot = null, keys, move = null, follows = ["point"] }) {
    host.classList.add("chart");
    charts.push({ host, paint: paint ?? ((at, width) => rsmkit.plot.draw(at, width, plot())), move, follows,
      keys: new Set([...keys, "theme"]), visible: false, stale: true, moved: false, made: false, width: host.clientWidth, drawn: 0 });
    watcher.observe(host);
    sizes.observe(host);
  }

  function draw(chart) {
    if (!chart.width) return;
    if (chart.made && !chart.stale) chart.move(chart.host);
    else chart.paint(chart.host, chart.width);
    chart.stale = chart.moved = false;
    chart.drawn = performance.now();
    if (chart.made) return;
    chart.made = true;
    chart.host.dataset.drawn = "true";
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

  // Draws every chart at once at the width it has now, seen or not: paper has no scrolling.
  function drawAll() {
    for (const chart of charts) {
      const width = chart.host.clientWidth;
      if (width && Math.abs(width - chart.width) >= 1) [chart.width, chart.stale] = [width, true];
      if (chart.stale || chart.moved) draw(chart);
    }
  }

  function update(keys) {
    if (keys.has("theme")) colours.clear();
    for (const chart of charts) {
      const shown = [...keys].filter((key) => chart.keys.has(key));
      if (!shown.length) continue;
      if (chart.move && shown.every((key) => chart.follows.includes(key))) chart.moved = true;
      else chart.stale = true;
    }
    work();
  }

  // A colour of the page; asking the browser is slow, so each is asked for once per theme.
  function colour(name) {
    if (!colours.has(name)) {
      colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
    }
    return colours.get(name);
  }

  return { add, update, start: work, drawAll, colour };
})();
