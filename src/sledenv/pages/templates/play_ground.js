"use strict";
/* The ground: its vertices [x, y, radius] in m, heights over the plane of the slope and with which arcs they are rounded,
   which can be dragged, added and removed; what is wrong with them. */
const STRAIGHT = 1e-12; // turn of a vertex that is none
const GRIP = 12; // [px] around a vertex
const APART = 0.1; // [m] between two vertices at least, where one is dragged

for (const one of E.contexts) one.vertices = one.slope.profile.map(([x, y], k) => [x, y, one.slope.rounding[k] ?? 0]);

/* All vertices, those without a turn too: set by hand, or as the page began. */
function verticesOf() {
  const found = chosen.profile ?? here().vertices;
  return isChanged("rounding") ? found.map(([x, y]) => [x, y, radiusOfAll()]) : found;
}

const radiusOfAll = () => valueOf("rounding") || 0; // 0 where each has its own

/* What is simulated: as the page began, to the last bit, or without vertices that do not turn. */
function groundOf() {
  const vertices = verticesOf() === here().vertices ? here().vertices : turning(verticesOf());
  return { profile: vertices.map(([x, y]) => [x, y]), rounding: vertices.map(([, , radius]) => radius) };
}

/* Its line; where numbers are wrong, as the page began. */
const groundLine = () => lineOf(own.pieces(problemOfVertices(verticesOf()) ? here().slope : groundOf()), bodyOf().size);

/* Slope of the ground between two vertices, level where one is missing. */
const slopeOf = (from, to) => (from && to ? (to[1] - from[1]) / (to[0] - from[0]) : 0);

/* The vertices at which the ground turns: checked_profile in simulation/scene.py leaves out the same. */
function turning(vertices) {
  const kept = [];
  vertices.forEach((one, k) => {
    if (Math.abs(slopeOf(one, vertices[k + 1]) - slopeOf(kept.at(-1), one)) > STRAIGHT) kept.push(one);
  });
  return kept.length || !vertices.some(([, y]) => y) ? kept : [vertices[0], vertices.at(-1)];
}

/* What is wrong with vertices, and what helps. */
function problemOfVertices(vertices) {
  const { most, steepest } = E.ground;
  if (vertices.length === 1 || vertices.length > most)
    return `the ground has ${vertices.length} vertices: must have none, or 2 to ${most}; add or remove some`;
  for (const [k, [x, y, radius]] of vertices.entries()) {
    const name = `vertex ${k + 1} of the ground`;
    if (!Number.isFinite(x) || !Number.isFinite(y)) return `${name}: must have a place and a height`;
    if (!(radius >= 0)) return `${name} has the radius ${radius} m: must be in [0, ∞) m`;
    if (k === 0) continue;
    const [before, height] = vertices[k - 1];
    if (x <= before)
      return `${name} is at ${brief(x)} m: must lie behind the one before, at ${brief(before)} m; move it on, or remove it`;
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
  if (D.solver === "rigid" && vertices.length) return "surfaces are rigid: must be compliant over bumps";
  const sharp = vertices.some(
    (one, k) => one[2] === 0 && slopeOf(vertices[k - 1], one) > slopeOf(one, vertices[k + 1]),
  );
  if (bodyOf().sharp && sharp)
    return `${bodyOf().name} has sharp corners: must have round ones over sharp tops; round these, or choose another body`;
  return "";
}

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
  $("land").innerHTML = scene.ground(...bounds(shown.rows.x));
  $("land").classList.toggle("wrong", problemOfGround() !== "");
  $("corners").innerHTML = canHaveBumps() ? corners() : "";
}

const canHaveBumps = () => !D.recorded && D.solver === "compliant";

function corners() {
  const { first, last } = scene;
  const parts = [
    `<polyline data-grab="ground" points="${scene.surface(first, last).join(" ")}" fill="none" stroke="transparent" stroke-width="18"/>`,
  ];
  let seen = -Infinity;
  verticesOf().forEach(([x, y], k) => {
    const [column, row] = scene.pixel(x, y);
    if (!(x >= first && x <= last) || (Math.abs(column - seen) < 5 && k !== grabbed?.vertex)) return;
    seen = column;
    const place = `cx="${far(column)}" cy="${far(row)}"`;
    parts.push(
      `<circle ${place} r="4.5" fill="var(--ground)" stroke="${HAND}" stroke-width="2"/>` +
        `<circle ${place} r="${GRIP}" fill="transparent" data-grab="vertex" data-vertex="${k}" class="grip"/>`,
    );
  });
  return parts.join("");
}

/* Where a hand takes a vertex: it stops at its neighbours, and where the ground beside it would be too steep. */
function moveVertex(k, [x, y, radius]) {
  const vertices = verticesOf();
  const [last, next] = [vertices[k - 1], vertices[k + 1]];
  const place = clamp(rounded(x, 0.01), (last?.[0] ?? -Infinity) + APART, (next?.[0] ?? Infinity) - APART);
  let height = rounded(y, 0.005);
  for (const beside of [last, next].filter((one) => one)) {
    const most = 0.999 * E.ground.steepest * Math.abs(place - beside[0]);
    height = clamp(height, beside[1] - most, beside[1] + most);
  }
  const moved = vertices.with(k, [place, height, radius]);
  if (!problemOfVertices(moved)) chosen.profile = moved;
}

/* Vertices with one more on the ground. On a plane it has two beside it, which hold the ground level. */
function added(x) {
  const vertices = verticesOf();
  const place = rounded(x, 0.01);
  const vertex = [place, rounded(heightOn(groundLine(), x), 0.005), radiusOfAll()];
  if (!vertices.length) return [[place - 2, 0, radiusOfAll()], vertex, [place + 2, 0, radiusOfAll()]];
  const k = vertices.findIndex(([there]) => there > place);
  return vertices.toSpliced(k < 0 ? vertices.length : k, 0, vertex);
}

/* Without a vertex; the last two are removed together. */
const removed = (k) => (verticesOf().length > 2 ? verticesOf().filter((_, i) => i !== k) : []);

const canSet = () => shown && position === 0 && !D.recorded;

/* A click adds a vertex, unless it is the end of a drag. */
$("scene").addEventListener("click", (event) => {
  if (!canSet() || dropped || !event.target.closest("[data-grab=ground]")) return;
  chosen.profile = added(placeOf(event, $("scene").getBoundingClientRect())[0]);
  changed();
});
/* A vertex that is pressed twice goes. There is no double click: each press draws the ground anew. */
let pressed = { vertex: null, at: -Infinity };

function removeIfTwice(vertex, at) {
  const twice = vertex === pressed.vertex && at - pressed.at < 400;
  pressed = { vertex: twice ? null : vertex, at };
  if (!twice) return false;
  chosen.profile = removed(vertex);
  changed();
  return true;
}
