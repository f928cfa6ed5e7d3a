// The views: tabs beside the current design on a desk, sections one after the other on a telephone and on paper.
"use strict";

rsmkit.views = (function () {
  const { element } = rsmkit.format;

  // Every view with the parts it is made of. A part adds its sections in `open()`; a view without any is left out.
  const LIST = [
    { id: "profile", title: "Profile", parts: ["profiler", "traces", "goals", "pins"] },
    { id: "map", title: "Contours", parts: ["ternary", "contours"] },
    { id: "trade-off", title: "Trade-off", parts: ["pareto", "parallel"] },
    { id: "quality", title: "Fit", parts: ["runs", "fit"] },
    { id: "uncertainty", title: "Uncertainty", parts: ["uncertainty"] },
    { id: "progress", title: "Search and refinement", parts: ["searches", "refinement"] },
    { id: "thing", title: "Object", parts: ["stage"] },
  ];
  const desk = matchMedia("(min-width: 900px)");
  let shown = [], tabs, panel;

  function open() {
    const host = document.getElementById("views");
    tabs = element("div", { id: "tabs", role: "tablist", "aria-label": "Views" });
    for (const view of LIST) {
      view.panel = panel = element("div", { id: `view-${view.id}`, class: "view" });
      host.append(panel);
      for (const part of view.parts) rsmkit[part].open();
      if (!panel.childElementCount) { panel.remove(); continue; }
      view.tab = element("button", { type: "button", role: "tab", id: `tab-${view.id}`, "aria-controls": panel.id,
        onclick: () => choose(view.id), onkeydown: (event) => walk(event, view) }, view.title);
      tabs.append(view.tab);
      shown.push(view);
    }
    host.before(tabs);
    desk.addEventListener("change", arrange);
    arrange();
  }

  const parts = () => LIST.flatMap((view) => view.parts.map((part) => rsmkit[part]));

  // Adds a section to the view that is being opened.
  const add = (section) => panel.append(section);

  function choose(id) {
    rsmkit.state.set({ view: id });
    rsmkit.state.flush();
  }

  // Arrow keys walk along the tabs.
  function walk(event, view) {
    const step = { ArrowRight: 1, ArrowLeft: -1, Home: -shown.indexOf(view), End: shown.length - 1 - shown.indexOf(view) }[event.key];
    if (step === undefined) return;
    const next = shown[(shown.indexOf(view) + step + shown.length) % shown.length];
    choose(next.id);
    next.tab.focus();
    event.preventDefault();
  }

  // Shows the chosen view; on a telephone all of them.
  function arrange() {
    const chosen = shown.find((view) => view.id === rsmkit.state.view) ?? shown[0];
    for (const view of shown) {
      const isChosen = view === chosen;
      view.tab.setAttribute("aria-selected", isChosen);
      view.tab.tabIndex = isChosen ? 0 : -1;
      view.panel.classList.toggle("chosen", isChosen);
      if (desk.matches) {
        view.panel.setAttribute("role", "tabpanel");
        view.panel.setAttribute("aria-labelledby", view.tab.id);
      } else {
        view.panel.removeAttribute("role");
        view.panel.removeAttribute("aria-labelledby");
      }
    }
  }

  function update(keys) {
    if (keys.has("view")) arrange();
  }

  const has = (id) => shown.some((view) => view.id === id);

  return { open, update, parts, add, choose, has };
})();
