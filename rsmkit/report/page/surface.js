// The surface of one quantity over two factors, in perspective: grey where constraints forbid, with the current design.
"use strict";

rsmkit.surface = (function () {
  const { tick, ticks } = rsmkit.format;
  const RISE = 0.62;  // of the box over its base, a square of side 1
  const VEIL = 0.62, GREY = [143, 145, 150];
  const view = { turn: -0.6, tilt: 0.5 };
  let canvas;

  function open(host, keys) {
    const redraw = () => rsmkit.charts.update(new Set(["turned"]));
    canvas = rsmkit.turntable("solid", "Surface of the chosen quantity", view, redraw);
    host.append(canvas);
    rsmkit.charts.add(host, { paint, keys: [...keys, "turned"] });
  }

  // Turns places of the box [0, 1] x [0, 1] x [0, 1] into pixels; the third number grows towards the reader.
  function projection(width, height) {
    const size = 0.54 * Math.min(width - 90, 1.2 * height);  // with room for the numbers beside it
    const [cosTurn, sinTurn, cosTilt, sinTilt] = [Math.cos(view.turn), Math.sin(view.turn), Math.cos(view.tilt), Math.sin(view.tilt)];
    return (x, y, z) => {
      const [a, b, c] = [x - 0.5, y - 0.5, RISE * (z - 0.5)];
      const [across, depth] = [a * cosTurn - b * sinTurn, a * sinTurn + b * cosTurn];
      const near = 1 / (1 + 0.22 * (depth * cosTilt - c * sinTilt));
      return [width / 2 + size * across * near, 0.47 * height - size * near * (c * cosTilt + depth * sinTilt), near];
    };
  }

  function paint(host, width) {
    const { data, state } = rsmkit;
    const height = Math.min(420, Math.round(0.74 * width));
    const pixels = Math.min(2, window.devicePixelRatio || 1);
    canvas.style.height = `${height}px`;
    [canvas.width, canvas.height] = [width * pixels, height * pixels];
    const pen = canvas.getContext("2d");
    pen.scale(pixels, pixels);
    const to = projection(width, height);
    const slice = rsmkit.slice.grid();
    const [fx, fy] = [data.factors[state.x], data.factors[state.y]];
    frame(pen, to, [width, height], slice, fx, fy);
    quads(pen, to, slice);
    const share = { x: (p) => (p[state.x] - fx.low) / (fx.high - fx.low), y: (p) => (p[state.y] - fy.low) / (fy.high - fy.low),
      z: (p) => (rsmkit.slice.chosen().value(p) - slice.low) / (slice.high - slice.low) };
    const place = (p, z) => to(share.x(p), share.y(p), z);
    for (const p of state.brush ? state.brush.points : []) dot(pen, place(p, share.z(p)), 2.5, "#ff9f1c");
    const here = place(state.point, share.z(state.point));
    stroke(pen, rsmkit.charts.colour("now"), [place(state.point, 0), here]);
    dot(pen, here, 6, rsmkit.charts.colour("now"));
  }

  // From the farthest quadrangle to the nearest, shaded by slope.
  function quads(pen, to, { z, rise, near, xs, across, low, high, fields }) {
    const last = z.length - 1;
    const share = (v) => (v - xs[0]) / (xs.at(-1) - xs[0]);
    const shares = across.map((row) => row.map(share));
    const corners = z.map((row, r) => row.map((v, c) => to(shares[r][c], r / last, (v - low) / (high - low))));
    const cut = rise ? cells(rise) : new Set();
    const greyed = (colour, light) => colour.map((v, i) => (1 - VEIL) * v + VEIL * GREY[i] * light);
    const isForbidden = (r, c) => rsmkit.limits.active().some((limit) => limit.sign * (fields.get(limit.subject.key)[r][c] - limit.limit) < 0);
    const found = [], veiled = new Map();  // the colour of each cell where it is forbidden
    for (let r = 0; r < last; r++) {
      for (let c = 0; c < last; c++) {
        const [p, q, s, t] = [corners[r][c], corners[r][c + 1], corners[r + 1][c + 1], corners[r + 1][c]];
        const values = [z[r][c], z[r][c + 1], z[r + 1][c + 1], z[r + 1][c]];
        if (!values.every(Number.isFinite) ) continue;
        const slope = ((values[1] - values[0] + values[2] - values[3]) * 0.35 + (values[3] - values[0] + values[2] - values[1]) * 0.2) *
          last / (high - low) / 2;
        const light = 0.86 + 0.14 * slope / Math.hypot(1, slope);
        const share = (values.reduce((sum, v) => sum + v, 0) / 4 - low) / (high - low);
        const colour = rsmkit.bands.colour(share).map((v) => v * light);
        veiled.set(r * last + c, rsmkit.bands.css(greyed(colour, light)));
        if (!cut.has(r * last + c)) { found.push({ depth: p[2] + s[2], colour: rsmkit.bands.css(colour), places: [p, q, s, t], isFilled: true }); continue; }
        const place = ([x, y], height) => to(between(shares, r, c, [x, y]), y / last, (height - low) / (high - low));
        for (const piece of cliff(near(r, c), [r, c], place)) {
          const steep = rsmkit.bands.colour((piece.height - low) / (high - low)).map((v) => v * light);
          found.push({ ...piece, colour: rsmkit.bands.css(isForbidden(r, c) ? greyed(steep, light) : steep), isFilled: true });
        }
      }
    }
    for (const piece of limitPieces(to, z, low, high, fields, shares, veiled, cut)) found.push(piece);
    found.sort((a, b) => a.depth - b.depth);
    for (const { colour, places, isFilled } of found) {
      pen.fillStyle = pen.strokeStyle = colour;
      pen.lineWidth = isFilled ? 0.6 : 2;
      pen.beginPath();
      places.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      if (isFilled) {
        pen.closePath();
        pen.fill();
      }
      pen.stroke();
    }
  }

  // The cells that a cliff runs through.
  function cells(rise) {
    const last = rise.length - 1, found = new Set();
    rsmkit.bands.walk(rise, Number.MIN_VALUE, (r, c, outline) => { if (outline) found.add(r * last + c); });
    return found;
  }

  // One cell with a cliff in small pieces: its foot, and above it what is more than nothing, down to the smooth line where that ends.
  function cliff({ z, rise }, [row, column], place) {
    const parts = rsmkit.cliffs.PARTS, found = [];
    const wide = ([x, y]) => [column + x / parts, row + y / parts];
    const push = (outline, heights, above) => {
      const places = outline.map((at, i) => place(wide(at), heights[i]));
      const ends = [outline[0], outline[Math.floor(outline.length / 2)]].map((at) => place(wide(at), 0)[2]);
      found.push({ places, depth: ends[0] + ends[1] + above, height: heights.reduce((sum, v) => sum + v, 0) / heights.length });
    };
    for (let r = 0; r < parts; r++) for (let c = 0; c < parts; c++) push([[c, r], [c + 1, r], [c + 1, r + 1], [c, r + 1]], [0, 0, 0, 0], 0);
    rsmkit.bands.walk(rise, Number.MIN_VALUE, (r, c, outline) => {
      const top = outline ?? [[c, r], [c + 1, r], [c + 1, r + 1], [c, r + 1]];
      push(top, top.map(([x, y]) => (Number.isInteger(x) && Number.isInteger(y) ? z[y][x] : 0)), 1e-7);
    });
    return found;
  }

  // A value on a grid, at a place within one of its cells.
  function between(nodes, r, c, [x, y]) {
    const [u, v] = [x - c, y - r];
    return (1 - v) * ((1 - u) * nodes[r][c] + u * nodes[r][c + 1]) + v * ((1 - u) * nodes[r + 1][c] + u * nodes[r + 1][c + 1]);
  }

  // On the surface: what limits forbid, veiled as on the map, and their lines in their colours. Just above the surface, so that they are
  // drawn after the piece of it that they lie on.
  function limitPieces(to, z, low, high, fields, shares, veiled, cut) {
    const last = z.length - 1;
    const found = [];
    for (const limit of rsmkit.limits.active()) {
      const grid = fields.get(limit.subject.key).map((row) => row.map((v) => -limit.sign * v));
      rsmkit.bands.walk(grid, -limit.sign * limit.limit + Number.MIN_VALUE, (r, c, outline, crossings) => {
        const place = (at) => to(between(shares, r, c, at), at[1] / last, (between(z, r, c, at) - low) / (high - low));
        const depth = place([c, r])[2] + place([c + 1, r + 1])[2];
        if (!Number.isFinite(depth) || cut.has(r * last + c)) return;  // no sheet over the foot of a cliff
        const whole = [[c, r], [c + 1, r], [c + 1, r + 1], [c, r + 1]];
        found.push({ depth: depth + 1e-6, colour: veiled.get(r * last + c), places: (outline ?? whole).map(place), isFilled: true });
        for (let k = 0; k + 1 < crossings.length; k += 2) {
          found.push({ depth: depth + 2e-6, colour: limit.colour, places: [place(crossings[k]), place(crossings[k + 1])], isFilled: false });
        }
      });
    }
    return found;
  }

  // The floor with its ticks on the two edges nearest to the reader, and the heights on the outermost corner.
  function frame(pen, to, [width, height], { low, high }, fx, fy) {
    const { colour } = rsmkit.charts;
    const sides = [[0, 0], [1, 0], [1, 1], [0, 1]];
    stroke(pen, colour("line"), [...sides, sides[0]].map(([x, y]) => to(x, y, 0)));
    pen.font = "11px system-ui, sans-serif";
    pen.fillStyle = colour("soft");
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const y = to(0.5, 0, 0)[2] > to(0.5, 1, 0)[2] ? 0 : 1;
    const x = to(0, 0.5, 0)[2] > to(1, 0.5, 0)[2] ? 0 : 1;
    const out = (v) => (v ? 1 : -1);
    const share = (f, v) => (v - f.low) / (f.high - f.low);
    for (const v of ticks(fx.low, fx.high, 4)) mark(pen, to, [share(fx, v), y, 0], [0, 0.07 * out(y), 0], tick(v), colour);
    for (const v of ticks(fy.low, fy.high, 4)) mark(pen, to, [x, share(fy, v), 0], [0.07 * out(x), 0, 0], tick(v), colour);
    const outer = sides.reduce((a, b) => (to(...a, 0)[0] < to(...b, 0)[0] ? a : b));
    stroke(pen, colour("line"), [to(...outer, 0), to(...outer, 1)]);
    for (const v of ticks(low, high, 4)) {
      const [px, py] = to(...outer, (v - low) / (high - low));
      pen.textAlign = "right";
      pen.fillText(tick(v), px - 8, py);
      stroke(pen, colour("line"), [[px - 5, py], [px, py]]);
    }
    pen.textAlign = "center";
    pen.fillStyle = colour("ink");
    pen.font = "600 11px system-ui, sans-serif";
    const named = (edge, [px, py], label) => {  // beyond the ticks, whichever way the edge runs on the screen
      const lines = width < 480 ? halves(short(label)) : [short(label)];
      const half = Math.max(...lines.map((line) => pen.measureText(line).width)) / 2;
      const aside = half * (px - edge[0]) / Math.hypot(px - edge[0], py - edge[1]);
      const x = Math.min(width - half - 2, Math.max(half + 2, px + aside));
      lines.forEach((line, i) => pen.fillText(line, x, Math.min(height - 8 - 13 * (lines.length - 1), py) + 13 * i));
    };
    named(to(0.5, y, 0), to(0.5, y + 0.17 * out(y), 0), fx.label);
    named(to(x, 0.5, 0), to(x + 0.17 * out(x), 0.5, 0), fy.label);
  }

  // A text in two lines, broken at the blank nearest to its middle.
  function halves(text) {
    const blanks = [...text].flatMap((letter, i) => (letter === " " ? [i] : []));
    if (!blanks.length) return [text];
    const at = blanks.reduce((a, b) => (Math.abs(b - text.length / 2) < Math.abs(a - text.length / 2) ? b : a));
    return [text.slice(0, at), text.slice(at + 1)];
  }

  const short = (text) => (text.length > 26 ? `${text.slice(0, 25)}…` : text);

  function mark(pen, to, at, away, text, colour) {
    const from = to(...at);
    const end = to(...at.map((v, i) => v + 0.35 * away[i]));
    stroke(pen, colour("line"), [from, end]);
    const [px, py] = to(...at.map((v, i) => v + away[i]));
    pen.fillText(text, px, py);
  }

  function stroke(pen, colour, places) {
    pen.strokeStyle = colour;
    pen.lineWidth = 1;
    pen.beginPath();
    places.forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.stroke();
  }

  function dot(pen, [x, y], size, colour) {
    pen.fillStyle = colour;
    pen.strokeStyle = "#fff";
    pen.lineWidth = 1;
    pen.beginPath();
    pen.arc(x, y, size, 0, 7);
    pen.fill();
    pen.stroke();
  }

  return { open };
})();
