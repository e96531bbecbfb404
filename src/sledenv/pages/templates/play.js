"use strict";
/* The page that simulates: each change asks the worker for the descent, and what it finds is shown. */
const FPS = 60;
let live = null; // the worker of the descent
let position = 0; // in the film
let playing = false;
let clock = 0;
let selected = 0; // rebound

/* The descent. */
let asking = false;
let again = false;
let said = []; // of the address, until something changes

async function simulate() {
  if (asking) {
    again = true;
    return;
  }
  asking = true;
  do {
    again = false;
    const wrong = problem();
    if (wrong) {
      tell(`Not simulated: ${wrong}.`);
      if (shown) drawLand();
      continue;
    }
    const input = structuredClone(chosen);
    try {
      const asked = { task: "descend", scene: sceneOf(), launch: launchOf(), state: givenLaunch() };
      accept({ ...(await live.ask(asked)), input });
      tell(said.length ? `Left out of what the address asks for: ${said.join("; ")}.` : "");
    } catch (error) {
      tell(`The descent was given up: ${error.message}. Change something, and the next one is tried.`);
    }
  } while (again);
  asking = false;
  settled();
}

function accept(found) {
  const rows = drawable(found);
  shown = { ...found, rows, film: filmOf(found, rows.t.at(-1)) };
  selected = clamp(selected, 0, Math.max(found.rebounds.t.length - 1, 0));
  pause();
  position = 0;
  if (!grabbed) fit();
  draw();
}

/* Something has been chosen: the descent is simulated at once, all else a moment after the last change. */
function changed() {
  said = [];
  crew.forget("rewards");
  fillPanel();
  simulate();
}

let pending = 0;

function settled() {
  clearTimeout(pending);
  pending = setTimeout(() => {
    if (problem()) return;
    if (location.protocol !== "about:")
      // a frame of a notebook has no address
      history.replaceState(null, "", address() ? `#${address()}` : location.pathname); // Safari allows few a second
    refreshMap();
  }, 250);
}

/* Everything that follows from the descent. */
function draw() {
  drawPath();
  drawOutcome();
  if (!grabbed) {
    // what is not looked at while something is dragged
    drawTable();
    requestDraw();
    drawLedger();
    drawSeries();
    $("python").textContent = pythonOf(shown);
  }
  $("slider").max = Math.ceil(filmLength() * FPS);
  show(position);
}

const filmLength = () => shown.film.film.at(-1);

function drawOutcome() {
  const { status, outcome, jam } = shown;
  const pairs = [
    ["status", status.replace("_", " ")],
    ...Object.entries(D.metrics).map(([name, words]) => [words, fixed(jam[name], 3)]),
    ["time", fixed(outcome.t, 3, "s")],
    ["end at x", fixed(outcome.x, 2, "m")],
    ["speed at the finish", outcome.t_line < Infinity ? fixed(outcome.u_line, 2, "m/s") : "–"],
    ["energy kept", fixed(100 * jam.retention, 1, "%")],
    ["rebounds", String(outcome.rebounds)],
  ];
  const list = $("outcome");
  if (!list.children.length) list.innerHTML = entries(pairs);
  pairs.forEach(([, text], i) => put(list.children[i].lastElementChild, text));
}

function cellsOf(i) {
  const { rebounds: R } = shown;
  const change = (name) => `${fixed(R[`${name}_before`][i], 2)} → ${fixed(R[`${name}_after`][i], 2)}`;
  const part = R.feature[i] ? partOf(R.feature[i]) : "none";
  const stuck = ["", "nearly", "yes"][R.stuck[i]];
  return [
    i + 1,
    fixed(R.t[i], 4),
    fixed(R.x[i], 4),
    part,
    D.modes[R.mode[i]],
    ...["u", "v", "omega"].map(change),
    stuck,
  ];
}

function drawTable() {
  const row = (name, cells, more = "") =>
    `<tr ${more}>${cells.map((one) => `<${name}>${escaped(one)}</${name}>`).join("")}</tr>`;
  const rows = Array.from(shown.rebounds.t, (_, i) => row("td", cellsOf(i), `tabindex="0" data-rebound="${i}"`));
  $("rebounds").innerHTML =
    `<thead>${row("th", D.header)}</thead>` +
    `<tbody>${rows.join("") || `<tr><td colspan="${D.header.length}">no rebounds</td></tr>`}</tbody>`;
}

/* What was put in: the energy at launch, and the height that the body has come down. */
function drawLedger() {
  const { outcome: O } = shown;
  const felt = D.flight_losses.filter((name) => O[name] > 0);
  const losses = [...D.losses, ...felt].map((name) => [`lost by ${name}`, O[name]]);
  const parts = [["still in motion", O.kinetic], ["stored in the contact", O.stored], ...losses];
  const colours = ["#0072b2", "#009e73", "#d55e00", "#e69f00", "#cc79a7"];
  const total = O.initial - O.potential;
  const lost = losses.reduce((sum, [, value]) => sum + value, 0);
  const residual = O.kinetic + O.potential + O.stored + O.rotor + (lost + O.absorbed) - O.initial - O.work;
  const bar = parts.map(
    ([, value], i) =>
      `<i style="width:${(clamp(value / total, 0, 1) * 100).toFixed(2)}%;background:${colours[i]}"></i>`,
  );
  const told = parts.map(
    ([name, value], i) =>
      `<div><dt><i style="background:${colours[i]}"></i>${name}</dt><dd>${fixed(value, 2, "J")}</dd></div>`,
  );
  const rest = [
    ["put in, by launch and height", fixed(total, 2, "J")],
    ["unaccounted for", `${residual.toExponential(1).replaceAll("-", "−")} J`],
  ];
  $("ledger").innerHTML = `<div class="bar">${bar.join("")}</div><dl>${told.join("")}${entries(rest)}</dl>`;
}

/* The film. */
function show(where, fromSlider) {
  position = clamp(where, 0, filmLength());
  const t = between(shown.film.film, shown.film.time, position);
  if (!fromSlider) $("slider").value = Math.round(position * FPS);
  $("time").textContent = fixed(t, 4, "s");
  drawMoment(t);
  const begun = shown.rebounds.t_touchdown.findLastIndex((begin) => begin <= t);
  if (begun >= 0) selected = begun;
  if (grabbed) return;
  tellNow(t);
  for (const row of $("rebounds").tBodies[0].rows)
    row.classList.toggle("current", Number(row.dataset.rebound) === selected);
}

function showRebound(i) {
  pause();
  selected = i;
  show(0.55 * shown.film.film[2 * i + 1] + 0.45 * shown.film.film[2 * i + 2]);
}

function goTo(t) {
  pause();
  show(between(shown.film.time, shown.film.film, t));
}

function pause() {
  playing = false;
  $("play").textContent = "Play";
}

function tick(now) {
  if (!playing) return;
  show(position + ($("speed").value * Math.max(now - clock, 0)) / 1000);
  clock = now;
  if (position >= filmLength()) pause();
  else requestAnimationFrame(tick);
}

function toggle() {
  if (playing || !shown) {
    pause();
    return;
  }
  if (position >= filmLength()) show(0);
  playing = true;
  $("play").textContent = "Pause";
  clock = performance.now();
  requestAnimationFrame(tick);
}

$("play").addEventListener("click", toggle);
$("slider").addEventListener("input", () => {
  pause();
  show($("slider").value / FPS, true);
});
$("rebounds").addEventListener("click", ({ target }) => {
  const row = target.closest("[data-rebound]");
  if (row) showRebound(Number(row.dataset.rebound));
});
$("rebounds").addEventListener("keydown", (event) => {
  const row = event.target.closest("[data-rebound]");
  if (!row || event.key !== "Enter") return;
  showRebound(Number(row.dataset.rebound));
});
document.addEventListener("keydown", (event) => {
  if (!shown || event.target.closest("input, select, button, summary, svg")) return;
  const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  if (event.key === " ") toggle();
  else if (step) {
    pause();
    show(position + step / FPS);
  } else return;
  event.preventDefault();
});
window.addEventListener("resize", () => {
  if (!shown) return;
  fit();
  draw();
});
window.addEventListener("hashchange", () => {
  if (!D.recorded) openAddress();
});

function openAddress() {
  const wrong = readAddress(location.hash.slice(1));
  changed();
  said = wrong;
}

async function openPage() {
  $("notes").innerHTML = D.notes.map((text) => `<p class="hint">${escaped(text)}</p>`).join("");
  const bytes = await unpacked(D.kernel);
  if (!bytes) return;
  if (D.recorded) {
    document.body.classList.add("recorded");
    accept({ ...parsed(D.recorded), scene: sceneOf(), input: structuredClone(chosen) });
    tell("");
    return;
  }
  tell("The first descent is being simulated."); // in place of what is said where no script runs
  live = new Pool(1, bytes);
  crew = new Pool(clamp(navigator.hardwareConcurrency || 2, 1, 8), bytes);
  buildPanel();
  $("maps").open = D.maps;
  openAddress();
}

openPage();
