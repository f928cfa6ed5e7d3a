// Starts the page: builds the study from its data, then every view, then keeps them up to date. The charts appear
// once plotly, the last and by far the largest script, has been read.
"use strict";

rsmkit.start = function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  rsmkit.data = data;
  rsmkit.study = rsmkit.models.build(data);
  rsmkit.state.open(data);
  const views = [rsmkit.profiler, rsmkit.stage, rsmkit.contours, rsmkit.pareto, rsmkit.parallel, rsmkit.pins, rsmkit.fit,
    rsmkit.searches, rsmkit.refinement, rsmkit.charts];
  for (const view of views) view.open?.();
  rsmkit.state.listen((keys) => {
    const started = performance.now();
    for (const view of views) view.update?.(keys);
    rsmkit.redrawMilliseconds = performance.now() - started;
  });
  document.getElementById("theme").addEventListener("click", () => {
    const dark = rsmkit.theme.isDark();
    document.documentElement.dataset.theme = dark ? "light" : "dark";
    rsmkit.state.set({ theme: dark ? "light" : "dark" });
  });
  document.documentElement.dataset.ready = "true";
};

rsmkit.theme = {
  isDark: () => {
    const chosen = document.documentElement.dataset.theme;
    return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  },
};
