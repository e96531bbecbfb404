"use strict";
/* The picture of a descent and of its launch, which can be dragged in it; the film, which holds impacts. */
const HAND = "#a01e6e";
const KEPT = "#e08214";
const rateOf = () => scene.W / 60; // [px] of the arrow for each m/s
let scene = null;
let shown = null; // what the worker has found, and what follows from it

/* Colours and words of zones: bands in plot/grounds.py. */
const SNOW = [216, 221, 227];

function bandsOf(zones, around) {
  return zones.map(({ begin, end, friction }) => {
    const both = friction + around;
    const share = both > 0 ? (friction - around) / both : 0;
    const most = share > 0 ? [152, 162, 172] : [200, 231, 252];
    const parts = SNOW.map((part, i) => Math.round(part + Math.abs(share) * (most[i] - part)));
    const said = String(Number(friction.toPrecision(3)));
    return { begin, end, colour: `rgb(${parts})`, words: `friction ${said}`, brief: said };
  });
}

function frictionAt(place, { law, slope }) {
  const zone = slope.zones.find(({ begin, end }) => place >= begin && place < end);
  return zone ? zone.friction : law.friction;
}

/* Rows to draw: an impact without duration has the state before it and the state after. */
function drawable({ trajectory, rebounds, contacts }) {
  const names = ["t", "x", "y", "phi", "u", "v", "omega", "normal", "tangential", "rolling", "feature", "slip", "spin"];
  names.push(...D.flight_losses);
  const touches = touchesOf(contacts, trajectory.t.length);
  const [from, impacts] = [[], []]; // of each row: which of the trajectory it is of, and the rebound before which it is
  for (let i = 0, k = 0; i < trajectory.t.length; i++) {
    while (k < rebounds.t.length && (rebounds.duration[k] > 0 || rebounds.t[k] < trajectory.t[i])) k++;
    if (k < rebounds.t.length && rebounds.t[k] === trajectory.t[i]) {
      from.push(i);
      impacts.push(k++);
    }
    from.push(i);
    impacts.push(null);
  }
  const rows = {};
  for (const name of names) {
    const [column, ahead] = [trajectory[name], rebounds[`${name}_before`]];
    const unloaded = name === "normal" || name === "tangential" ? 0 : null;
    rows[name] = from.map((i, j) => (impacts[j] === null ? column[i] : (unloaded ?? ahead?.[impacts[j]] ?? column[i])));
  }
  rows.touches = from.map((i, j) => (impacts[j] === null ? touches[i] : []));
  return rows;
}

/* Contacts of each row, out of their table. */
function touchesOf(contacts, count) {
  const found = Array.from({ length: count }, () => []);
  const columns = Object.entries(contacts);
  contacts.row.forEach((row, k) => {
    const one = {};
    for (const [name, column] of columns) one[name] = column[k];
    found[row].push(one);
  });
  return found;
}

/* Contacts at a time, interpolated between two rows: touches_at in plot/shapes.py. */
function touchesAt(rows, t) {
  const i = before(rows.t, t);
  const j = Math.min(i + 1, rows.t.length - 1);
  const step = rows.t[j] - rows.t[i];
  const [now, then] = [rows.touches[i], rows.touches[j]];
  const same =
    now.length === then.length && now.every((one, k) => one.part === then[k].part && one.ground === then[k].ground);
  if (!(step > 0) || !same) return now;
  return now.map((one, k) => {
    const mixed = (name) => one[name] + ((t - rows.t[i]) / step) * (then[k][name] - one[name]);
    const numbers = ["x", "y", "normal_x", "normal_y", "normal", "tangential"].map((name) => [name, mixed(name)]);
    return { ...one, ...Object.fromEntries(numbers) };
  });
}

/* Position in the film and time [s], linear in between: pace in plot/shapes.py. */
function filmOf({ rebounds, scene: { body } }, end) {
  const film = [0];
  const time = [0];
  const go = (until, least) => {
    const next = Math.max(Math.min(until, end), time[time.length - 1]);
    film.push(film[film.length - 1] + Math.max(next - time[time.length - 1], least));
    time.push(next);
  };
  for (let i = 0; i < rebounds.t.length; i++) {
    go(rebounds.t_touchdown[i], 0);
    go(rebounds.t[i], D.hold * clamp(rebounds.normal_impulse[i] / (D.hard * body.mass), 0, 1));
  }
  go(end, 0);
  return { film, time };
}

/* What a contact does at a time, null in flight. */
function pushAt(t) {
  const { rebounds, rows, scene: given } = shown;
  const i = rebounds.t.findIndex((end, k) => t >= rebounds.t_touchdown[k] && t <= end);
  if (i < 0) return null;
  const partOf = (code) => E.bodies[shown.input.body].parts[code - 1];
  const part = partOf(rebounds.feature[i]);
  const found = (touches, rest) => ({
    i,
    part,
    parts: touches.map((one) => partOf(one.part)),
    touches: touches.map((one) => ({ ...one, friction: frictionAt(one.x, given) })),
    ...rest,
  });
  if (rebounds.duration[i] === 0) {
    const [tangential, normal, x] = ["tangential_impulse", "normal_impulse", "x_contact"].map(
      (name) => rebounds[name][i],
    );
    const one = { x, y: 0, normal_x: 0, normal_y: 1, normal, tangential, part: rebounds.feature[i], ground: 0 };
    return found([one], { largest: normal });
  }
  const row = before(rows.t, t);
  let largest = 0;
  const begin = before(rows.t, rebounds.t_touchdown[i]);
  for (let k = begin; k < rows.t.length && rows.t[k] <= rebounds.t[i]; k++) largest = Math.max(largest, rows.normal[k]);
  const touching = rows.feature[row] ? partOf(rows.feature[row]) : part;
  return found(touchesAt(rows, t), { row, part: touching, largest });
}

/* Some points of a path, enough to say where it goes: a function takes no more arguments than some ten thousand. */
function pointsOf({ x, y }) {
  const step = Math.ceil(x.length / 2000);
  return x.map((one, i) => [one, y[i]]).filter((_, i) => i % step === 0 || i === x.length - 1);
}

const extent = (values) => values.reduce(([low, high], one) => [Math.min(low, one), Math.max(high, one)], [0, 0]);

/* The scale stays as it is while something is dragged. */
function fit() {
  const { rows, scene: given, input } = shown;
  const { size } = E.bodies[input.body];
  const length = given.slope.length < Infinity ? given.slope.length : null;
  const slope = {
    ...given.slope,
    length,
    line: groundLine(),
    zones: bandsOf(given.slope.zones, given.law.friction),
  };
  const width = clamp($("controls").clientWidth, 260, 1160);
  const points = [...pointsOf(rows), ...(shown.kept ? pointsOf(shown.kept.rows) : []), ...ghostPoints()];
  const room = [0.5 * size, rows.y[0] + 1.2 * size];
  scene = new Scene(
    { slope, body: D.drawn[input.body], size },
    [...points, room],
    width,
    width < 450 ? [150, 300] : [230, 470],
  );
  $("scene").setAttribute("viewBox", `0 0 ${scene.W} ${scene.H.toFixed(0)}`);
  $("scene").innerHTML =
    `${scene.sky()}<g id="world"><g id="land"></g><g id="cloud"></g><g id="trace"></g>${ghostPath()}<g id="corners"></g><g id="live"></g></g>` +
    `<defs>${scene.sled(0, 0, 0, 'id="pose"')}</defs>`;
}

function strobe({ rows, input }) {
  const apart = 1.6 * E.bodies[input.body].size;
  const kept = [];
  const end = rows.t[rows.t.length - 1];
  for (let k = 1; k <= 14; k++) {
    const { x, y, phi } = stateAt(rows, (end * k) / 14);
    if ([[rows.x[0], rows.y[0]], ...kept].every((one) => Math.hypot(one[0] - x, one[1] - y) > apart))
      kept.push([x, y, phi]);
  }
  return kept;
}

/* The outline of the body, drawn once, at another place: quick enough to follow a hand. */
function poseAt([x, y, phi]) {
  return `<use href="#pose" opacity="0.35" class="pose" transform="${scene.moved({ x, y, phi })}"/>`;
}

/* Points of a path that are apart on the screen. */
function visible({ x, y }) {
  const apart = 1 / scene.scale;
  const kept = [];
  let last = [Infinity, Infinity];
  for (let i = 0; i < x.length; i++)
    if (i === x.length - 1 || Math.abs(x[i] - last[0]) + Math.abs(y[i] - last[1]) > apart)
      kept.push((last = [x[i], y[i]]));
  return kept;
}

/* While something is dragged, the land stays as it is, and there are no poses: they take as long as all the rest. */
function drawPath() {
  const { rows, rebounds } = shown;
  if (!grabbed) drawLand();
  $("trace").innerHTML =
    [...rebounds.t].map((_, i) => scene.contact(contactPaths(i))).join("") +
    (grabbed ? "" : strobe(shown).map(poseAt).join("")) +
    (shown.kept ? scene.path(visible(shown.kept.rows), KEPT) : "") +
    scene.path(visible(rows));
}

/* Where a rebound touched, from touchdown to separation; in pieces where another contact went on alone: contact_paths in
   plot/shapes.py. */
function contactPaths(i) {
  const { rows, rebounds } = shown;
  const [begin, end] = [rebounds.t_touchdown[i], rebounds.t[i]];
  const paths = [];
  let last = null;
  for (let k = before(rows.t, begin - 1e-9); k < rows.t.length && rows.t[k] <= end; k++) {
    if (rows.t[k] < begin - 1e-9 || !rows.touches[k].length) continue;
    const { x, y } = rows.touches[k][0];
    const jumped = last && rows.t[k] === last.t && Math.hypot(x - last.x, y - last.y) > 1e-9 * scene.size;
    if (!last || jumped) paths.push([]);
    paths[paths.length - 1].push([x, y]);
    last = { t: rows.t[k], x, y };
  }
  return paths.length ? paths : [[[rebounds.x_contact[i], 0]]];
}

/* A recorded motion: the outline of its last frame, and where its mass centre was in each. */
const recordedColour = (i) => (i < D.ghost.used ? "var(--green)" : "var(--line)");
const ghostPoints = () => (D.ghost ? D.ghost.poses.slice(0, D.ghost.used).map(([x, y]) => [x, y]) : []);

function ghostPath() {
  const dots = (D.ghost?.poses ?? []).map(([x, y], i) => {
    const [column, row] = scene.pixel(x, y);
    return `<circle cx="${far(column)}" cy="${far(row)}" r="1.5" fill="${recordedColour(i)}"/>`;
  });
  return `<g id="dots">${dots.join("")}</g>`;
}

function ghostAt(t) {
  if (!D.ghost) return "";
  const i = before(D.ghost.times, t + 1e-9);
  const [x, y, phi] = D.ghost.poses[i];
  const parts = [scene.body.outline, scene.body.heavy].map((part) => scene.outline(part, x, y, phi));
  return (
    `<g id="ghost" fill="none" stroke="${recordedColour(i)}" stroke-width="1.8" stroke-dasharray="5 3">` +
    `${parts.map((points) => `<polygon points="${points}"/>`).join("")}</g>`
  );
}

const ring = () => Math.max(0.9 * scene.size, 40 / scene.scale); // [m] from the mass centre

/* What can be dragged: a ring above the body and the tip of its velocity. */
function handles({ x, y, phi, u, v }) {
  const centre = scene.pixel(x, y);
  const [column, row] = scene.pixel(x - ring() * Math.sin(phi), y + ring() * Math.cos(phi));
  const rate = rateOf() / scene.scale;
  const tip = scene.pixel(x + rate * u, y + rate * v);
  const grip = (place, what, rest) =>
    `<circle cx="${far(place[0])}" cy="${far(place[1])}" r="17" fill="transparent" stroke="none" data-grab="${what}" class="grip"/>` +
    rest;
  return (
    `<g fill="${HAND}" stroke="${HAND}">` +
    `<line x1="${far(centre[0])}" y1="${far(centre[1])}" x2="${far(column)}" y2="${far(row)}" stroke-dasharray="3 4"/>` +
    grip(tip, "velocity", scene.arrow(centre, tip, 'pointer-events="none"')) +
    grip(
      [column, row],
      "orientation",
      `<circle cx="${far(column)}" cy="${far(row)}" r="6.5" fill="var(--sky)" stroke-width="2.5" pointer-events="none"/>`,
    ) +
    "</g>"
  );
}

/* The kept launch at the same time. */
function keptAt(t) {
  if (!shown.kept) return "";
  const { x, y, phi } = stateAt(shown.kept.rows, t);
  const points = scene.outline(scene.body.outline, x, y, phi);
  return `<polygon id="other" points="${points}" fill="${KEPT}" fill-opacity="0.45" stroke="${KEPT}" stroke-width="1.5"/>`;
}

function drawMoment(t) {
  const state = stateAt(shown.rows, t);
  const push = pushAt(t);
  const { cone, force } = push ? scene.push(push) : { cone: "", force: "" };
  const sled = scene.sled(state.x, state.y, state.phi, 'id="sled" data-grab="drop" class="grip"', push?.parts);
  const grips = t > 0 || D.recorded ? "" : handles(state);
  $("live").innerHTML = cone + keptAt(t) + sled + ghostAt(t) + force + grips;
  $("corners").style.display = t > 0 ? "none" : "";
  $("world").setAttribute("transform", scene.shift(state.x, state.y));
}

/* Dragging. */
let grabbed = null;
let dropped = false; // since something was pressed the last time

function placeOf(event, box) {
  const moved = /translate\((\S+) (\S+)\)/.exec($("world").getAttribute("transform") ?? "") ?? [0, 0, 0];
  const scaled = scene.W / box.width;
  return scene.place((event.clientX - box.left) * scaled - moved[1], (event.clientY - box.top) * scaled - moved[2]);
}

const rounded = (value, step) => Number((Math.round(value / step) * step).toPrecision(10));

function drag(event) {
  if (!grabbed) return;
  const [x, y] = placeOf(event, grabbed.box);
  const { launch, from, drop, what, vertex, corner } = grabbed;
  const set = (name, value, step) => {
    const { low, high } = PARAMETERS[name];
    chosen.changed[name] = clamp(rounded(value, step), low, high);
  };
  if (what === "drop") set("drop", drop + y - from[1], 0.001);
  else if (what === "orientation") set("orientation", (Math.atan2(launch.x - x, y - launch.y) * 180) / Math.PI, 0.1);
  else if (what === "vertex") {
    const moved = [rounded(corner[0] + x - from[0], 0.01), rounded(corner[1] + y - from[1], 0.005), corner[2]];
    setVertices(verticesOf().with(vertex, moved));
    drawLand();
  } else {
    set("speed", ((x - launch.x) * scene.scale) / rateOf(), 0.01);
    set("fall", ((launch.y - y) * scene.scale) / rateOf(), 0.01);
  }
  changed();
}

$("scene").addEventListener("pointerdown", (event) => {
  dropped = false;
  const what = event.target.closest("[data-grab]")?.dataset.grab;
  if (!what || what === "ground" || !canSet()) return;
  const vertex = Number(event.target.dataset.vertex);
  if (what === "vertex" && removeIfTwice(vertex, event.timeStamp)) return;
  $("scene").setPointerCapture(event.pointerId);
  const box = $("scene").getBoundingClientRect(); // asked again after each picture, it would be laid out twice
  const corner = verticesOf()[vertex];
  grabbed = { what, box, from: placeOf(event, box), drop: valueOf("drop"), launch: shown.launch, vertex, corner };
  event.preventDefault();
});
$("scene").addEventListener("pointermove", drag);
for (const name of ["pointerup", "pointercancel"])
  $("scene").addEventListener(name, () => {
    if (!grabbed) return;
    grabbed = null;
    dropped = true;
    fillPanel();
    fit();
    draw();
  });
