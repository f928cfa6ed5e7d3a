// Numbers and elements: how values are written, and small helpers for building the page.
"use strict";

rsmkit.format = (function () {
  // Writes a value with as many digits as `resolution` (such as half an interval) justifies.
  function number(value, resolution) {
    if (value === null || value === undefined || Number.isNaN(value)) return "–";
    if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
    let digits = 4;
    if (resolution > 0 && Number.isFinite(resolution) && value !== 0) {
      digits = Math.ceil(Math.log10(Math.abs(value) / resolution)) + 1;
      digits = Math.min(6, Math.max(2, digits));
    }
    const size = Math.abs(value);
    if (size !== 0 && (size >= 1e5 || size < 1e-3)) {
      return value.toExponential(digits - 1).replace("e+", "e").replaceAll("-", "−");
    }
    return String(Number(value.toPrecision(digits))).replace("-", "−");
  }

  const halfWidth = ([low, high]) => (high - low) / 2;

  // A round number at an axis.
  function tick(value) {
    const rounded = Number(value.toPrecision(4));
    const size = Math.abs(rounded);
    const text = size !== 0 && (size >= 1e5 || size < 1e-3) ? rounded.toExponential().replace("e+", "e") : String(rounded);
    return text.replaceAll("-", "−");
  }

  // A factor's value, to a thousandth of its range.
  function factorValue(factor, value) {
    if (!factor.numeric) return factor.levels[value];
    const step = (factor.high - factor.low) / 1000;
    const decimals = Math.max(0, Math.ceil(-Math.log10(step)));
    return String(Number(value.toFixed(decimals)));
  }

  // A number in a field, to be typed over: never longer than the field.
  function typed(value) {
    const short = Number(value.toPrecision(6));
    return Math.abs(short) >= 1e6 ? short.toExponential().replace("e+", "e") : String(short);
  }

  // A value and half its interval, with all digits that the interval justifies.
  function measured(value, half) {
    const text = number(value, half);
    if (!(half > 0) || !Number.isFinite(half) || !Number.isFinite(value) || half < 1e-9 * Math.abs(value) || text.includes("e")) return text;
    const digits = Math.min(6, Math.max(2, Math.ceil(Math.log10(Math.abs(value) / half)) + 1));
    return value === 0 ? text : value.toPrecision(digits).includes("e") ? text : value.toPrecision(digits).replace("-", "−");
  }

  // The value as the simulator receives it.
  const exact = (factor, value) => (factor.numeric ? value : factor.levels[value]);

  // Round numbers that divide [low, high] into about `count` parts.
  function ticks(low, high, count) {
    if (!(high > low)) return [low];
    const rough = (high - low) / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough);
    const found = [];
    for (let i = Math.ceil(low / step); i * step <= high * (1 + 1e-12); i++) found.push(i * step);
    return found;
  }

  // Creates an element: element("p", {class: "fine"}, "text", child, ...).
  function element(name, attributes = {}, ...children) {
    const made = document.createElement(name);
    return fill(made, attributes, children);
  }

  function svg(name, attributes = {}, ...children) {
    return fill(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
  }

  function fill(made, attributes, children) {
    for (const [key, value] of Object.entries(attributes)) {
      if (key.startsWith("on")) made.addEventListener(key.slice(2), value);
      else if (value !== null && value !== undefined && value !== false) made.setAttribute(key, value === true ? "" : value);
    }
    made.append(...children.filter((child) => child !== null && child !== undefined));
    return made;
  }

  // A section of the view that is being opened, with a title.
  function section(id, title, ...children) {
    const made = element("section", { id, "aria-labelledby": `${id}-title` },
      element("h2", { id: `${id}-title` }, title), ...children);
    rsmkit.views.add(made);
    return made;
  }

  // A select whose options are [value, text] pairs.
  function choice(label, options, value, onchange) {
    const select = element("select", { "aria-label": label, onchange: (event) => onchange(event.target.value) },
      ...options.map(([key, text]) => element("option", { value: key, selected: key === value }, text)));
    const made = element("label", { class: "choice" }, `${label} `, select);
    made.select = select;
    return made;
  }

  const announce = (text) => { document.getElementById("announcer").textContent = text; };

  // Copies a text and says that `what` was copied.
  async function copy(text, what) {
    try {
      await navigator.clipboard.writeText(text);
    } catch {  // pages opened from a file may not use the clipboard
      const area = element("textarea", { class: "unseen" });
      area.value = text;
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
    announce(`Copied ${what}`);
  }

  return { number, typed, measured, halfWidth, tick, factorValue, exact, ticks, element, svg, section, choice, announce, copy };
})();
