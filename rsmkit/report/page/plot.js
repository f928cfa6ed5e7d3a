// Plots over two axes as SVG: dots, lines, bars and rules, with words for what the pointer or the arrow keys are on.
"use strict";

rsmkit.plot = (function () {
  const { element, svg, tick, ticks, announce } = rsmkit.format;
  const NEAR = 12;  // pixels
  const LETTER = 6.3;  // pixels of one letter of the axes
  const SHAPES = { circle: [24, () => 1], square: [4, () => 1.25, Math.PI / 4], diamond: [4, () => 1.3],
    triangle: [3, () => 1.4, -Math.PI / 2], star: [10, (i) => (i % 2 ? 0.75 : 1.8), -Math.PI / 2] };

  // Draws into a host of `width` pixels. What is shown: { height, label, x, y, y2, marks, legend, scale, pick, brush }.
  //   axes: { title, low, high, isLog, names } (names: texts at 0, 1, 2 ... in place of numbers)
  //   marks: { kind: "dots", x, y, colour | colours, size, shape, opacity | opacities, texts, name, shades, isHollow, onY2 } (shades: colours of the legend)
  //          { kind: "line", x, y, colour, width, dash, isStepped, name, onY2 }
  //          { kind: "bars", lengths, colours, texts }, one at each of the names of y
  //          { kind: "rule", x | y, colour, dash, text, isAtStart } (isAtStart: the text at the left end)
  //   scale: { title, low, high, colour(share) } beside the plot; legend: true names the marks that have a name
  //   pick(mark, i): a dot or bar was clicked, or Enter pressed on it; brush(found): dots in a box that was drawn, as [mark, i]
  // Returns { toX, toY, box }: places in pixels, for what is to be drawn on top.
  function draw(host, width, shown) {
    const hadFocus = host.contains(document.activeElement);
    const axes = { x: spanned(shown, "x"), y: spanned(shown, "y"), y2: shown.y2 && spanned(shown, "y2") };
    const frame = framed(axes, width, shown);
    const toX = placing(axes.x, frame.left, frame.right), toY = placing(axes.y, frame.bottom, frame.top);
    const toY2 = axes.y2 && placing(axes.y2, frame.bottom, frame.top);
    const box = svg("svg", { class: "plot", width, height: shown.height, tabindex: "0", role: "img", "aria-label": shown.label });
    const found = [];  // [x, y, mark, i] of everything that has words
    const marks = svg("g", { "clip-path": null });
    for (const mark of shown.marks) marks.append(...kinds[mark.kind](mark, toX, mark.onY2 ? toY2 : toY, frame, found));
    box.append(...grid(axes, toX, toY, toY2, frame, width, shown), marks);
    if (shown.scale) box.append(...scaleParts(shown.scale, frame, width));
    const hint = element("div", { class: "hint", hidden: true });
    const key = shown.legend ? legend(shown.marks) : null;
    host.replaceChildren(...[key, box, hint].filter(Boolean));
    listen(host, box, hint, found, shown, frame);
    if (hadFocus) box.focus({ preventScroll: true });
    return { toX, toY, box };
  }

  // An axis with its ends: those given, or those of the data with a margin.
  function spanned(shown, which) {
    const axis = shown[which] ?? {};
    if (axis.names) return { ...axis, low: -0.6, high: axis.names.length - 0.4 };
    const values = [];
    for (const mark of shown.marks) {
      if (which !== "x" && (which === "y2") !== Boolean(mark.onY2)) continue;
      if (mark.kind === "bars") { if (which === "x") values.push(0, ...mark.lengths); continue; }
      const own = mark[which === "y2" ? "y" : which];
      if (own !== undefined) values.push(...(Array.isArray(own) ? own : [own]));
    }
    const finite = values.filter((v) => v !== null && Number.isFinite(v) && (!axis.isLog || v > 0));
    let [low, high] = finite.length ? [finite.reduce((a, b) => Math.min(a, b)), finite.reduce((a, b) => Math.max(a, b))] : [0, 1];
    if (axis.isLog) {
      if (low === high) [low, high] = [low / 2, high * 2];
      const margin = (high / low) ** 0.05;
      return { ...axis, low: axis.low ?? low / margin, high: axis.high ?? high * margin };
    }
    if (low === high) [low, high] = [low - (Math.abs(low) || 1) / 10, high + (Math.abs(high) || 1) / 10];
    const margin = 0.05 * (high - low);
    return { ...axis, low: axis.low ?? low - margin, high: axis.high ?? high + margin };
  }

  const marksOf = (axis, count) => {
    if (axis.names) return axis.names.map((name, i) => [i, name]);
    if (!axis.isLog) return ticks(axis.low, axis.high, count).map((v) => [v, tick(v)]);
    const powers = ticks(Math.log10(axis.low), Math.log10(axis.high), count).map((p) => 10 ** p);
    return powers.map((v) => [v, tick(Number(v.toPrecision(2)))]);
  };

  // About how many numbers stand along an upright axis.
  const upwards = (top, bottom) => Math.max(2, (bottom - top) / 46);

  // Room for the texts of the axes.
  function framed(axes, width, shown) {
    const longest = (axis, count) => Math.max(...marksOf(axis, count).map(([, text]) => text.length), 1) * LETTER;
    const top = 8, bottom = shown.height - (axes.x.title ? 40 : 24), count = upwards(top, bottom);
    const left = Math.min(0.45 * width, longest(axes.y, count) + 10 + (axes.y.title ? 18 : 0));
    const right = axes.y2 ? longest(axes.y2, count) + 28 : shown.scale ? 74 : 12;
    return { left, right: Math.max(left + 20, width - right), top, bottom };
  }

  function placing(axis, from, to) {
    const [low, high] = axis.isLog ? [Math.log10(axis.low), Math.log10(axis.high)] : [axis.low, axis.high];
    return (v) => from + (to - from) * ((axis.isLog ? Math.log10(v) : v) - low) / (high - low);
  }

  function grid(axes, toX, toY, toY2, frame, width, shown) {
    const { left, right, top, bottom } = frame;
    const across = marksOf(axes.x, Math.max(2, Math.min(7, (right - left) / 70))), up = marksOf(axes.y, upwards(top, bottom));
    const room = Math.floor((left - 10) / LETTER + 1e-6);
    const text = (x, y, words, anchor, name = null, turn = null) => svg("text", { x, y, "text-anchor": anchor, class: name, transform: turn }, words);
    const middle = (top + bottom) / 2;
    const lines = [...across.map(([v]) => `M${toX(v).toFixed(1)} ${top}V${bottom}`),
      ...(axes.y.names ? [] : up.map(([v]) => `M${left} ${toY(v).toFixed(1)}H${right}`))];
    const parts = [svg("path", { class: "grid", d: lines.join("") }),
      ...across.map(([v, words]) => text(toX(v), bottom + 15, words, "middle")),
      ...up.map(([v, words]) => text(left - 6, toY(v) + 4, cut(words, room), "end"))];
    if (axes.x.title) parts.push(text((left + right) / 2, shown.height - 6, cut(axes.x.title, (right - left) / LETTER), "middle", "axis-name"));
    if (axes.y.title) parts.push(text(12, middle, cut(axes.y.title, (bottom - top) / LETTER), "middle", "axis-name", `rotate(-90 12 ${middle})`));
    if (toY2) {
      parts.push(...marksOf(axes.y2, upwards(top, bottom)).map(([v, words]) => text(right + 6, toY2(v) + 4, words, "start")));
      parts.push(text(width - 8, middle, axes.y2.title ?? "", "middle", "axis-name", `rotate(90 ${width - 8} ${middle})`));
    }
    return parts;
  }

  const cut = (text, length) => (text.length > length ? `${text.slice(0, Math.max(1, Math.floor(length) - 1))}…` : text);

  const isKnown = (v) => v !== null && v !== undefined && Number.isFinite(v);

  const kinds = {
    dots: (mark, toX, toY, frame, found) => {
      const size = mark.size ?? 4;
      const groups = new Map();  // dots that look alike are one path
      mark.x.forEach((x, i) => {
        if (!isKnown(x) || !isKnown(mark.y[i])) return;
        const at = [toX(x), toY(mark.y[i])];
        if (mark.texts) found.push([...at, mark, i]);
        const look = JSON.stringify([mark.colours?.[i] ?? mark.colour, mark.opacities?.[i] ?? mark.opacity ?? 0.8]);
        groups.set(look, (groups.get(look) ?? "") + outline(mark.shape ?? "circle", ...at, size));
      });
      return [...groups].map(([look, d]) => {
        const [colour, opacity] = JSON.parse(look);
        return svg("path", { d, opacity, ...(mark.isHollow ? { fill: "none", stroke: colour, "stroke-width": 1.6 }
          : { fill: colour, stroke: mark.edge ?? "none", "stroke-width": mark.edge ? 1 : null }) });
      });
    },
    line: (mark, toX, toY) => {
      let d = "", pen = "M", last = null;
      mark.x.forEach((x, i) => {
        if (!isKnown(x) || !isKnown(mark.y[i])) { pen = "M"; return; }
        const [px, py] = [toX(x).toFixed(1), toY(mark.y[i]).toFixed(1)];
        d += mark.isStepped && pen === "L" ? `L${px} ${last}L${px} ${py}` : `${pen}${px} ${py}`;
        [pen, last] = ["L", py];
      });
      return [svg("path", { d, fill: "none", stroke: mark.colour, "stroke-width": mark.width ?? 1.8, "stroke-dasharray": mark.dash })];
    },
    bars: (mark, toX, toY, frame, found) => mark.lengths.flatMap((v, i) => {
      if (!isKnown(v)) return [];
      const [from, to] = [toX(0), toX(v)].sort((a, b) => a - b);
      const high = Math.min(20, 0.72 * Math.abs(toY(1) - toY(0)));
      if (mark.texts) found.push([toX(v), toY(i), mark, i]);
      return [svg("rect", { x: from.toFixed(1), y: (toY(i) - high / 2).toFixed(1), width: Math.max(1, to - from).toFixed(1), height: high.toFixed(1),
        fill: mark.colours?.[i] ?? mark.colour })];
    }),
    rule: (mark, toX, toY, { left, right, top, bottom }) => {
      const isUpright = mark.x !== undefined;
      const place = isUpright ? toX(mark.x) : toY(mark.y);
      const d = isUpright ? `M${place} ${top}V${bottom}` : `M${left} ${place}H${right}`;
      return [svg("path", { d, fill: "none", stroke: mark.colour, "stroke-width": 1.2, "stroke-dasharray": mark.dash ?? "4 3" }),
        ...(mark.text ? [svg("text", isUpright ? upright(place, mark.text, right, top) : mark.isAtStart ? { x: left + 4, y: place - 4 } : { x: right - 4, y: place - 4, "text-anchor": "end" }, mark.text)] : [])];
    },
  };

  // Beside an upright rule, on the side where there is room.
  const upright = (place, text, right, top) => (place + 4 + LETTER * text.length < right ? { x: place + 4, y: top + 11 }
    : { x: place - 4, y: top + 11, "text-anchor": "end" });

  function outline(shape, x, y, size) {
    if (shape === "cross") return `M${x - size} ${y - size}L${x + size} ${y + size}M${x - size} ${y + size}L${x + size} ${y - size}`;
    if (shape === "circle") return `M${(x - size).toFixed(1)} ${y.toFixed(1)}a${size} ${size} 0 1 0 ${2 * size} 0a${size} ${size} 0 1 0 ${-2 * size} 0Z`;
    const [count, reach, turn = 0] = SHAPES[shape];
    const corners = Array.from({ length: count }, (_, i) => {
      const angle = turn + 2 * Math.PI * i / count;
      return `${(x + size * reach(i) * Math.cos(angle)).toFixed(1)} ${(y + size * reach(i) * Math.sin(angle)).toFixed(1)}`;
    });
    return `M${corners.join("L")}Z`;
  }

  function scaleParts({ title, low, high, colour }, { top, bottom, right }, width) {
    const steps = 24, step = (bottom - top) / steps;
    const middle = (top + bottom) / 2;
    return [
      ...Array.from({ length: steps }, (_, i) => svg("rect", { x: right + 10, y: bottom - (i + 1) * step, width: 9, height: step + 0.5, fill: colour((i + 0.5) / steps) })),
      svg("text", { x: right + 22, y: top + 9 }, tick(high)), svg("text", { x: right + 22, y: bottom }, tick(low)),
      svg("text", { x: width - 8, y: middle, "text-anchor": "middle", class: "axis-name", transform: `rotate(90 ${width - 8} ${middle})` }, title),
    ];
  }

  function legend(marks) {
    return element("p", { class: "legend" }, ...marks.filter((mark) => mark.name).map((mark) => {
      const { colour = mark.colours?.[0], shape = "circle", edge, isHollow, dash } = mark;
      const look = mark.kind === "line" ? svg("path", { d: "M0 6H18", stroke: colour, "stroke-width": 2, "stroke-dasharray": dash })
        : mark.shades ? svg("g", {}, ...mark.shades.map((fill, i) => svg("path", { d: outline(shape, 5 + 4 * i, 6, 4), fill })))
        : svg("path", { d: outline(shape, 9, 6, shape === "star" ? 4.5 : 4), fill: isHollow ? "none" : colour, stroke: isHollow ? colour : edge ?? "none", "stroke-width": isHollow ? 1.6 : 1 });
      return element("span", { class: "key shown" }, svg("svg", { width: 18, height: 12, "aria-hidden": "true" }, look), mark.name);
    }));
  }

  // Words for the pointer and the keyboard, clicks, and boxes drawn around dots.
  function listen(host, box, hint, found, { pick, brush, label }, frame) {
    let chosen = -1, from = null, area = null;
    const at = (event) => {
      const place = box.getBoundingClientRect();
      return [event.clientX - place.left, event.clientY - place.top];
    };
    const nearest = ([x, y]) => {
      let best = -1, least = NEAR ** 2;
      found.forEach(([px, py], k) => {
        const square = (px - x) ** 2 + (py - y) ** 2;
        if (square <= least) [best, least] = [k, square];
      });
      return best;
    };
    const tell = (k) => {
      hint.hidden = k < 0;
      if (k < 0) return;
      const [x, y, mark, i] = found[k];
      hint.textContent = mark.texts[i];
      const before = box.offsetTop;
      hint.style.left = `${Math.min(Math.max(0, box.clientWidth - hint.offsetWidth), x + 10)}px`;
      hint.style.top = `${Math.max(0, before + y - hint.offsetHeight - 8)}px`;
    };
    box.addEventListener("pointermove", (event) => {
      if (!from) { tell(nearest(at(event))); return; }
      const to = at(event);
      area.setAttribute("x", Math.min(from[0], to[0]));
      area.setAttribute("y", Math.min(from[1], to[1]));
      area.setAttribute("width", Math.abs(to[0] - from[0]));
      area.setAttribute("height", Math.abs(to[1] - from[1]));
    });
    box.addEventListener("pointerleave", () => { if (!from) tell(-1); });
    box.addEventListener("pointerdown", (event) => {
      if (!brush || event.pointerType === "touch") return;
      from = at(event);
      box.setPointerCapture(event.pointerId);
      area = svg("rect", { class: "brush" });
      box.append(area);
    });
    box.addEventListener("pointerup", (event) => {
      const to = at(event), start = from;
      from = null;
      area?.remove();
      if (start && Math.hypot(to[0] - start[0], to[1] - start[1]) > 6) {
        const inside = ([x, y]) => x >= Math.min(start[0], to[0]) && x <= Math.max(start[0], to[0]) &&
          y >= Math.min(start[1], to[1]) && y <= Math.max(start[1], to[1]);
        brush(found.filter(inside).map(([, , mark, i]) => [mark, i]));
        return;
      }
      const k = nearest(to);
      if (k >= 0 && pick) pick(found[k][2], found[k][3]);
    });
    box.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
      if (event.key === "Escape") { chosen = -1; tell(-1); return; }
      if (event.key === "Enter" && chosen >= 0 && pick) { pick(found[chosen][2], found[chosen][3]); return; }
      if (!step || !found.length) return;
      chosen = chosen < 0 && step < 0 ? found.length - 1 : (chosen + step + found.length) % found.length;
      tell(chosen);
      announce(`${label}: ${hint.textContent}`);
      event.preventDefault();
    });
    box.addEventListener("blur", () => tell(-1));
  }

  return { draw, cut };
})();
