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
const isOver = () => !isRunning(you()) && time >= you().outcome.t;

/* Rides. A trim in [-1, 1] turns counterclockwise; an unsteady rider adds an error, but one of a trim not yet taken is not
   known. */
async function ride(trims, known = trims.length) {
  const spins = trims.map((trim, k) => E.trim * trim + ((k < known && hill.errors[k]) || 0));
  const asked = { task: "ride", scene: hill.scene, ride: { rotor_inertia: E.rotor_inertia, spins } };
  const found = await live.ask(asked);
  const last = found.status === "running" ? [found.outcome] : []; // the next flight would write this row
  const column = (name) => [...found.trajectory[name], ...last.map((one) => one[name])];
  return { ...found, rows: Object.fromEntries(COLUMNS.map((name) => [name, column(name)])) };
}

async function openHill(chosen) {
  [hill, going, asking] = [chosen, false, true];
  put($("question"), chosen.question);
  $("hill").selectedIndex = E.hills.indexOf(chosen);
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
  const landing = rebounds.t_touchdown.find((touchdown) => touchdown > begin + 1e-9) ?? rows.t.at(-1);
  const points = rows.t.flatMap((t, i) => (t >= begin && t <= landing ? [[rows.x[i], rows.y[i]]] : []));
  const pose = stateAt(rows, landing);
  const dashed = 'fill="none" stroke="var(--ink)" stroke-width="1.5" stroke-dasharray="5 4"';
  $("ahead").innerHTML =
    `<polyline points="${[...points, [pose.x, pose.y]].map((one) => close.at(...one)).join(" ")}" ${dashed}/>` +
    `<polygon points="${close.outline(close.body.outline, pose)}" ${dashed}/>`;
}

/* The pictures. */
function fit() {
  const { slope: given, launch } = hill.scene;
  const { size } = hill;
  const slope = {
    ...given,
    line: lineOf(own.pieces(given), size),
    length: given.length < Infinity ? given.length : null,
  };
  const body = D.drawn[E.hills.indexOf(hill)];
  const width = clamp($("controls").clientWidth, 260, 1160);
  const step = Math.ceil(you().rows.x.length / 500);
  const points = riders.flatMap(({ rows }) => rows.x.map((x, i) => [x, rows.y[i]]).filter((_, i) => i % step === 0));
  const long = bounds(body.outline.map(([x]) => x)).reduce((tail, tip) => tip - tail); // [m]
  const scale = (0.15 * width) / long; // [px/m]: the share of the picture that the body has
  close = new Scene({ slope, body, size, close: scale }, [[launch.x, launch.y]], width, [
    0,
    clamp(0.34 * width, 215, 340),
  ]);
  whole = new Scene({ slope, body, size, close: 0 }, points, width, [40, 90]);
  for (const [id, scene] of Object.entries({ scene: close, strip: whole }))
    $(id).setAttribute("viewBox", `0 0 ${scene.W} ${scene.H.toFixed(0)}`);
  const last = bounds(points.map(([x]) => x))[1];
  const outline = close.outline(body.outline, { x: 0, y: 0, phi: 0 });
  const ghosts = riders
    .slice(1)
    .map(
      ({ name, colour }, i) =>
        `<polygon id="rider-${i + 1}" points="${outline}" fill="${colour}" fill-opacity="0.35" stroke="${colour}" stroke-width="2" stroke-dasharray="6 3"/>` +
        `<text id="name-${i + 1}" text-anchor="middle" font-weight="600" fill="${colour}">${escaped(name.split(" ")[0])}</text>`,
    );
  const past = riders.map((_, i) => `<clipPath id="past-${i}"><rect y="-1e5" x="-1e5" height="2e5"/></clipPath>`);
  $("scene").innerHTML =
    `${close.sky()}<defs>${past.join("")}</defs><g id="world">${close.ground(0, last)}<g id="paths"></g>` +
    `<g id="ahead"></g>${ghosts.join("")}${close.sled({ x: 0, y: 0, phi: 0 }, 'id="rider-0"')}</g>`;
  const dots = riders.map(
    ({ colour }, i) => `<circle id="dot-${i}" r="${i ? 4.5 : 6}" fill="${colour}" stroke="var(--paper)"/>`,
  );
  $("strip").innerHTML = `${whole.sky()}${whole.ground(0, last)}${dots.reverse().join("")}`;
  const cards = riders.map(
    ({ name, colour }) =>
      `<div class="rider" style="--own: ${colour}"><p>${escaped(name)}</p><p class="score"></p><p class="how"></p></div>`,
  );
  $("riders").innerHTML = cards.join("");
  drawPaths();
  show();
  lookAhead();
}

/* The paths, as far as they are known: a clip hides what is to come. And what the visitor has chosen so far. */
function drawPaths() {
  const paths = riders.map(({ rows, colour }, i) => `<g clip-path="url(#past-${i})">${close.path(rows, colour)}</g>`);
  const marks = you().trims.map((trim, k) => {
    const [column, row] = close.pixel(you().takeoffs[k].x, you().takeoffs[k].y);
    const said = trim === 0 ? "0" : `${trim > 0 ? "▲" : "▼"} ${Math.abs(E.trim * trim).toFixed(2)}`;
    return words(column, row - hill.size * close.scale, said, "var(--ink)");
  });
  $("paths").innerHTML = paths.reverse().join("") + marks.join("");
  $("ahead").innerHTML = "";
}

function show() {
  riders.forEach((rider, i) => {
    const state = stateAt(rider.rows, time);
    const [column, row] = close.pixel(state.x, state.y);
    $(`rider-${i}`).setAttribute("transform", close.moved(state));
    $(`past-${i}`).firstElementChild.setAttribute("width", far(1e5 + column));
    $(`dot-${i}`).setAttribute("transform", `translate(${whole.pixel(state.x, state.y).map(far)})`);
    if (i === 0) $("world").setAttribute("transform", close.camera(state));
    else {
      $(`name-${i}`).setAttribute("x", far(column));
      $(`name-${i}`).setAttribute("y", far(row - hill.size * close.scale - 14 * i));
    }
    const [, score, how] = $("riders").children[i].children;
    put(score, scoreOf(rider, state.x).toFixed(3));
    put(how, howOf(rider, state.x));
  });
  const stopped = isOver() ? "Ride again" : atTakeoff() ? "Fly" : time > 0 ? "Go on" : "Start";
  put($("go"), going ? "Pause" : stopped);
  $("back").disabled = !you().trims.length;
  put($("words"), wordsNow());
}

const hasEnded = (rider) => !isRunning(rider) && time >= rider.outcome.t;
const scoreOf = (rider, x) => (hasEnded(rider) ? rider.jam.reward : D.share * clamp(x / hill.scene.slope.length, 0, 1)); // what is sure of it

function howOf(rider, x) {
  const { outcome, contacts, status } = rider;
  if (!hasEnded(rider)) return `is at ${fixed(x, 1, "m")}`;
  if (status === "finish") return `finished at ${fixed(outcome.u_line, 1, "m/s")}, after ${fixed(outcome.t, 2, "s")}`;
  const where = `at ${fixed(outcome.x, 1, "m")}${outcome.t_line < Infinity ? ", behind the finish" : ""}`;
  if (status !== "tumbled") return `${ENDS[status] ?? "was given up"} ${where}`;
  const last = contacts.row.at(-1);
  const parts = [...contacts.part].filter((_, k) => contacts.row[k] === last).map((code) => hill.parts[code - 1]);
  const falls = [...new Set(parts)].filter((part) => hill.ends.includes(part));
  return `fell ${where}: ${falls.join(" and ")} on the snow`;
}

function wordsNow() {
  if (isOver()) {
    const { jam, outcome } = you();
    const best = Math.max(hill.best ?? 0, jam.reward);
    return `You ${howOf(you(), outcome.x)}. Score ${jam.reward.toFixed(3)}, your best here ${best.toFixed(3)}.`;
  }
  if (atTakeoff() && !going)
    return `Flight ${you().trims.length + 1}: trim it with ◀ ▶ to land along the snow, then fly.`;
  return time > 0 ? "" : "Get to the finish without a fall: you trim each flight at its take-off.";
}

/* The clock, which stands while the visitor chooses. */
function pause() {
  going = false;
  show();
}

/* At a take-off, or at the end, where the others are shown at theirs. */
function arrive() {
  if (atTakeoff() && $("through").checked && going) {
    takeOff();
    return;
  }
  if (isOver()) {
    time = bounds(riders.map(({ outcome }) => outcome.t))[1];
    hill.best = Math.max(hill.best ?? 0, you().jam.reward);
  }
  pause();
  lookAhead();
}

function tick(now) {
  if (!going || asking) return;
  time = Math.min(time + ($("speed").value * Math.max(now - clock, 0)) / 1000, you().outcome.t);
  clock = now;
  show();
  if (time < you().outcome.t) requestAnimationFrame(tick);
  else arrive();
}

function run() {
  going = true;
  clock = performance.now();
  drawPaths();
  requestAnimationFrame(tick);
}

function go() {
  if (asking || !riders.length) return;
  if (going) pause();
  else if (isOver()) again(run);
  else if (atTakeoff()) takeOff();
  else run();
}

$("go").addEventListener("click", go);
$("again").addEventListener("click", () => again());
$("back").addEventListener("click", takeBack);
$("up").addEventListener("click", () => nudge(-1));
$("down").addEventListener("click", () => nudge(1));
$("trim").addEventListener("input", () => setTrim(Number($("trim").value)));
$("hill").addEventListener("input", () => {
  location.hash = new URLSearchParams({ slope: E.hills[$("hill").selectedIndex].name });
});
window.addEventListener("hashchange", openAddress);
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

/* The slope that a link holds, or the first one. */
function openAddress() {
  const asked = new URLSearchParams(location.hash.slice(1)).get("slope");
  return openHill(E.hills.find(({ name }) => name === asked) ?? E.hills[0]);
}

async function openPage() {
  const bytes = await unpacked(D.kernel);
  if (!bytes) return;
  tell("The rides are being simulated."); // in place of what is said where no script runs
  live = new Pool(1, bytes);
  $("hill").innerHTML = E.hills.map(({ name }) => `<option>${escaped(name)}</option>`).join("");
  $("hills").hidden = E.hills.length < 2;
  await openAddress();
}

openPage();
