// A canvas of a class `name` whose picture is turned by dragging or with the arrow keys.
"use strict";

rsmkit.turntable = function (name, label, view, draw) {
  const canvas = rsmkit.format.element("canvas", { class: `turntable ${name}`, tabindex: "0", role: "img",
    "aria-label": `${label}; drag or use the arrow keys to turn it` });

  function turn(sideways, up) {
    view.turn += sideways;
    view.tilt = Math.min(1.5, Math.max(-1.5, view.tilt + up));
    draw();
  }

  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (canvas.hasPointerCapture(event.pointerId)) turn(event.movementX / 120, event.movementY / 120);
  });
  canvas.addEventListener("keydown", (event) => {
    const moves = { ArrowLeft: [-0.12, 0], ArrowRight: [0.12, 0], ArrowUp: [0, -0.12], ArrowDown: [0, 0.12] };
    if (!moves[event.key]) return;
    turn(...moves[event.key]);
    event.preventDefault();
  });
  return canvas;
};
