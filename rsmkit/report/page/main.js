// Starts the page: builds the study from its data, then the current design and every view, then keeps them up to date.
"use strict";

rsmkit.start = function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  rsmkit.data = data;
  rsmkit.study = rsmkit.models.build(data);
  rsmkit.state.open(data);
  rsmkit.current.open();
  rsmkit.views.open();
  const listening = [rsmkit.current, rsmkit.limits, rsmkit.views, ...rsmkit.views.parts(), rsmkit.charts];
  rsmkit.state.listen((keys) => {
    for (const part of listening) part.update?.(keys);
  });
  document.getElementById("theme").addEventListener("click", () => rsmkit.theme.choose(rsmkit.theme.isDark() ? "light" : "dark"));
  rsmkit.theme.openPrinting();
  document.documentElement.dataset.ready = "true";
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

  // On paper the page is light and complete: every view, one after the other, as wide as a sheet.
  openPrinting: () => {
    let chosen;
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => rsmkit.state.set({ theme: "system" }));
    window.addEventListener("beforeprint", () => {
      chosen = document.documentElement.dataset.theme;
      document.documentElement.dataset.paper = "true";
      rsmkit.theme.choose("light");
      for (const folded of document.querySelectorAll("details")) folded.open = true;
      rsmkit.charts.drawAll();
    });
    window.addEventListener("afterprint", () => {
      delete document.documentElement.dataset.paper;
      rsmkit.theme.choose(chosen);
    });
  },
};
