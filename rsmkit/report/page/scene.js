// The study's own picture of the designed object, and replays of verified runs. The study's script defines
// draw(canvas, factors, frame); see docs/explorer.md for what it receives.
"use strict";

rsmkit.stage = (function () {
  const { element, section, choice, number } = rsmkit.format;
  let data, state, canvas, player, slider, readout, playButton, columnPicker, cursor;
  const view = { turn: 0.6, tilt: 0.35 };
  const play = { replay: null, time: 0, running: false, last: 0 };

  function open() {
    ({ data, state } = rsmkit);
    if (!rsmkit.scene && !data.replays.length) return;
    canvas = rsmkit.turntable("stage", "The designed object", view, redraw);
    const parts = rsmkit.scene ? [element("div", {}, canvas)] : [];
    if (data.replays.length) parts.push(...replayControls());
    section("object", rsmkit.scene ? "The designed object" : "Replay", ...parts);
    if (rsmkit.scene) rsmkit.charts.add(canvas.parentNode, { paint: draw, keys: ["point", "scene"] });
  }

  const redraw = () => rsmkit.charts.update(new Set(["scene"]));

  function replayControls() {
    const names = data.replays.map((replay, i) => [String(i), replay.name]);
    const pick = choice("Replay", [["", "none: the current design"], ...names], "", (i) => start(i === "" ? null : data.replays[+i]));
    playButton = element("button", { type: "button", disabled: true, onclick: toggle }, "Play");
    slider = element("input", { type: "range", min: 0, max: 1, step: "any", value: 0, disabled: true, "aria-label": "Time of the replay",
      oninput: () => { play.time = +slider.value; pause(); show(); } });
    const columns = Object.keys(data.replays[0].columns).slice(1);
    play.column = columns[0];
    columnPicker = choice("Plot", columns.map((name) => [name, name]), play.column, (name) => {
      play.column = name;
      rsmkit.charts.update(new Set(["replay"]));
    });
    readout = element("p", { class: "fine", "aria-live": "off" });
    player = element("div", { hidden: true });
    rsmkit.charts.add(player, { paint: history, keys: ["replay"] });
    return [element("div", { class: "bar" }, pick, playButton, slider, columnPicker), readout, player];
  }

  const times = () => Object.values(play.replay.columns)[0];

  function start(replay) {
    play.replay = replay;
    pause();
    playButton.disabled = slider.disabled = !replay;
    player.hidden = !replay;
    if (replay) {
      [play.time, slider.min, slider.max] = [times()[0], times()[0], times().at(-1)];
      if (!matchMedia("(prefers-reduced-motion: reduce)").matches) toggle();
    }
    rsmkit.charts.update(new Set(["replay"]));
    show();
  }

  function toggle() {
    if (play.running) { pause(); return; }
    play.running = true;
    playButton.textContent = "Pause";
    if (play.time >= times().at(-1)) play.time = times()[0];
    play.last = performance.now();
    requestAnimationFrame(step);
  }

  function pause() {
    play.running = false;
    if (playButton) playButton.textContent = "Play";
  }

  // A replay takes about twelve seconds, whatever it replays.
  function step(moment) {
    if (!play.running) return;
    const duration = times().at(-1) - times()[0];
    play.time += duration * (moment - play.last) / 12000;
    play.last = moment;
    if (play.time >= times().at(-1)) { play.time = times().at(-1); pause(); }
    show();
    if (play.running) requestAnimationFrame(step);
  }

  // The replay's columns at one time, interpolated.
  function rowAt(time) {
    const t = times();
    let i = t.findIndex((v) => v > time) - 1;
    if (i < 0) i = time < t[0] ? 0 : t.length - 2;
    const share = Math.min(1, Math.max(0, (time - t[i]) / (t[i + 1] - t[i])));
    return Object.fromEntries(Object.entries(play.replay.columns)
      .map(([name, values]) => [name, values[i] + share * (values[i + 1] - values[i])]));
  }

  function show() {
    redraw();
    if (!play.replay) { readout.textContent = ""; return; }
    slider.value = play.time;
    const row = rowAt(play.time);
    const first = Object.keys(row)[0];
    readout.textContent = [first, play.column].map((name) => `${name} ${number(row[name])}`).join(" · ");
    moveCursor();
  }

  function draw() {
    const factors = play.replay ? play.replay.factors
      : Object.fromEntries(data.factors.map((f, j) => [f.name, rsmkit.format.exact(f, state.point[j])]));
    const { colour } = rsmkit.charts;
    rsmkit.scene.draw(canvas, factors, { settings: data.settings, row: play.replay ? rowAt(play.time) : null,
      columns: play.replay ? play.replay.columns : null, turn: view.turn, tilt: view.tilt,
      ink: colour("ink"), soft: colour("soft"), line: colour("line"), paper: colour("raised"), dark: rsmkit.theme.isDark() });
  }

  function history(host, width) {
    const { colour } = rsmkit.charts;
    const replay = play.replay ?? data.replays[0];
    const [name, moments] = Object.entries(replay.columns)[0];
    const { toX, box } = rsmkit.plot.draw(host, width, { label: "Time history of the replayed run", height: 220,
      x: { title: name }, y: { title: play.column },
      marks: [{ kind: "line", x: moments, y: replay.columns[play.column], colour: colour("accent"), width: 1.6 }] });
    cursor = { toX, line: rsmkit.format.svg("path", { fill: "none", stroke: colour("now"), "stroke-width": 1.5 }) };
    box.append(cursor.line);
    moveCursor();
  }

  function moveCursor() {
    cursor?.line.setAttribute("d", `M${cursor.toX(play.time)} 8V180`);
  }

  return { open };
})();
