// Pinning up to three designs for comparison, and copying the current one for use elsewhere.
"use strict";

rsmkit.pins = (function () {
  const { element, section, number, measured, halfWidth, factorValue, exact, copy } = rsmkit.format;
  let data, study, state, body, pinButton;

  function open() {
    ({ data, study, state } = rsmkit);
    pinButton = element("button", { type: "button", onclick: pin }, "Pin this design");
    body = element("div", { class: "scroller", tabindex: "0", role: "group", "aria-label": "Comparison of designs" });
    section("pins", "Compare and copy",
      element("div", { class: "bar" }, pinButton,
        ...[["TOML", toml], ["Python", python], ["link", () => location.href.split("#")[0] + state.hash()]].map(([name, text]) =>
          element("button", { type: "button", onclick: () => copy(text(), `as ${name}`) }, `Copy as ${name}`))),
      body);
    update(new Set(["point", "pins"]));
  }

  function pin() {
    if (state.pins.length < 3) state.set({ pins: [...state.pins, state.point.slice()] });
  }

  const names = (write) => data.factors.map((f, j) => write(f.name, JSON.stringify(exact(f, state.point[j])))).join("");
  const toml = () => names((name, value) => `${name} = ${value}\n`);
  const python = () => `{${names((name, value) => `"${name}": ${value}, `).slice(0, -2)}}`;

  function update(keys) {
    if (!keys.has("point") && !keys.has("pins")) return;
    const pins = state.pins;
    pinButton.disabled = pins.length >= 3;
    const columns = [...pins.map((point, i) => [`pin ${i + 1}`, point]), ["current", state.point]];
    const reference = columns[0][1];
    const rows = [
      ...data.factors.map((f, j) => [f.title, ...columns.map(([, point]) => factorValue(f, point[j]))]),
      ...study.quantities.map((q) => [q.title, ...columns.map(([, point], i) => {
        const value = q.value(point), half = halfWidth(q.interval(point));
        const base = q.value(reference);
        const change = i && base ? ` (${number(100 * (value - base) / Math.abs(base), 1)} %)` : "";
        return `${measured(value, half)}${change}`;
      })]),
    ];
    const head = columns.map(([name], i) => element("th", { scope: "col" }, `${name} `, i < pins.length
      ? element("button", { type: "button", class: "small", "aria-label": `Unpin ${name}`,
        onclick: () => state.set({ pins: pins.filter((_, k) => k !== i) }) }, "×") : null,
      i < pins.length ? element("button", { type: "button", class: "small", "aria-label": `Go to ${name}`,
        onclick: () => state.set({ point: pins[i].slice() }) }, "go") : null));
    body.replaceChildren(element("table", {}, element("caption", {}, pins.length ? "Changes are against pin 1" : "The current design"),
      element("thead", {}, element("tr", {}, element("td"), ...head)),
      element("tbody", {}, ...rows.map(([name, ...cells]) => element("tr", {}, element("th", { scope: "row" }, name),
        ...cells.map((cell) => element("td", {}, cell)))))));
  }

  return { open, update };
})();
