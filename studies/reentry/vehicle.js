// The re-entry vehicle in three dimensions: spherical nose, first cone, cylinder, flare. In a replay it is seen from
// the side at its real attitude, the arrows are the oncoming air, and the colour is the heat flux: the flight's
// stagnation value, spread over the surface with the squared cosine of the local incidence (a picture on a
// square-root colour scale, not the simulator's element-by-element flux).
"use strict";

const AROUND = 48;  // panels around the axis
const PER_PART = 12;  // points along each part of the outline
const LIGHT = normalized([0.35, 0.75, 0.55]);

// Meridian from the nose tip to the rim of the base: [[x aft of the tip, radius], ...] in metres.
function outline(factors, settings, pointsPerPart = PER_PART) {
  const { theta_c1_deg, theta_c2_deg, nose_radius_m: nose } = factors;
  const { length_1_m = 1.6, length_2_m = 0.4, length_3_m = 0.7, length_1_datum = "tangent_point" } = settings;
  const first = radians(theta_c1_deg);
  const points = [];
  for (let i = 0; i < pointsPerPart; i++) {
    const slope = Math.PI / 2 + (first - Math.PI / 2) * i / (pointsPerPart - 1);
    points.push([nose * (1 - Math.sin(slope)), i === 0 ? 0 : nose * Math.cos(slope)]);
  }
  const cone = length_1_m - (length_1_datum === "nose_tip" ? points.at(-1)[0] : 0);
  for (const [length, angle] of [[cone, first], [length_2_m, 0], [length_3_m, radians(theta_c2_deg)]]) {
    const [x, r] = points.at(-1);
    for (let i = 1; i < pointsPerPart; i++) {
      const step = length * i / (pointsPerPart - 1);
      points.push([x + step, r + step * Math.tan(angle)]);
    }
  }
  return points;
}

function draw(canvas, factors, frame) {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  [canvas.width, canvas.height] = [width * ratio, height * ratio];
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  context.clearRect(0, 0, width, height);
  const meridian = outline(factors, frame.settings);
  const [length, base] = meridian.at(-1);
  const camera = cameraOf(frame, width, height, length);
  const flow = frame.row ? [Math.cos(pathAngle(frame)), Math.sin(pathAngle(frame)), 0] : null;
  if (flow) drawFlow(context, camera, flow, length, frame.soft);
  const heat = frame.row ? heatShare(frame) : null;
  for (const face of faces(meridian, length, camera)) {
    context.beginPath();
    face.corners.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.closePath();
    context.fillStyle = context.strokeStyle = colourOf(face, flow, heat, frame.dark);
    context.fill();
    context.stroke();
  }
  caption(context, frame, length, base, height);
}

// Where the eye is: the body is pitched (flight path plus angle of attack in a replay), then turned by the reader.
function cameraOf(frame, width, height, length) {
  const pitch = frame.row ? pathAngle(frame) + radians(frame.row.alpha_deg ?? 0) : 0;
  const scale = Math.min(width / (1.35 * length), height / (frame.row ? 0.98 * length : 0.75 * length));
  const turn = frame.row ? frame.turn - 0.6 : frame.turn;  // a replay starts from the side
  const tilt = frame.row ? frame.tilt - 0.35 : frame.tilt;
  const attitude = ([x, y, z]) => [x * Math.cos(pitch) - y * Math.sin(pitch), x * Math.sin(pitch) + y * Math.cos(pitch), z];
  const look = ([x, y, z]) => {
    const [across, away] = [x * Math.cos(turn) + z * Math.sin(turn), -x * Math.sin(turn) + z * Math.cos(turn)];
    return [across, y * Math.cos(tilt) - away * Math.sin(tilt), y * Math.sin(tilt) + away * Math.cos(tilt)];
  };
  const place = ([x, y]) => [width / 2 + scale * x, height / 2 - scale * y];
  return { attitude, look, place };
}

// Visible panels, the farthest first.
function faces(meridian, length, { attitude, look, place }) {
  const made = [];
  const world = (x, r, phi) => attitude([length / 2 - x, r * Math.cos(phi), r * Math.sin(phi)]);
  const add = (corners, normal) => {
    const seen = corners.map(look);
    if (look(normal)[2] <= 0) return;
    made.push({ corners: seen.map(place), normal, depth: seen.reduce((sum, p) => sum + p[2], 0) / seen.length });
  };
  for (let i = 1; i < meridian.length; i++) {
    const [[x0, r0], [x1, r1]] = [meridian[i - 1], meridian[i]];
    for (let k = 0; k < AROUND; k++) {
      const [from, to] = [2 * Math.PI * k / AROUND, 2 * Math.PI * (k + 1) / AROUND];
      const middle = (from + to) / 2;
      const normal = normalized(attitude([r1 - r0, (x1 - x0) * Math.cos(middle), (x1 - x0) * Math.sin(middle)]));
      add([world(x0, r0, from), world(x1, r1, from), world(x1, r1, to), world(x0, r0, to)], normal);
    }
  }
  const [x, r] = meridian.at(-1);
  const rim = Array.from({ length: AROUND }, (_, k) => world(x, r, 2 * Math.PI * k / AROUND));
  add(rim, attitude([-1, 0, 0]));
  return made.sort((a, b) => a.depth - b.depth);
}

function colourOf({ normal }, flow, heat, dark) {
  const shade = (dark ? 0.42 : 0.5) + 0.5 * Math.max(0, dot(normal, LIGHT));
  if (!flow) return rgb([150, 170, 196].map((c) => c * shade));
  const incidence = Math.max(0, dot(normal, flow));
  const local = heat * (0.08 + 0.92 * incidence * incidence);
  return rgb(glow(Math.sqrt(local)).map((c) => c * (shade + (1 - shade) * local)));
}

// Steel to red to yellow to white.
function glow(share) {
  const stops = [[0, [150, 170, 196]], [0.15, [150, 90, 110]], [0.4, [214, 60, 40]], [0.75, [255, 190, 60]], [1, [255, 250, 225]]];
  const above = Math.max(1, stops.findIndex(([at]) => at >= share));
  const [[a, low], [b, high]] = [stops[above - 1], stops[above]];
  const part = (share - a) / (b - a);
  return low.map((c, i) => c + part * (high[i] - c));
}

// Arrows of the oncoming air.
function drawFlow(context, { look, place }, flow, length, colour) {
  context.strokeStyle = colour;
  context.lineWidth = 1;
  for (const offset of [-0.3, -0.15, 0, 0.15, 0.3]) {
    const across = [-flow[1] * offset * length, flow[0] * offset * length, 0];
    const ends = [0.88, 0.66].map((t) => place(look(flow.map((f, i) => f * t * length + across[i]))));
    const [[x0, y0], [x1, y1]] = ends;
    const angle = Math.atan2(y1 - y0, x1 - x0);
    context.beginPath();
    context.moveTo(x0, y0);
    context.lineTo(x1, y1);
    for (const side of [2.6, -2.6]) {
      context.moveTo(x1, y1);
      context.lineTo(x1 + 7 * Math.cos(angle + side), y1 + 7 * Math.sin(angle + side));
    }
    context.stroke();
  }
}

function caption(context, frame, length, base, height) {
  context.fillStyle = frame.ink;
  context.font = "13px system-ui, sans-serif";
  const row = frame.row;
  const text = row
    ? `${(row.altitude_m / 1000).toFixed(1)} km   Mach ${row.mach.toFixed(1)}   α ${row.alpha_deg.toFixed(1)}°   ` +
      `heat flux ${(row.stagnation_heat_flux_W_m2 / 1e6).toFixed(2)} MW/m²`
    : `length ${length.toFixed(2)} m   base diameter ${(2 * base).toFixed(2)} m`;
  context.fillText(text, 14, height - 14);
}

// The stagnation heat flux over the largest of the flight.
function heatShare(frame) {
  const flux = frame.columns.stagnation_heat_flux_W_m2;
  return frame.row.stagnation_heat_flux_W_m2 / flux.reduce((a, b) => Math.max(a, b), 0);
}

const pathAngle = (frame) => radians(frame.row.path_angle_deg ?? 0);
function radians(degrees) { return degrees * Math.PI / 180; }
function dot(a, b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
function normalized(v) { const size = Math.hypot(...v); return v.map((c) => c / size); }
function rgb(channels) { return `rgb(${channels.map((c) => Math.round(Math.min(255, c))).join(",")})`; }
