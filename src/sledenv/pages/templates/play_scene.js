"use strict";
/* The picture of a descent and of its launch, which can be dragged in it; the film, which holds impacts. */
const HAND = "#a01e6e";
const POSES = 14; // of a strobe picture
const COLUMNS = ["t", "x", "y", "phi", "u", "v", "omega", "normal", "tangential", "feature", "slip", "spin"];
const rateOf = () => scene.W / 60; // [px] of the arrow for each m/s
let scene = null;
let shown = null; // what the worker has found, and what follows from it

/* Zones darker where there is more friction than around, as in figures. */
const bandsOf = (zones, around) =>
  zones.map(({ begin, end, friction }) => ({
    begin,
    end,
    colour: friction > around ? "#a9b3bd" : "#c8e7fc",
    words: `friction ${Number(friction.toPrecision(3))}`,
  }));

function frictionAt(place, { law, slope }) {
  const zone = slope.zones.find(({ begin, end }) => place >= begin && place < end);
  return zone ? zone.friction : law.friction;
}

/* Rows to draw: an impact without duration has the state before it and the state after. */
function drawable({ trajectory, rebounds, contacts }) {
  const touches = Array.from(trajectory.t, () => []); // contacts of each row, out of their table
  for (let k = 0; k < contacts.row.length; k++)
    touches[contacts.row[k]].push(Object.fromEntries(Object.keys(contacts).map((name) => [name, contacts[name][k]])));
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
  const rows = { touches: from.map((i, j) => (impacts[j] === null ? touches[i] : [])) };
  for (const name of COLUMNS) {
    const [column, ahead] = [trajectory[name], rebounds[`${name}_before`]];
    const unloaded = name === "normal" || name === "tangential" ? 0 : null;
    rows[name] = from.map((i, j) => (impacts[j] === null ? column[i] : (unloaded ?? ahead?.[impacts[j]] ?? column[i])));
  }
  return rows;
}

/* Contacts at a time, interpolated between two rows: touches_at in simulation/interpolation.py. */
function touchesAt(rows, t) {
  const i = before(rows.t, t);
  const [now, then] = [rows.touches[i], rows.touches[i + 1] ?? []];
  const share = (t - rows.t[i]) / (rows.t[i + 1] - rows.t[i]);
  const same =
    now.length === then.length &&
    now.every(({ part, ground }, k) => part === then[k].part && ground === then[k].ground);
  if (!(share > 0) || !same) return now;
  const mixed = (one, other) =>
    Object.entries(one).map(([name, value]) => [name, value + share * (other[name] - value)]);
  return now.map((one, k) => Object.fromEntries(mixed(one, then[k])));
}

/* Position in the film and time [s], linear in between: pace in plot/shapes.py. */
function filmOf({ rebounds, scene: { body } }, end) {
  const film = [0];
  const time = [0];
  const go = (until, least) => {
    const next = Math.max(Math.min(until, end), time.at(-1));
    film.push(film.at(-1) + Math.max(next - time.at(-1), least));
    time.push(next);
  };
  for (let i = 0; i < rebounds.t.length; i++) {
    go(rebounds.t_touchdown[i], 0);
    go(rebounds.t[i], D.hold * clamp(rebounds.normal_impulse[i] / (D.hard * body.mass), 0, 1));
  }
  go(end, 0);
  return { film, time };
}

const partOf = (code) => E.bodies[shown.input.body].parts[code - 1];

/* What a rebound does at a time, null in flight; of one without duration its impulse. */
function pushAt(t) {
  const { rebounds, rows, scene: given } = shown;
  const i = rebounds.t.findIndex((end, k) => t >= rebounds.t_touchdown[k] && t <= end);
  if (i < 0) return null;
  const [begin, end, part] = [rebounds.t_touchdown[i], rebounds.t[i], rebounds.feature[i]];
  const struck = { x: rebounds.x_contact[i], y: 0, normal_x: 0, normal_y: 1, part };
  for (const name of ["normal", "tangential"]) struck[name] = rebounds[`${name}_impulse`][i];
  const touches = end > begin ? touchesAt(rows, t) : [struck];
  const loads = rows.normal.filter((_, k) => rows.t[k] >= begin && rows.t[k] <= end);
  const row = before(rows.t, t);
  return {
    i,
    row: end > begin && rows.feature[row] ? row : null,
    part: partOf((end > begin && rows.feature[row]) || part),
    parts: touches.map((one) => partOf(one.part)),
    touches: touches.map((one) => ({ ...one, friction: frictionAt(one.x, given) })),
    largest: end > begin ? bounds(loads)[1] : struck.normal,
  };
}

/* Some points of a path, enough to say where it goes. */
function pointsOf({ x, y }) {
  const step = Math.ceil(x.length / 2000);
  return [...x].map((one, i) => [one, y[i]]).filter((_, i) => i % step === 0 || i === x.length - 1);
}

/* The scale stays as it is while something is dragged, and the picture keeps its size. */
function fit() {
  const { rows, scene: given, input } = shown;
  const { size } = E.bodies[input.body];
  const length = given.slope.length < Infinity ? given.slope.length : null;
  const width = clamp($("controls").clientWidth, 260, 1160);
  const room = [0.5 * size, rows.y[0] + 1.2 * size];
  const height = Math.round(clamp(0.42 * width, 220, 400));
  scene = new Scene(
    { slope: { ...given.slope, length, line: groundLine() }, body: D.drawn[input.body], size },
    [...pointsOf(rows), ...ghostPoints(), room],
    width,
    [height, height],
  );
  $("scene").setAttribute("viewBox", `0 0 ${width} ${height}`);
  $("scene").innerHTML =
    `${scene.sky()}<g id="world"><g id="land"></g><g id="trace"></g>${ghostPath()}<g id="corners"></g><g id="live"></g></g>` +
    `<defs>${scene.sled({ x: 0, y: 0, phi: 0 }, 'id="pose"')}</defs>`;
}

/* Poses that are apart, of the body drawn once: quick enough to follow a hand. */
function strobe({ rows, input }) {
  const apart = 1.6 * E.bodies[input.body].size;
  const kept = [stateAt(rows, 0)];
  for (let k = 1; k <= POSES; k++) {
    const state = stateAt(rows, (rows.t.at(-1) * k) / POSES);
    if (kept.every(({ x, y }) => Math.hypot(x - state.x, y - state.y) > apart)) kept.push(state);
  }
  return kept
    .slice(1)
    .map((state) => `<use href="#pose" opacity="0.35" class="pose" transform="${scene.moved(state)}"/>`);
}

/* While something is dragged, the land stays as it is, and there are no poses: they take as long as all the rest. */
function drawPath() {
  const { rows, rebounds } = shown;
  if (!grabbed) drawLand();
  const touched = Array.from(rebounds.x_contact, (x) => scene.contact(x));
  $("trace").innerHTML = touched.join("") + (grabbed ? "" : strobe(shown).join("")) + scene.path(rows);
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
  const parts = [scene.body.outline, scene.body.pieces.at(-1).points].map((part) => scene.outline(part, { x, y, phi }));
  return (
    `<g id="ghost" fill="none" stroke="${recordedColour(i)}" stroke-width="1.8" stroke-dasharray="5 3">` +
    `${parts.map((points) => `<polygon points="${points}"/>`).join("")}</g>`
  );
}

const ring = () => Math.max(0.9 * scene.size, 40 / scene.scale); // [m] from the mass centre

/* What can be dragged: a ring above the body and the tip of its velocity. */
function handles({ x, y, phi, u, v }) {
  const centre = scene.pixel(x, y);
  const held = scene.pixel(x - ring() * Math.sin(phi), y + ring() * Math.cos(phi));
  const rate = rateOf() / scene.scale;
  const tip = scene.pixel(x + rate * u, y + rate * v);
  const circle = ([column, row], rest) => `<circle cx="${far(column)}" cy="${far(row)}" ${rest}/>`;
  const grip = (place, what) =>
    circle(place, `r="17" fill="transparent" stroke="none" data-grab="${what}" class="grip"`);
  return (
    `<g fill="${HAND}" stroke="${HAND}">` +
    `<polyline points="${centre.map(far)} ${held.map(far)}" stroke-dasharray="3 4"/>` +
    grip(tip, "velocity") +
    scene.arrow(centre, tip, 'pointer-events="none"') +
    grip(held, "orientation") +
    circle(held, 'r="6.5" fill="var(--sky)" stroke-width="2.5" pointer-events="none"') +
    "</g>"
  );
}

function drawMoment(t) {
  const state = stateAt(shown.rows, t);
  const push = pushAt(t);
  const { cone, force } = push ? scene.push(push) : { cone: "", force: "" };
  const sled = scene.sled(state, 'id="sled" data-grab="drop" class="grip"', push?.parts);
  $("live").innerHTML = cone + sled + ghostAt(t) + force + (t > 0 || D.recorded ? "" : handles(state));
  $("corners").style.display = t > 0 ? "none" : "";
  $("world").setAttribute("transform", scene.camera(state));
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
    if (Math.hypot(x - from[0], y - from[1]) * scene.scale > 3) pressed.vertex = null; // dragged, not pressed twice
    moveVertex(vertex, [corner[0] + x - from[0], corner[1] + y - from[1], corner[2]]);
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
