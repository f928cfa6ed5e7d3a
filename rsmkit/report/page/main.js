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
    for (const view of views) view.update?.(keys);
  });
  document.getElementById("theme").addEventListener("click", () => rsmkit.theme.choose(rsmkit.theme.isDark() ? "light" : "dark"));
  rsmkit.theme.openPrinting();
  document.documentElement.dataset.ready = "true";
  // A first redraw takes twice as long as later ones, until the browser has compiled the scripts: not the reader's.
  requestIdleCallback(() => rsmkit.state.set({ overlay: rsmkit.state.overlay }));
};

rsmkit.theme = {
  isDark: () => {
    const chosen = document.documentElement.dataset.theme;
    return chosen ? chosen === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  },

  // Chooses "light" or "dark"; undefined follows the system.
  choose: (theme) => {
    if (theme) document.documentElement.dataset.theme = theme;
    else delete document.documentElement.dataset.theme;
    rsmkit.state.set({ theme });
    rsmkit.state.flush();
  },

  // On paper the page is light and complete.
  openPrinting: () => {
    let chosen;
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => rsmkit.state.set({ theme: "system" }));
    window.addEventListener("beforeprint", () => {
      chosen = document.documentElement.dataset.theme;
      rsmkit.theme.choose("light");
      for (const folded of document.querySelectorAll("details")) folded.open = true;
      rsmkit.charts.drawAll();
    });
    window.addEventListener("afterprint", () => rsmkit.theme.choose(chosen));
  },
};
