"use strict";
/* The page to ride: at each take-off the visitor's trim is taken, and the worker follows the ride to the next one. */
const D = JSON.parse($("data").textContent);
const E = parsed(D.exact);
const COLOURS = ["var(--blue)", "#cc79a7", "#e69f00", "#009e73", "#8c6d31"]; // the visitor's first
const COLUMNS = ["t", "x", "y", "phi", "u", "v", "omega"];
const ENDS = { jammed: "came to rest", timeout: "was given up", buried: "sank in" };
let live = null; // the worker
let hill = null;
let riders = []; // the visitor first: { name, colour, trims, and what the worker has found of the ride }
let close = null; // the picture that follows the visitor
let whole = null; // the strip
let time = 0;
let going = false;
let asking = false;
let clock = 0;

const you = () => riders[0];
const isRunning = (rider) => rider.status === "running";
const atTakeoff = () => isRunning(you()) && time >= you().outcome.t;
const lastTime = () => Math.max(...riders.map(({ outcome }) => outcome.t));
const isOver = () => !isRunning(you()) && time >= lastTime();

/* Rides. A trim in [-1, 1] turns counterclockwise; an unsteady rider adds an error, but one of a trim not yet taken is not
   known. */
async function ride(trims, known = trims.length) {
  const spins = trims.map((trim, k) => E.trim * trim + ((k < known && hill.errors[k]) || 0));
  const found = await live.ask({
    task: "ride",
    scene: hill.scene,
    ride: { rotor_inertia: E.rotor_inertia, spins },
  });
  const last = found.status === "running" ? [found.outcome] : []; // the next flight would write this row
  const rows = Object.fromEntries(
    COLUMNS.map((name) => [name, [...found.trajectory[name], ...last.map((one) => one[name])]]),
  );
  return { ...found, rows };
}

async function openHill(number) {
  const chosen = E.hills[number];
  [hill, going, asking] = [chosen, false, true];
  put($("question"), chosen.question);
  const named = [{ name: "you", trims: [] }, ...chosen.rides];
  try {
    const found = await Promise.all(named.map(({ trims }) => ride(trims)));
    if (hill !== chosen) return;
    riders = named.map((one, i) => ({
      ...one,
      trims: [...one.trims],
      colour: COLOURS[i % COLOURS.length],
      ...found[i],
    }));
    tell("");
  } catch (error) {
    giveUp(`The rides were given up: ${error.message}.`);
    return;
  }
  asking = false;
  toStart();
}

function toStart() {
  [time, going] = [0, false];
  setTrim(0);
  fit();
}

/* Follow the visitor's ride with other trims, and stand at some time of it. */
async function follow(trims, then) {
  const here = hill;
  asking = true;
  try {
    const found = await ride(trims);
    if (hill !== here) return;
    Object.assign(you(), found, { trims });
    tell("");
    asking = false;
    then();
  } catch (error) {
    asking = false;
    pause();
    tell(`The flight was given up: ${error.message}. Try another trim.`);
  }
}

const takeOff = () => follow([...you().trims, trimOf()], run);

function again(then = () => {}) {
  if (asking) return;
  follow([], () => {
    toStart();
    then();
  });
}

function takeBack() {
  if (asking || !you().trims.length) return;
  pause();
  follow(you().trims.slice(0, -1), () => {
    time = you().outcome.t;
    drawPaths();
    arrive();
  });
}

/* The trim: to the right it turns clockwise. */
const trimOf = () => 0 - Number($("trim").value);
const trimWords = (trim) =>
  trim === 0 ? "no trim" : `${D.turns[trim > 0 ? 0 : 1]} ${fixed(Math.abs(E.trim * trim), 2, "rad/s")}`;
const trimMark = (trim) => (trim === 0 ? "0" : `${trim > 0 ? "▲" : "▼"} ${Math.abs(E.trim * trim).toFixed(2)}`);

function setTrim(value) {
  $("trim").value = clamp(value, -1, 1).toFixed(2);
  $("lent").textContent = trimWords(trimOf());
  $("trim").setAttribute("aria-valuetext", trimWords(trimOf()));
  lookAhead();
}

const nudge = (direction) => setTrim(Number($("trim").value) + direction * Number($("trim").step));

/* Where the flight with this trim would land. */
let looking = false;
let lookAgain = false;

async function lookAhead() {
  if (looking) {
    lookAgain = true;
    return;
  }
  looking = true;
  do {
    lookAgain = false;
    if (!riders.length || asking || going || !atTakeoff()) continue;
    const { trims, outcome } = you();
    const found = await ride([...trims, trimOf()], trims.length).catch(() => null);
    if (found && trims === you().trims && !asking && !going) drawAhead(found, outcome.t);
  } while (lookAgain);
  looking = false;
}

function drawAhead({ rows, rebounds }, begin) {
  const landing = rebounds.t_touchdown.find((touchdown) => touchdown > begin + 1e-9) ?? rows.t[rows.t.length - 1];
  const points = rows.t.flatMap((t, i) => (t >= begin && t <= landing ? [[rows.x[i], rows.y[i]]] : []));
  const { x, y, phi } = stateAt(rows, landing);
  const dashed = 'fill="none" stroke="var(--ink)" stroke-width="1.5" stroke-dasharray="5 4"';
  $("ahead").innerHTML =
    `<polyline points="${[...points, [x, y]].map((one) => close.at(...one)).join(" ")}" ${dashed}/>` +
    `<polygon points="${close.outline(close.body.outline, x, y, phi)}" ${dashed}/>`;
}

/* The pictures. */
function fit() {
  const { slope: given, launch } = hill.scene;
  const { size } = hill;
  const line = lineOf(own.pieces(given), size);
  const slope = { line, angle: given.angle, length: given.length < Infinity ? given.length : null };
  const body = D.drawn[E.hills.indexOf(hill)];
  const width = clamp($("controls").clientWidth, 260, 1160);
  const points = riders.flatMap(({ rows }) => rows.x.map((x, i) => [x, rows.y[i]]));
  const scale = clamp(width / 16, 36, 72) * Math.min(1, 1.5 / size); // [px/m]
  close = new Scene({ slope, body, size, close: scale }, [[launch.x, launch.y]], width, [0, width < 450 ? 330 : 400]);
  whole = new Scene({ slope, body, size, close: 0 }, thinned(points, 500), width, [60, 200]);
  for (const [id, scene] of [
    ["scene", close],
    ["strip", whole],
  ])
    $(id).setAttribute("viewBox", `0 0 ${scene.W} ${scene.H.toFixed(0)}`);
  const last = Math.max(...points.map(([x]) => x));
  const ghosts = riders.slice(1).map(({ colour }, i) => {
    const outline = close.outline(body.outline, 0, 0, 0);
    return `<polygon id="rider-${i + 1}" points="${outline}" fill="${colour}" fill-opacity="0.4" stroke="${colour}"/>`;
  });
  const past = riders.map((_, i) => `<clipPath id="past-${i}"><rect y="-1e5" x="-1e5" height="2e5"/></clipPath>`);
  $("scene").innerHTML =
    `${close.sky()}<defs>${past.join("")}</defs><g id="world">${close.ground(0, last)}<g id="paths"></g>` +
    `<g id="ahead"></g>${ghosts.join("")}${close.sled(0, 0, 0, 'id="rider-0"')}</g>`;
  $("strip").innerHTML =
    `${whole.sky()}${whole.ground(0, last)}<g id="marks"></g>` +
    riders
      .map(({ colour }, i) => `<circle id="dot-${i}" r="${i ? 4.5 : 6}" fill="${colour}" stroke="var(--paper)"/>`)
      .reverse()
      .join("");
  $("riders").innerHTML = riders
    .map(
      ({ name, colour }) =>
        `<div class="rider" style="--own: ${colour}"><p>${escaped(name)}</p><p class="score"></p><p class="how"></p>` +
        '<svg class="trims" viewBox="0 0 240 48" preserveAspectRatio="xMinYMid" role="img"></svg></div>',
    )
    .join("");
  drawPaths();
  show();
  lookAhead();
}

function thinned(points, most) {
  const step = Math.ceil(points.length / most);
  return points.filter((_, i) => i % step === 0);
}

/* The paths, as far as they are known: a clip hides what is to come. And what the visitor has chosen so far. */
function drawPaths() {
  const marks = you().trims.map((trim, k) => ({ ...you().takeoffs[k], trim }));
  const apart = 3 / close.scale;
  $("paths").innerHTML =
    riders
      .map(({ rows, colour }, i) => {
        let last = -Infinity;
        const points = rows.x.flatMap((x, k) => (x - last > apart ? [[(last = x), rows.y[k]]] : []));
        return `<g clip-path="url(#past-${i})">${close.path(points, colour)}</g>`;
      })
      .reverse()
      .join("") +
    marks
      .map(({ x, y, trim }) => {
        const [column, row] = close.pixel(x, y);
        return (
          `<circle cx="${far(column)}" cy="${far(row)}" r="4" fill="var(--blue)"/>` +
          `<text x="${far(column)}" y="${far(row - 0.8 * hill.size * close.scale)}" text-anchor="middle" fill="var(--ink)">${trimMark(trim)}</text>`
        );
      })
      .join("");
  $("marks").innerHTML = marks
    .map(({ x, y, trim }) => {
      const [column, row] = whole.pixel(x, y);
      const tip = row - 8 - 6 * Math.sign(trim);
      return `<polygon points="${far(column - 4)},${far(row - 8)} ${far(column + 4)},${far(row - 8)} ${far(column)},${far(tip)}" fill="var(--blue)" stroke="var(--blue)"/>`;
    })
    .join("");
  $("ahead").innerHTML = "";
}

/* What moves the picture so that the visitor is in it: steadily, as the ground around goes. */
function camera({ x, y }) {
  const around = Array.from({ length: 13 }, (_, i) => close.height(x + i - 6));
  const [column, row] = close.pixel(x, y);
  const [, ground] = close.pixel(x, around.reduce((sum, one) => sum + one) / around.length);
  const down = Math.max(0.66 * close.H - ground, 0.2 * close.H - row);
  return `translate(${(0.32 * close.W - column).toFixed(2)} ${down.toFixed(2)})`;
}

function show() {
  riders.forEach((rider, i) => {
    const state = stateAt(rider.rows, time);
    $(`rider-${i}`).setAttribute("transform", close.moved(state));
    $(`past-${i}`).firstElementChild.setAttribute("width", far(1e5 + close.pixel(state.x, state.y)[0]));
    const [column, row] = whole.pixel(state.x, state.y);
    $(`dot-${i}`).setAttribute("transform", `translate(${far(column)} ${far(row)})`);
    if (i === 0) $("world").setAttribute("transform", camera(state));
    showRider(rider, $("riders").children[i], state);
  });
  const stopped = isOver() ? "Ride again" : atTakeoff() ? "Fly" : time > 0 ? "Go on" : "Start";
  put($("go"), going ? "Pause" : stopped);
  $("back").disabled = !you().trims.length;
  put($("words"), wordsNow());
}

function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

const hasEnded = (rider) => !isRunning(rider) && time >= rider.outcome.t;
const scoreOf = (rider, x) => (hasEnded(rider) ? rider.jam.reward : D.share * clamp(x / hill.scene.slope.length, 0, 1)); // what is sure of it

function howOf(rider, x) {
  const { outcome, contacts, status } = rider;
  if (!hasEnded(rider)) return `is at ${fixed(x, 1, "m")}`;
  const where = `at ${fixed(outcome.x, 1, "m")}`;
  const line = outcome.t_line < Infinity ? ", behind the finish" : "";
  if (status === "finish") return `finished at ${fixed(outcome.u_line, 1, "m/s")}, after ${fixed(outcome.t, 2, "s")}`;
  if (status === "tumbled") {
    const last = contacts.row.at(-1);
    const parts = [...contacts.part].filter((_, k) => contacts.row[k] === last).map((code) => hill.parts[code - 1]);
    const falls = [...new Set(parts)].filter((part) => hill.ends.includes(part));
    return `fell ${where}${line}: ${falls.join(" and ")} on the snow`;
  }
  return `${ENDS[status] ?? "was given up"} ${where}${line}`;
}

function showRider(rider, card, { x }) {
  put(card.children[1], scoreOf(rider, x).toFixed(3));
  put(card.children[2], howOf(rider, x));
  const taken = rider.trims.filter((_, k) => rider.takeoffs[k]?.t <= time); // the ride may have ended before the last
  const bars = card.children[3];
  if (bars.dataset.count === String(taken.length) && bars.dataset.of === String(rider.trims)) return;
  Object.assign(bars.dataset, { count: taken.length, of: rider.trims });
  const wide = Math.min(16, 236 / taken.length);
  bars.setAttribute("aria-label", `trims so far: ${taken.map(trimWords).join(", ") || "none"}`);
  bars.innerHTML =
    '<line x1="0" x2="240" y1="24" y2="24" stroke="var(--line)"/>' +
    taken
      .map((trim, k) => {
        const high = Math.max(22 * Math.abs(trim), 1);
        const top = trim > 0 ? 24 - high : 24;
        return `<rect x="${(2 + k * wide).toFixed(1)}" y="${top.toFixed(1)}" width="${(0.75 * wide).toFixed(1)}" height="${high.toFixed(1)}" fill="var(--own)"/>`;
      })
      .join("");
}

function wordsNow() {
  if (isOver()) {
    const [first, ...others] = [...riders].sort((a, b) => b.jam.reward - a.jam.reward);
    const told = others.map(({ name, jam }) => `${name} ${jam.reward.toFixed(3)}`).join(", ");
    return `${first === you() ? "You win" : `Best: ${first.name}`}, ${first.jam.reward.toFixed(3)}; ${told}.`;
  }
  if (atTakeoff() && !going) return `Take-off ${you().trims.length + 1}: choose a trim, then fly.`;
  return "";
}

/* The clock, which stands while the visitor chooses. */
function pause() {
  going = false;
  show();
}

function arrive() {
  if (atTakeoff() && $("through").checked && going) takeOff();
  else {
    pause();
    lookAhead();
  }
}

function tick(now) {
  if (!going || asking) return;
  const next = time + ($("speed").value * Math.max(now - clock, 0)) / 1000;
  clock = now;
  time = Math.min(next, isRunning(you()) ? you().outcome.t : lastTime());
  show();
  if (atTakeoff() || isOver()) arrive();
  else requestAnimationFrame(tick);
}

function run() {
  going = true;
  clock = performance.now();
  drawPaths();
  requestAnimationFrame(tick);
}

function go() {
  if (asking || !riders.length) return;
  if (going) {
    pause();
    return;
  }
  if (isOver()) again(run);
  else if (atTakeoff()) takeOff();
  else run();
}

$("go").addEventListener("click", go);
$("again").addEventListener("click", () => again());
$("back").addEventListener("click", takeBack);
$("up").addEventListener("click", () => nudge(-1));
$("down").addEventListener("click", () => nudge(1));
$("trim").addEventListener("input", () => setTrim(Number($("trim").value)));
$("hill").addEventListener("input", () => openHill($("hill").selectedIndex));
document.addEventListener("keydown", (event) => {
  const onTrim = event.target === $("trim");
  if (event.ctrlKey || event.metaKey || event.altKey || (event.target.closest("input, select") && !onTrim)) return;
  const keys = { ArrowLeft: -1, ArrowRight: 1, ...(onTrim ? { ArrowUp: -1, ArrowDown: 1 } : {}) };
  if (event.key in keys) nudge(keys[event.key]);
  else if (event.key === " " && !event.target.closest("button")) {
    if (!event.repeat) go();
  } else if (event.key === "Backspace") takeBack();
  else return;
  event.preventDefault();
});
/* What a hand has pressed or chosen leaves the keys to the ride. */
document.addEventListener("click", ({ target, detail }) => {
  if (detail) target.closest("button, #through")?.blur();
});
document.addEventListener("change", ({ target }) => target.closest("select")?.blur());
window.addEventListener("resize", () => {
  if (riders.length) fit();
});

async function openPage() {
  const bytes = await unpacked(D.kernel);
  if (!bytes) return;
  tell("The rides are being simulated."); // in place of what is said where no script runs
  live = new Pool(1, bytes);
  $("hill").innerHTML = E.hills.map(({ name }) => `<option>${escaped(name)}</option>`).join("");
  $("hills").hidden = E.hills.length < 2;
  await openHill(0);
}

openPage();
