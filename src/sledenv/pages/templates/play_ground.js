"use strict";
/* The ground: its vertices [x, y, radius] in m, heights over the plane of the slope and with which arcs they are rounded,
   which can be dragged, added and removed, or follow from the sliders of bumps; what is wrong with them. */
const BUMPS = ["bump_height", "bump_face", "bump_top", "bump_gap"];
const STRAIGHT = 1e-13; // sine of the turn of a vertex that is none, and what rounding adds: simulation/scene.py
const ROUNDED = 2 ** -50;
const MOST_LISTED = 40; // vertices in the panel
const GRIP = 12; // [px] around a vertex

for (const one of E.contexts) one.vertices = one.slope.profile.map(([x, y], k) => [x, y, one.slope.rounding[k] ?? 0]);

/* All vertices, those without a turn too: set by hand, of bumps, or as the page began. */
function verticesOf() {
  const allowed = BUMPS.every((name) => !problemOf(name, shownOf(name)));
  const found = chosen.profile ?? (BUMPS.some(isChanged) && allowed ? bumps() : here().vertices);
  return isChanged("rounding") ? found.map(([x, y]) => [x, y, radiusOfAll()]) : found;
}

const radiusOfAll = () => valueOf("rounding") || 0; // 0 where each has its own

/* What is simulated: as the page began, to the last bit, or without vertices that do not turn. */
function groundOf() {
  const vertices = verticesOf() === here().vertices ? here().vertices : turning(verticesOf());
  return { profile: vertices.map(([x, y]) => [x, y]), rounding: vertices.map(([, , radius]) => radius) };
}

/* Its line; where vertices are wrong, through those that there are. */
function groundLine() {
  const vertices = verticesOf();
  if (!problemOfVertices(vertices)) return lineOf(own.pieces(groundOf()), bodyOf().size);
  return { x: thereOf(vertices).map(([x]) => x), y: thereOf(vertices).map(([, y]) => y) };
}

const thereOf = (vertices) => vertices.filter(([x, y]) => Number.isFinite(x) && Number.isFinite(y));

/* Bumps of one shape, of numbers that are in their ranges, as many as there is room for before the finish. */
function bumps() {
  const [height, face, top, gap] = BUMPS.map(valueOf);
  const end = Math.min(valueOf("length"), 200);
  const wide = 2 * face + top;
  const found = [];
  if (height === 0) return found;
  for (let x = gap; x + wide <= end; x += wide + gap)
    found.push([x, 0], [x + face, height], ...(top > 0 ? [[x + face + top, height]] : []), [x + wide, 0]);
  return found.map((vertex) => [...vertex, radiusOfAll()]);
}

function setVertices(vertices) {
  chosen.profile = vertices;
  for (const name of BUMPS) delete chosen.changed[name];
}

/* The vertices at which the ground turns: checked_profile in simulation/scene.py, operation by operation. */
function turning(vertices) {
  let kept = vertices;
  for (;;) {
    const straight = kept.map((here, k) => isStraight(kept[k - 1], here, kept[k + 1]));
    if (!straight.includes(true)) return kept;
    const rest = [];
    kept.forEach((here, k) => {
      if (!straight[k] || !isStraight(rest[rest.length - 1], here, kept[k + 1])) rest.push(here);
    });
    if (rest.length < 2)
      return vertices[0][1] || vertices[vertices.length - 1][1] ? [vertices[0], vertices.at(-1)] : [];
    kept = rest;
  }
}

/* Whether the ground goes straight on at a vertex between two others, up to rounding; level where there is none. */
function isStraight(last, [x, y], next) {
  const parts = [last && [x - last[0], y - last[1]], next && [next[0] - x, next[1] - y]];
  const [left, right] = parts.map((part) => {
    const [along, up] = part ?? [1, 0];
    const length = Math.hypot(along, up);
    return { along: along / length, up: up / length, length: part ? length : Infinity, steep: Math.abs(up) / along };
  });
  const rounded = Math.abs(y) + Math.max(left.steep, right.steep) * Math.abs(x);
  const rounding = (ROUNDED * rounded) / Math.min(left.length, right.length);
  return Math.abs(left.along * right.up - left.up * right.along) < Math.max(STRAIGHT, rounding);
}

/* What is wrong with vertices, and what helps. */
function problemOfVertices(vertices) {
  const { most, steepest } = E.ground;
  const metres = (value) => `${brief(value)} m`;
  if (vertices.length === 1 || vertices.length > most)
    return `the ground has ${vertices.length} vertices: must have none, or 2 to ${most}; add or remove some`;
  for (let k = 0; k < vertices.length; k++) {
    const [x, y, radius] = vertices[k];
    const name = `vertex ${k + 1} of the ground`;
    if (!Number.isFinite(x) || !Number.isFinite(y)) return `${name}: must have a place and a height`;
    if (!(radius >= 0)) return `${name} has the radius ${radius} m: must be in [0, ∞) m`;
    if (k === 0) continue;
    const [before, height] = vertices[k - 1];
    if (x <= before)
      return `${name} is at ${metres(x)}: must lie behind the one before, at ${metres(before)}; move it on, or remove it`;
    if (Math.abs(y - height) > steepest * (x - before))
      return (
        `the ground before vertex ${k + 1} is ${Math.round((Math.atan2(Math.abs(y - height), x - before) * 180) / Math.PI)}° steep ` +
        "to the plane: must be at most 80°; move it on, or nearer to the height of the one before"
      );
  }
  return "";
}

/* What is wrong with the ground, and what helps. */
function problemOfGround() {
  const found = problemOfVertices(verticesOf());
  if (found) return found;
  const vertices = turning(verticesOf());
  if (!vertices.length) return "";
  if (chosen.solver === "rigid")
    return "surfaces are rigid: must be compliant over bumps; choose these, or flat ground";
  const sharp = vertices.some(
    (one, k) => one[2] === 0 && slopeOf(vertices[k - 1], one) > slopeOf(one, vertices[k + 1]),
  );
  if (bodyOf().sharp && sharp)
    return `${bodyOf().name} has sharp corners: must have round ones over sharp tops; round these, or choose another body`;
  return "";
}

const slopeOf = (from, to) => (from && to ? (to[1] - from[1]) / (to[0] - from[0]) : 0);

/* The address: x,y;x,y,radius. */
const vertexText = (vertices) =>
  vertices.map(([x, y, radius]) => [x, y, ...(radius ? [radius] : [])].join(",")).join(";");

const readVertices = (text) =>
  text
    .split(";")
    .filter((one) => one !== "")
    .map((one) => [NaN, NaN, 0].map((missing, i) => Number(one.split(",")[i]?.trim() || missing)));

/* The picture: the land, and what can be taken hold of in it before the film begins. */
function drawLand() {
  const { law, slope } = shown.scene;
  scene.slope.line = groundLine();
  scene.slope.zones = bandsOf(slope.zones, law.friction);
  $("land").innerHTML = scene.ground(...extent(shown.rows.x));
  $("land").classList.toggle("wrong", problemOfGround() !== "");
  $("corners").innerHTML = D.recorded ? "" : corners();
}

function corners() {
  const { first, last } = scene;
  const [middle] = scene.pixel(shown.launch.x, 0); // beyond a width of the picture from there nothing is seen of a long one
  const parts = [
    `<polyline data-grab="ground" points="${scene.surface(first, last).join(" ")}" fill="none" stroke="transparent" stroke-width="18"/>`,
  ];
  let seen = -Infinity;
  // Between vertices: it shows which of them a bend belongs to.
  const sharp = thereOf(verticesOf()).map(([x, y]) => scene.at(x, y));
  parts.push(`<polyline points="${sharp.join(" ")}" fill="none" stroke="var(--line)" stroke-dasharray="3 3"/>`);
  verticesOf().forEach(([x, y], k) => {
    const [column, row] = scene.pixel(x, y).map(far);
    if (!(x >= first && x <= last && Math.abs(column - middle) <= scene.W)) return;
    if (Math.abs(column - seen) < 5 && k !== grabbed?.vertex) return;
    seen = Number(column);
    parts.push(
      `<circle cx="${column}" cy="${row}" r="4.5" fill="var(--ground)" stroke="${HAND}" stroke-width="2"/>` +
        `<circle cx="${column}" cy="${row}" r="${GRIP}" fill="transparent" data-grab="vertex" data-vertex="${k}" class="grip"/>`,
    );
  });
  return parts.join("");
}

/* A vertex at a place: the ones before it come before it. On a plane it has two beside it, which hold the ground level. */
function added([x, y]) {
  const vertices = verticesOf();
  const place = rounded(x, 0.01);
  if (!vertices.length)
    return [
      [place - 2, 0, radiusOfAll()],
      [place, rounded(y, 0.005), radiusOfAll()],
      [place + 2, 0, radiusOfAll()],
    ];
  const k = vertices.findIndex(([there]) => there > place);
  return vertices.toSpliced(k < 0 ? vertices.length : k, 0, [place, rounded(y, 0.005), radiusOfAll()]);
}

/* In the middle of the longest piece before the finish, raised a little. */
function addVertex() {
  const length = Math.min(valueOf("length"), 200);
  const places = [0, ...verticesOf().map(([x]) => x), length]
    .filter((x) => x >= 0 && x <= length)
    .sort((a, b) => a - b);
  const [begin, end] = places
    .slice(1)
    .map((x, k) => [places[k], x])
    .reduce((one, other) => (other[1] - other[0] > one[1] - one[0] ? other : one));
  const x = 0.5 * (begin + end);
  setVertices(added([x, heightOn(groundLine(), x) + 0.2]));
}

/* Without a vertex; the last two are removed together. */
const removed = (k) => (verticesOf().length > 2 ? verticesOf().filter((_, i) => i !== k) : []);

const canSet = () => shown && position === 0 && !D.recorded;

/* A click adds a vertex, unless it is the end of a drag. */
$("scene").addEventListener("click", (event) => {
  if (!canSet() || dropped || !event.target.closest("[data-grab=ground]")) return;
  const [x] = placeOf(event, $("scene").getBoundingClientRect());
  setVertices(added([x, heightOn(groundLine(), x)]));
  changed();
});
/* A vertex that is pressed twice goes. There is no double click: each press draws the ground anew. */
let pressed = { vertex: null, at: -Infinity };

function removeIfTwice(vertex, at) {
  const twice = vertex === pressed.vertex && at - pressed.at < 400;
  pressed = { vertex: twice ? null : vertex, at };
  if (!twice) return false;
  setVertices(removed(vertex));
  changed();
  return true;
}

/* The panel. */
function vertexRow([x, y], k) {
  const field = (value, axis, label) =>
    `<label>${label}<input type="number" step="any" data-vertex="${k}" data-axis="${axis}" ` +
    `value="${Number.isNaN(value) ? "" : Number(value.toPrecision(7))}"></label>`;
  return (
    `<div class="zone vertex">${field(x, 0, "place [m]")}${field(y, 1, "height [m]")}` +
    `<button type="button" data-drop="${k}" aria-label="remove vertex ${k + 1}">×</button></div>`
  );
}

function fillVertices() {
  if ($("vertices").contains(document.activeElement)) return;
  const vertices = verticesOf();
  $("vertices").innerHTML =
    vertices.length > MOST_LISTED
      ? `<p class="hint">${vertices.length} vertices, which are not listed: move them in the picture.</p>`
      : vertices.map(vertexRow).join("");
  $("flat").disabled = !vertices.length;
}
