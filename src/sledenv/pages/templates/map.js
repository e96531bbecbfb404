"use strict";
const D = JSON.parse($("data").textContent);
const [X, Y] = D.controls;
const across = X.values.length;
const upright = Y && Y.values.length > 1 ? Y.values.length : 1;
const flat = D.controls.length === 1;
const cells = across * upright;
const STATE = ["x", "y", "phi", "u", "v", "omega"];
const [tick, ...least] = D.steps.map(Number);
const steps = [least[0], least[0], least[1], least[2], least[2], least[3]];
const named = (control, value) =>
  `${control.name} ${fixed(value, control.digits)}${control.unit === "°" ? "°" : " " + control.unit}`;

/* Launches of a context, unpacked once: see sledenv/pages/keyframes.py. */
const unpacked = new Map();

async function unpack(text) {
  const bytes = atob(text);
  const packed = new Uint8Array(bytes.length);
  for (let i = 0; i < bytes.length; i++) packed[i] = bytes.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const n = planes.length / 4;
  const words = new Uint32Array(n);
  for (let i = 0; i < n; i++)
    words[i] = planes[i] | (planes[n + i] << 8) | (planes[2 * n + i] << 16) | (planes[3 * n + i] << 24);
  return words;
}

async function launchesOf(number) {
  if (!unpacked.has(number))
    unpacked.set(number, decode(D.contexts[number], await unpack(D.contexts[number].launches)));
  return unpacked.get(number);
}

function decode(context, words) {
  const n = cells + context.marks.length;
  const gravity = context.gravity.map(Number);
  const found = { n };
  let place = 0;
  const take = (count) => words.subarray(place, (place += count));
  const whole = (list) => Int32Array.from(list, (w) => (w >>> 1) ^ -(w & 1));
  for (const name of D.counts) found[name] = whole(take(n));
  for (const name of D.numbers) found[name] = new Float32Array(words.buffer, 4 * place, take(n).length);
  const counts = whole(take(n));
  const keys = counts.reduce((sum, count) => sum + count, 0);
  const ahead = whole(take(keys));
  const changes = STATE.map(() => whole(take(keys)));
  found.first = new Int32Array(n + 1);
  found.touching = Uint8Array.from(ahead, (value) => value & 1);
  for (const name of ["t", ...STATE]) found[name] = new Float64Array(keys);
  const { t, x, y, phi, u, v, omega, touching } = found;
  const states = [x, y, phi, u, v, omega];
  const round = (value, k) => Math.floor(value / steps[k] + 0.5);
  for (let i = 0, at = 0; i < n; i++) {
    for (let passed = 0, k = at; k < at + counts[i]; passed += ahead[k++] >> 1) {
      t[k] = passed * tick;
      const b = k - 1;
      const start = k === at;
      const seconds = start ? 0 : (ahead[b] >> 1) * tick;
      const flying = start || touching[b] ? 0 : seconds;
      const set = (q, value) => {
        states[q][k] = (changes[q][k] + (start ? 0 : round(value, q))) * steps[q];
      };
      set(3, u[b] + flying * gravity[0]);
      set(4, v[b] + flying * gravity[1]);
      set(5, omega[b]);
      set(0, x[b] + seconds * (u[b] + u[k]) * 0.5);
      set(1, y[b] + seconds * (v[b] + v[k]) * 0.5);
      set(2, phi[b] + seconds * (omega[b] + omega[k]) * 0.5);
    }
    found.first[i + 1] = at += counts[i];
  }
  return found;
}

function descentOf(launches, index) {
  const [from, to] = [launches.first[index], launches.first[index + 1]];
  const rows = {};
  for (const name of ["t", "touching", ...STATE]) rows[name] = launches[name].subarray(from, to);
  for (const name of [...D.counts, ...D.numbers]) rows[name] = launches[name][index];
  rows.contacts = [];
  for (let k = 0; k + 1 < rows.t.length; k++)
    if (rows.touching[k]) {
      const last = rows.contacts[rows.contacts.length - 1];
      if (last && last.end === rows.t[k] && k && rows.touching[k - 1]) last.end = rows.t[k + 1];
      else rows.contacts.push({ begin: rows.t[k], end: rows.t[k + 1] });
    }
  for (const contact of rows.contacts)
    for (const [time, place] of [
      ["begin", "from"],
      ["end", "to"],
    ])
      contact[place] = lowest(stateAt(rows, contact[time]));
  return rows;
}

function lowest({ x, phi }) {
  // where along the slope the lowest point of the body lies
  const c = Math.cos(phi);
  const s = Math.sin(phi);
  let depth = Infinity;
  let place = x;
  for (const [a, b] of D.body.outline)
    if (a * s + b * c < depth) {
      depth = a * s + b * c;
      place = x + a * c - b * s;
    }
  return place;
}

/* Where we are. */
let number = 0;
let index = 0;
let L = null;
let R = null;
let scene = null;
let t = 0;
let playing = false;
let clock = 0;
const context = () => D.contexts[number];
const isMark = () => index >= cells;
const mark = () => context().marks[index - cells];
const valuesOf = (i) =>
  i >= cells
    ? context().marks[i - cells].values
    : D.controls.map((control, k) => control.values[k === 0 ? Math.floor(i / upright) : k === 1 ? i % upright : 0]);
const end = () => R.t[R.t.length - 1];

/* The map. */
const colour = (value) => {
  const place = clamp(value, 0, 1) * (D.colours.length - 1);
  const i = Math.min(Math.floor(place), D.colours.length - 2);
  const part = (k, shift) => parseInt(D.colours[k].slice(1 + shift, 3 + shift), 16);
  return [0, 2, 4].map((shift) => Math.round(part(i, shift) + (place - i) * (part(i + 1, shift) - part(i, shift))));
};

let chart = null; // its geometry

function drawMap() {
  const width = Math.max($("map").parentElement.clientWidth, 200);
  const left = 46;
  const right = 8;
  const top = flat ? 24 : 44;
  const bottom = 38;
  const height = top + bottom + clamp(0.66 * (width - left - right), 190, 400);
  const parts = [];
  const spread = (values) => {
    // half a cell beyond the first and the last value
    const half = values.length > 1 ? 0.5 * (values[1] - values[0]) : 0.5;
    return [values[0] - half, values[values.length - 1] + half];
  };
  chart = { width, height, left, right, top, bottom, x: spread(X.values), y: flat ? [0, 1] : spread(Y.values) };
  chart.column = (value) => left + ((value - chart.x[0]) / (chart.x[1] - chart.x[0])) * (width - left - right);
  chart.row = (value) => height - bottom - ((value - chart.y[0]) / (chart.y[1] - chart.y[0])) * (height - top - bottom);
  const [w, h] = [width - left - right, height - top - bottom];
  if (flat) {
    const points = X.values.map((value, i) => `${far(chart.column(value))},${far(chart.row(L.expected[i]))}`).join(" ");
    parts.push(
      `<rect x="${left}" y="${top}" width="${w}" height="${h}" fill="#f6f8fa"/>`,
      `<polyline points="${points}" fill="none" stroke="#0072b2" stroke-width="1.3"/>`,
    );
  } else {
    parts.push(
      `<image href="${picture()}" x="${left}" y="${top}" width="${w}" height="${h}" preserveAspectRatio="none"/>`,
    );
    parts.push(legend(left, w));
  }
  const axis = (text, attributes) => `<text ${attributes} fill="#2d343c">${escaped(text)}</text>`;
  for (const value of ticks(...chart.x, width < 450 ? 6 : 9, X.unit)) {
    const column = chart.column(value);
    parts.push(
      `<line x1="${column}" x2="${column}" y1="${height - bottom}" y2="${height - bottom + 4}" stroke="#62707e"/>`,
      `<text x="${column}" y="${height - bottom + 17}" text-anchor="middle" fill="#62707e">${fixed(value, 0)}</text>`,
    );
  }
  for (const value of flat ? [0, 0.25, 0.5, 0.75, 1] : ticks(...chart.y, 9, Y.unit)) {
    const row = chart.row(value);
    parts.push(
      `<line x1="${left - 4}" x2="${flat ? width - right : left}" y1="${row}" y2="${row}" stroke="${flat ? "#d9e0e7" : "#62707e"}"/>`,
      `<text x="${left - 7}" y="${row + 4}" text-anchor="end" fill="#62707e">${String(value).replace("-", "−")}</text>`,
    );
  }
  parts.push(axis(`${X.name} at launch [${X.unit}]`, `x="${left + w / 2}" y="${height - 5}" text-anchor="middle"`));
  parts.push(
    axis(
      flat ? "reward" : `${Y.name} at launch [${Y.unit}]`,
      flat
        ? `x="${left}" y="${top - 10}"`
        : `transform="translate(12 ${top + h / 2}) rotate(-90)" text-anchor="middle"`,
    ),
  );
  parts.push(
    ...context()
      .marks.map((one, i) => symbol(one, ...placeOf(cells + i)))
      .reverse(),
  ); // the best on top
  parts.push('<g id="cursor"></g>');
  $("map").setAttribute("viewBox", `0 0 ${width} ${height}`);
  $("map").innerHTML = parts.join("");
}

function picture() {
  const canvas = document.createElement("canvas");
  canvas.width = across;
  canvas.height = upright;
  const pen = canvas.getContext("2d");
  const image = pen.createImageData(across, upright);
  for (let i = 0; i < across; i++)
    for (let j = 0; j < upright; j++)
      image.data.set([...colour(L.expected[i * upright + j]), 255], 4 * ((upright - 1 - j) * across + i));
  pen.putImageData(image, 0, 0);
  return canvas.toDataURL();
}

function legend(left, width) {
  const stops = D.colours
    .map((one, i) => `<stop offset="${i / (D.colours.length - 1)}" stop-color="${one}"/>`)
    .join("");
  const labels = [0, 0.25, 0.5, 0.75, 1]
    .map(
      (value) =>
        `<text x="${left + value * width}" y="37" fill="#62707e" ` +
        `text-anchor="${value === 0 ? "start" : value === 1 ? "end" : "middle"}">${value}</text>`,
    )
    .join("");
  return (
    `<defs><linearGradient id="colours">${stops}</linearGradient></defs>` +
    `<text x="${left}" y="11" fill="#2d343c">reward: 0 jammed, 1 nothing lost</text>` +
    `<rect x="${left}" y="16" width="${width}" height="9" fill="url(#colours)"/>${labels}`
  );
}

const placeOf = (i) => {
  const [x, y] = valuesOf(i);
  return [chart.column(x), chart.row(flat ? L.expected[i] : y)];
};

function symbol(one, column, row) {
  if (one.sign === "★") {
    const corners = Array.from({ length: 10 }, (_, k) => [k % 2 ? 4.2 : 10, Math.PI * (k / 5 - 0.5)])
      .map(([size, angle]) => `${far(column + size * Math.cos(angle))},${far(row + size * Math.sin(angle))}`)
      .join(" ");
    return `<polygon class="mark" points="${corners}" fill="${one.colour}" stroke="#2d343c" stroke-width="1.2"/>`;
  }
  return (
    `<g class="mark"><circle cx="${far(column)}" cy="${far(row)}" r="8" fill="${one.colour}" stroke="#fff" stroke-width="1.5"/>` +
    `<text x="${far(column)}" y="${far(row + 4)}" text-anchor="middle" font-size="11" font-weight="700" fill="#fff">${escaped(one.sign)}</text></g>`
  );
}

function drawCursor() {
  const [column, row] = placeOf(index);
  const parts = [];
  const half = [
    (chart.width - chart.left - chart.right) / across / 2,
    flat ? 0 : (chart.height - chart.top - chart.bottom) / upright / 2,
  ];
  const [a, b] = half.map((size) => Math.max(size + 1.5, isMark() ? 12 : 4.5));
  for (const [stroke, width] of [
    ["#2d343c", 4],
    ["#fff", 2],
  ])
    parts.push(
      `<rect x="${far(column - a)}" y="${far(row - b)}" width="${far(2 * a)}" height="${far(2 * b)}" rx="2" fill="none" stroke="${stroke}" stroke-width="${width}"/>`,
    );
  if (!flat) {
    const place = chart.left + clamp(L.expected[index], 0, 1) * (chart.width - chart.left - chart.right);
    parts.push(
      `<rect x="${place - 2.5}" y="13" width="5" height="15" rx="2" fill="#fff" stroke="#2d343c" stroke-width="1.5"/>`,
    );
  }
  $("cursor").innerHTML = parts.join("") + (isMark() ? symbol(mark(), column, row) : ""); // above another that hides it
}

function pick(event) {
  // the launch under the pointer: a mark, or else the nearest cell
  const box = $("map").getBoundingClientRect();
  const scaled = chart.width / box.width;
  const [column, row] = [(event.clientX - box.left) * scaled, (event.clientY - box.top) * scaled];
  if (event.type === "pointerdown") {
    const apart = context().marks.map((_, i) =>
      Math.hypot(...placeOf(cells + i).map((value, k) => value - [column, row][k])),
    );
    const nearest = apart.indexOf(Math.min(...apart));
    if (apart[nearest] < 11) return cells + nearest;
  }
  const share = (column - chart.left) / (chart.width - chart.left - chart.right);
  const up = (chart.height - chart.bottom - row) / (chart.height - chart.top - chart.bottom);
  return cell(Math.floor(share * across), Math.floor(up * upright));
}

const cell = (i, j) => clamp(i, 0, across - 1) * upright + clamp(j, 0, upright - 1);

function move(right, up) {
  // from a mark to the cell that it lies in, and on from there
  const nearest = (control, value) =>
    control.values.reduce(
      (best, one, i) => (Math.abs(one - value) < Math.abs(control.values[best] - value) ? i : best),
      0,
    );
  const [x, y] = valuesOf(index);
  const around = (i, control, count) => (control.turns ? (i + count) % count : i);
  const i = nearest(X, x) + right;
  const j = upright > 1 ? nearest(Y, y) + up : 0;
  select(cell(around(i, X, across), upright > 1 ? around(j, Y, upright) : 0));
}

/* The descent. */
function drawScene() {
  const width = Math.max($("scene").parentElement.clientWidth - 2, 200);
  const heights = width < 450 ? [150, 240] : [220, 400];
  const top = highest();
  scene = new Scene(
    { slope: context().slope, body: D.body, size: D.size },
    [
      [0, top],
      [0.5 * context().slope.length, top],
    ],
    width,
    heights,
  );
  $("scene").setAttribute("viewBox", `0 0 ${width} ${scene.H.toFixed(0)}`);
  $("scene").innerHTML =
    `${scene.sky()}<g id="world">${scene.ground(Math.min(...rangeOfX()), context().slope.length)}` +
    '<g id="trail"></g><g id="live"></g></g>';
}

function rangeOfX() {
  let low = 0;
  let high = 0;
  for (const x of L.x) {
    low = Math.min(low, x);
    high = Math.max(high, x);
  }
  return [low, high];
}

function highest() {
  // that nearly all descents get, but no more than leaves the sled large
  const down = -context().gravity[1];
  const heights = [];
  for (let i = 0; i < L.n; i++) {
    let most = 0;
    for (let k = L.first[i]; k < L.first[i + 1]; k++)
      most = Math.max(most, L.y[k] + (L.v[k] > 0 && !L.touching[k] && down > 0 ? L.v[k] ** 2 / (2 * down) : 0));
    heights.push(most);
  }
  return Math.min(
    heights.sort((a, b) => a - b)[Math.floor(0.98 * (L.n - 1))],
    Math.max(0.25 * context().slope.length, 3 * D.size),
  );
}

function drawTrail() {
  const points = [];
  const poses = [];
  const apart = Math.max(0.9 * D.size, context().slope.length / 12);
  const stand = ({ x, y, phi }) => {
    poses.push({ x, y, drawn: scene.sled(x, y, phi, 'opacity="0.16" class="pose"') });
  };
  for (let k = 0; k < R.t.length; k++) {
    // closely enough for a parabola to look like one
    const last = k + 1 === R.t.length;
    const far = last ? 0 : scene.scale * Math.hypot(R.x[k + 1] - R.x[k], R.v[k] * (R.t[k + 1] - R.t[k]));
    const parts = last ? 1 : clamp(Math.ceil(far / 6), 1, 40);
    for (let i = 0; i < parts; i++) {
      const s = stateAt(R, last ? R.t[k] : R.t[k] + (i / parts) * (R.t[k + 1] - R.t[k]));
      points.push([s.x, s.y]);
      if (poses.every((pose) => Math.hypot(s.x - pose.x, s.y - pose.y) > apart) || last) stand(s);
    }
  }
  $("trail").innerHTML =
    R.contacts.map((c) => `<g class="contact">${scene.contact(c.from, c.to)}</g>`).join("") +
    poses.map((pose) => pose.drawn).join("") +
    scene.path(points);
}

function show(time) {
  t = clamp(time, 0, end());
  const state = stateAt(R, t);
  $("slider").value = end() > 0 ? Math.round((1000 * t) / end()) : 0;
  $("time").textContent = fixed(t, 2, "s");
  $("live").innerHTML = scene.sled(state.x, state.y, state.phi, 'id="sled"');
  $("world").setAttribute("transform", scene.shift(state.x, state.y));
  const contact = R.contacts.findIndex((c) => c.begin <= t && t <= c.end);
  $("trail")
    .querySelectorAll(".contact")
    .forEach((one, i) => one.setAttribute("opacity", R.contacts[i].begin <= t ? 1 : 0.35));
  $("now").textContent =
    `${fixed(state.x, 2, "m")} down the slope, along it ${fixed(state.u, 2, "m/s")}, spin ${fixed(state.omega, 1, "rad/s")}` +
    (t >= end() ? "" : contact >= 0 ? `, contact ${contact + 1}` : ", in flight");
}

const share = (value) => (100 * value).toFixed(1) + " %";

function story() {
  const status = D.statuses[R.status];
  const after = fixed(R.end_time, 2, "s");
  const length = fixed(context().slope.length, 1, "m");
  const met = `${R.rebounds} contact${R.rebounds === 1 ? "" : "s"}`;
  const where = `${fixed(R.end_x, 2, "m")} down the slope of ${length}`;
  const [word, said] = {
    finish: [
      "Finished",
      `after ${after} and ${met}, at ${fixed(R.end_u, 2, "m/s")} along the slope: ${share(R.retention)} of all energy supplied is left in that motion.`,
    ],
    jammed: ["Jammed", `after ${after} and ${met}: it came to rest for good, ${where}.`],
    tumbled: [
      "Tumbled",
      `after ${after} and ${met}, ${where}: the body lay on its chord, or a part of it touched where the descent was to end.`,
    ],
    timeout: ["Out of time", `after ${after} and ${met}, ${where}.`],
  }[status] ?? [status.replace("_", " "), `after ${after} and ${met}, ${where}.`];
  $("story").innerHTML = `<b class="${status}">${escaped(word)}</b> ${escaped(said)}`;
  const best = context().marks[0].expected;
  const mean = D.tremble ? [["mean reward", fixed(R.expected, 3)]] : [];
  $("outcome").innerHTML = entries([
    ["reward", fixed(R.reward, 3)],
    ...mean,
    ["jam index", fixed(1 - R.reward, 3)],
    ["regret", best > 0 ? share(Math.max(1 - R.expected / best, 0)) : "–"],
    ["progress", share(R.progress)],
    ["retention", share(R.retention)],
    ["time", after],
    ["contacts", String(R.rebounds)],
  ]);
}

function select(i, still) {
  index = i;
  R = descentOf(L, i);
  $("launch").textContent =
    (isMark() ? mark().name[0].toUpperCase() + mark().name.slice(1) + ": " : "") +
    D.controls.map((control, k) => named(control, valuesOf(i)[k])).join(", ");
  [...$("marks").children].forEach((button, k) => button.classList.toggle("current", cells + k === i));
  drawCursor();
  drawTrail();
  story();
  show(0);
  if (!still) play();
}

/* Playing. */
function pause() {
  playing = false;
  $("play").textContent = "Play";
}

function play() {
  if (t >= end()) show(0);
  clock = performance.now();
  if (playing) return;
  playing = true;
  $("play").textContent = "Pause";
  requestAnimationFrame(advance);
}

function advance(now) {
  if (!playing) return;
  show(t + ($("speed").value * Math.max(now - clock, 0)) / 1000);
  clock = now;
  if (t >= end()) pause();
  else requestAnimationFrame(advance);
}

const toggle = () => (playing ? pause() : play());
$("play").addEventListener("click", toggle);
$("slider").addEventListener("input", () => {
  pause();
  show(($("slider").value / 1000) * end());
});

/* Contexts. */
let wanted = 0;

async function open(which) {
  pause();
  wanted = (which + D.contexts.length) % D.contexts.length;
  $("context").value = wanted;
  const asked = wanted;
  const launches = await launchesOf(asked);
  if (asked !== wanted || launches === L) return; // another one has been asked for meanwhile
  number = asked;
  L = launches;
  $("setting").textContent = context().setting.replaceAll("-", "−");
  $("marks").innerHTML = context()
    .marks.map(
      (one, i) =>
        `<button type="button" data-index="${cells + i}">` +
        `<i style="background:${one.colour};color:${one.sign === "★" ? "#2d343c" : "#fff"}">${escaped(one.sign)}</i>` +
        `${escaped(one.name)} ${fixed(one.expected, 3)}</button>`,
    )
    .join("");
  draw(cells);
}

function draw(i) {
  drawMap();
  drawScene();
  select(i, true);
}

$("marks").addEventListener("click", (event) => {
  const button = event.target.closest("button");
  if (button) select(+button.dataset.index);
});
$("context").innerHTML = D.contexts
  .map((one, i) => `<option value="${i}">context of seed ${one.seed}</option>`)
  .join("");
$("context").addEventListener("change", () => open(+$("context").value));
$("previous").addEventListener("click", () => open(wanted - 1));
$("next").addEventListener("click", () => open(wanted + 1));
$("pager").hidden = D.contexts.length === 1;

/* Pointer and keys. */
$("map").addEventListener("pointerdown", (event) => {
  if (L === null || event.button !== 0) return;
  $("map").setPointerCapture(event.pointerId);
  select(pick(event));
});
$("map").addEventListener("pointermove", (event) => {
  if (!(event.buttons & 1) || L === null) return;
  const found = pick(event);
  if (
    found !== index &&
    Math.hypot(...placeOf(index).map((value, k) => value - placeOf(found)[k])) > (isMark() ? 11 : 0)
  )
    select(found);
});
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("input, select")) return;
  const far = event.shiftKey ? 5 : 1;
  const page = D.contexts.length > 1 ? { PageDown: 1, PageUp: -1 }[event.key] : undefined;
  if (L === null) return;
  if (event.key === " ") {
    if (event.target.closest("button")) return;
    toggle();
  } else if (event.key === "ArrowRight") move(far, 0);
  else if (event.key === "ArrowLeft") move(-far, 0);
  else if (event.key === "ArrowUp") move(0, far);
  else if (event.key === "ArrowDown") move(0, -far);
  else if (page) open(wanted + page);
  else return;
  event.preventDefault();
});
let width = 0;
window.addEventListener("resize", () => {
  if (L === null || document.body.clientWidth === width) return;
  width = document.body.clientWidth;
  const time = t;
  const going = playing;
  draw(index);
  show(time);
  if (going) play();
});

document.title = $("title").textContent = D.title;
$("question").textContent = D.question;
const [a, b] = [X, Y].map((control) =>
  control && control.values.length > 1 ? control.values[1] - control.values[0] : 0,
);
const apart = (control, value) => `${+value.toPrecision(2)}${control.unit === "°" ? "°" : " " + control.unit}`;
const grid =
  `${flat ? `${across} launches` : `${across} × ${upright} launches`}, ${apart(X, a)}` +
  (flat ? "" : ` and ${apart(Y, b)}`) +
  ` apart, were simulated beforehand; a click plays the nearest of them. Poses are shown to ${D.tolerance}. `;
const slice = D.controls
  .slice(2)
  .map(
    (control) =>
      `All cells have the ${named(control, control.values[0])}, the middle of what may be chosen; marks have their own. `,
  );
const noise = D.tremble
  ? `The launch trembles: the ${flat ? "curve" : "map"} and the regret show the expected reward, the descent is played as it was aimed. `
  : "";
$("about").textContent =
  grid +
  slice.join("") +
  noise +
  "Arrow keys move the launch, with Shift by five; Space plays and pauses. Regret: the share of the best reward that is missing.";
open(0).catch((error) => {
  $("launch").textContent = `This browser cannot unpack the launches: ${error.message}`;
});
