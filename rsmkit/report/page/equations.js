// The equation of a surface, to copy into other programs. Coefficients are Python's, with all their digits.
"use strict";

rsmkit.equations = (function () {
  const { element, choice, copy } = rsmkit.format;
  const LONGEST_CELL = 8000;  // letters; Excel takes 8192 in a cell
  const KEYWORDS = new Set(["False", "None", "True", "and", "as", "assert", "async", "await", "break", "class", "continue", "def",
    "del", "elif", "else", "except", "finally", "for", "from", "global", "if", "import", "in", "is", "lambda", "nonlocal", "not", "or",
    "pass", "raise", "return", "try", "while", "with", "yield"]);
  const LANGUAGES = { text: "text", python: "Python", excel: "Excel", latex: "LaTeX" };

  const name = (text) => {
    const plain = text.replace(/\W/g, "_").replace(/^(?=\d)/, "_");
    return KEYWORDS.has(plain) ? `${plain}_` : plain;
  };

  // The terms as signed products: write(coefficient without sign) and the factors' texts.
  function terms(equation, write, variable, times, power) {
    const parts = equation.terms.map(([b, powers]) => {
      const product = powers.map(([j, p]) => (p === 1 ? variable(j) : power(variable(j), p))).join(times);
      return [b < 0 ? "-" : "+", product ? `${write(Math.abs(b))}${times}${product}` : write(Math.abs(b))];
    });
    return parts.length ? parts : [["+", "0"]];
  }

  const joined = (parts, between) => parts.map(([sign, text], i) => (i ? `${between}${sign} ${text}` : `${sign === "-" ? "-" : ""}${text}`)).join("");

  const numeric = () => rsmkit.data.factors.map((f, j) => j).filter((j) => rsmkit.data.factors[j].numeric);

  const where = (equation) => Object.entries(equation.category).map(([factor, level]) => `${factor} = ${level}`).join(", ");

  const coding = (equation) => numeric().filter((j) => equation.coding[j]?.some((v, i) => v !== i)).map((j) => {
    const [center, half] = equation.coding[j], factor = rsmkit.data.factors[j].name;
    return `${factor} coded: (${factor} - ${center}) / ${half}`;
  });

  const notes = (equation) => [where(equation), ...coding(equation)].filter(Boolean);

  // What is predicted, from the text of a polynomial: the transformed response turned back, the share or rate of a count.
  const BACK = {
    power: (exp, power, z, { power: p }) => (p === 0 ? exp(z) : power(`(1 ${p < 0 ? "-" : "+"} ${Math.abs(p)}*(${z}))`, `(1/${p < 0 ? `(${p})` : p})`)),
    logistic: (exp, power, z) => `1/(1 + ${exp(`-(${z})`)})`,
    exponential: (exp, power, z) => exp(z),
  };
  const turned = (back, exp, power, text) => (back ? BACK[back.function](exp, power, text, back) : text);

  function python(equation, response, back) {
    const parts = terms(equation, String, (j) => name(rsmkit.data.factors[j].name), "*", (x, p) => `${x}**${p}`);
    const given = numeric().map((j) => name(rsmkit.data.factors[j].name)).join(", ");
    const sum = turned(back, (z) => `np.exp(${z})`, (x, p) => `${x}**${p}`, joined(parts, "\n            "));
    return [...(back ? ["import numpy as np", ""] : []), ...notes(equation).map((text) => `# ${text}`), `def ${name(response)}(${given}):`,
      `    return (${sum})`].join("\n");
  }

  // In words, with as many digits as predictions need.
  function plain(equation, response, back) {
    const parts = terms(equation, (b) => String(Number(b.toPrecision(equation.digits))), (j) => rsmkit.data.factors[j].name, "*", (x, p) => `${x}^${p}`);
    return `${response} = ${turned(back, (z) => `exp(${z})`, (x, p) => `${x}^${p}`, joined(parts, " "))}`;
  }

  const column = (i) => (i < 26 ? String.fromCharCode(65 + i) : column(Math.floor(i / 26) - 1) + column(i % 26));

  function excel(equation, back) {
    const places = numeric();
    const cell = (j) => `${column(places.indexOf(j))}2`;
    const parts = terms(equation, (b) => String(b).toUpperCase(), cell, "*", (x, p) => `${x}^${p}`);
    const formulas = [""];
    for (const [sign, text] of parts) {
      if (formulas.at(-1).length + text.length > LONGEST_CELL) formulas.push("");
      formulas[formulas.length - 1] += `${formulas.at(-1) || sign === "-" ? sign : ""}${text}`;
    }
    const said = places.map((j) => `${rsmkit.data.factors[j].name}${equation.units === "coded" ? " (coded)" : ""} in ${cell(j)}`).join(", ");
    const whole = (text) => turned(back, (z) => `EXP(${z})`, (x, p) => `${x}^${p}`, text);
    if (formulas.length === 1) return { note: [where(equation), said].filter(Boolean).join("; "), text: `=${whole(formulas[0])}` };
    const long = `too long for one cell: put each formula into its own and add them${back ? `; the prediction is ${whole("sum")}` : ""}`;
    return { note: [where(equation), said, long].filter(Boolean).join("; "), text: formulas.map((formula) => `=${formula}`).join("\n") };
  }

  const upright = (text) => `\\mathrm{${text.replace(/[\\{}$&#^_%~]/g, (c) => ({ "\\": "\\backslash ", "^": "\\hat{}", "~": "\\sim " })[c] ?? `\\${c}`)}}`;

  function latex(equation, response, back) {
    const write = (b) => {
      const [mantissa, exponent] = b.toPrecision(equation.digits).split("e");
      return exponent ? `${Number(mantissa)} \\times 10^{${Number(exponent)}}` : String(Number(mantissa));
    };
    const parts = terms(equation, write, (j) => upright(rsmkit.data.factors[j].name), "\\,", (x, p) => `${x}^{${p}}`);
    const sum = joined(parts, "\n  ");
    return `\\widehat{${upright(response)}} = ${back ? LATEX_BACK[back.function](sum, back.power) : sum}`;
  }

  const LATEX_BACK = {
    power: (z, p) => (p === 0 ? `\\exp\\left(${z}\\right)` : `\\left(1 ${p < 0 ? "-" : "+"} ${Math.abs(p)} \\left(${z}\\right)\\right)^{1/${p < 0 ? `(${p})` : p}}`),
    logistic: (z) => `\\frac{1}{1 + \\exp\\left(-\\left(${z}\\right)\\right)}`,
    exponential: (z) => `\\exp\\left(${z}\\right)`,
  };

  // The text, and a note to read beside it; `back` turns the polynomial into what is predicted.
  function written(equation, language, response, texts, back) {
    if (language === "excel") return excel(equation, back);
    const note = notes(equation).join("; ");
    if (language === "python") return { note: "", text: python(equation, response, back) };
    if (language === "latex") return { note, text: latex(equation, response, back) };
    if (back) return { note, text: plain(equation, response, back) };
    const own = texts.by_category?.find?.((each) => Object.entries(equation.category).every(([key, level]) => each.category[key] === level));
    return { note, text: (own ?? texts)[equation.units] };
  }

  // The units of the coefficients in words.
  const unitsOf = ({ units }) => (units === "proportions" ? "proportions, other factors coded" : "coded units");

  // Pickers, text and a button; `fit` is the surface's scene, `report` its statistics.
  function panel(fit, report, response) {
    const found = fit.polynomial;
    if (!found) return element("p", { class: "fine" }, "This kind of surface has no equation to write down.");
    const words = [found.is_beside ? element("p", { class: "fine" }, "The surface itself is no polynomial; this is the polynomial of the same runs.") : null,
      found.texts.note ? element("p", { class: "fine" }, `Note: ${found.texts.note}.`) : null].filter(Boolean);
    if (!found.equations.length) {
      const why = found.texts.reason || (found.texts.natural ? "too many combinations of categories to write each" : "it predicts a function of its polynomial");
      return element("div", {}, ...words, element("p", { class: "fine" }, `Not written for other programs: ${why}.`),
        ...[found.texts.natural, found.texts.coded].filter(Boolean).map((text) => element("pre", { class: "equation", tabindex: "0" }, text)));
    }
    const chosen = { language: "text", units: "natural", category: "" };
    const box = element("pre", { class: "equation", tabindex: "0", "aria-label": "Equation" }), note = element("p", { class: "fine" });
    const fill = () => {
      const equation = found.equations.find((e) => e.units === chosen.units && where(e) === chosen.category);
      const made = written(equation, chosen.language, response, found.texts, found.back);
      box.textContent = made.text;
      note.textContent = made.note;
    };
    const pick = (key) => (value) => { chosen[key] = value; fill(); };
    const categories = [...new Set(found.equations.map(where))];
    chosen.category = categories[0];
    fill();
    return element("div", {}, ...words, element("div", { class: "bar" },
      choice("For", Object.entries(LANGUAGES), chosen.language, pick("language")),
      choice("in", [["natural", "natural units"], ["coded", unitsOf(report)]], chosen.units, pick("units")),
      categories.length > 1 ? choice("where", categories.map((c) => [c, c]), chosen.category, pick("category")) : null,
      element("button", { type: "button", onclick: () => copy(box.textContent, "the equation") }, "Copy")), box, note);
  }

  return { panel, written };
})();
