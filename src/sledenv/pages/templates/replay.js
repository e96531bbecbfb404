"use strict";
const D = JSON.parse($("data").textContent);
const R = D.rows;
const last = R.t.length - 1;
const FPS = 60;

/* Numbers and words. */
function quantity(value, unit) {
  for (const [factor, prefix] of [
    [1e9, "G"],
    [1e6, "M"],
    [1e3, "k"],
  ])
    if (Math.abs(value) >= factor) return (value / factor).toPrecision(3).replace("-", "−") + " " + prefix + unit;
  return value.toPrecision(3).replace("-", "−") + " " + unit;
}

/* Interpolation. */
function interpolate(from, to, value) {
  const i = before(from, value);
  const j = Math.min(i + 1, from.length - 1);
  const step = from[j] - from[i];
  return step > 0 ? to[i] + clamp((value - from[i]) / step, 0, 1) * (to[j] - to[i]) : to[i];
}

function contactAt(t) {
  let i = -1;
  while (i + 1 < D.contacts.length && D.contacts[i + 1].begin <= t) i++;
  return i >= 0 && t <= D.contacts[i].end ? i : -1;
}

function pushAt(i, t) {
  const c = D.contacts[i];
  if (c.end === c.begin) return { ...c, largest: c.normal, unit: "N s" };
  const row = before(R.t, t);
  const push = { largest: c.largest, unit: "N", friction: R.friction[row] };
  push.feature = R.feature[row] ? D.parts[R.feature[row] - 1] : c.feature;
  for (const name of ["tangential", "normal", "place"]) push[name] = interpolate(R.t, R[name], t);
  push.words = R.feature[row] ? D.motions[(R.slip[row] !== 0 ? 2 : 0) + (R.spin[row] !== 0 ? 1 : 0)] : "";
  return push;
}

/* The scene. */
const seen = [];
for (let i = 0; i <= last; i++) seen.push([R.x[i], R.y[i]], [R.x[i], 0]);
if (D.ghost !== null) for (const [x, y] of D.ghost.poses.slice(0, D.ghost.used)) seen.push([x, y]);
const wide = clamp($("controls").clientWidth, 300, 1160); // as on the screen, or a phone shows letters that none can read
const scene = new Scene(D, seen, wide, wide < 450 ? [170, 260] : [300, 500]);
const { H } = scene;

function landscape() {
  let left = Infinity;
  let right = -Infinity;
  for (const x of R.x) {
    left = Math.min(left, x);
    right = Math.max(right, x);
  }
  return (
    scene.ground(left, right) +
    D.contacts.map((c) => scene.contact(c.from, c.to)).join("") +
    D.strobe.map(([x, y, phi]) => scene.sled(x, y, phi, 'opacity="0.16" class="pose"')).join("") +
    scene.path(R.x.map((x, i) => [x, R.y[i]]))
  );
}

/* A recorded motion: the outline of its last frame, and where its mass centre was in each. */
const G = D.ghost;
const recorded = (i) => (i < G.used ? "#0b6b50" : "#8d98a3");
const ghostPath = () =>
  G === null
    ? ""
    : G.poses
        .map(([x, y], i) => {
          const [column, row] = scene.pixel(x, y);
          return `<circle cx="${far(column)}" cy="${far(row)}" r="1.5" fill="${recorded(i)}"/>`;
        })
        .join("");

function ghostAt(t) {
  if (G === null) return "";
  const i = before(G.times, t + 1e-9);
  const [x, y, phi] = G.poses[i];
  return (
    `<g id="ghost" fill="none" stroke="${recorded(i)}" stroke-width="1.8" stroke-dasharray="5 3">` +
    `<polygon points="${scene.outline(D.body.outline, x, y, phi)}"/><polygon points="${scene.outline(D.body.heavy, x, y, phi)}"/></g>`
  );
}

$("scene").setAttribute("viewBox", `0 0 ${scene.W} ${H.toFixed(0)}`);
$("scene").innerHTML = `${scene.sky()}<g id="world">${landscape()}${ghostPath()}<g id="live"></g></g>`;

function drawScene(state, push, t) {
  const { cone, force } = push ? scene.push(push) : { cone: "", force: "" };
  $("live").innerHTML = cone + scene.sled(state.x, state.y, state.phi, 'id="sled"', push?.feature) + ghostAt(t) + force;
  $("world").setAttribute("transform", scene.shift(state.x, state.y));
}

/* Plots: one class of axes for all of them. */
class Axes {
  constructor(parent, width, height, { left = 58, bottom = 6, label, range, unitTime = 1, origin = 0 }) {
    Object.assign(this, { width, height, left, right: 10, top: 22, bottom, label, unitTime, origin });
    parent.insertAdjacentHTML("beforeend", `<svg class="plot" viewBox="0 0 ${width} ${height}"></svg>`);
    this.svg = parent.lastElementChild;
    [this.low, this.high] = range;
    if (!(this.high > this.low)) {
      this.low -= 1;
      this.high += 1;
    }
  }

  window(begin, end) {
    this.begin = begin;
    this.end = end > begin ? end : begin + 1e-3;
    return this;
  }

  column(t) {
    return this.left + ((t - this.begin) / (this.end - this.begin)) * (this.width - this.left - this.right);
  }

  row(v) {
    return (
      this.height - this.bottom - ((v - this.low) / (this.high - this.low)) * (this.height - this.top - this.bottom)
    );
  }

  points(times, values) {
    return times.map((t, i) => `${far(this.column(t))},${far(this.row(values[i]))}`).join(" ");
  }

  static ticks(low, high, n) {
    const least = (high - low) / n;
    const power = 10 ** Math.floor(Math.log10(least));
    const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= least * 0.999);
    const found = [];
    for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++)
      found.push(+(i * step).toPrecision(12));
    return found;
  }

  frame(timeLabel) {
    const parts = [];
    const edge = this.width - this.right;
    for (const v of Axes.ticks(this.low, this.high, this.height > 110 ? 5 : 3))
      parts.push(
        `<line x1="${this.left}" x2="${edge}" y1="${this.row(v)}" y2="${this.row(v)}" stroke="${v === 0 ? "#98a5b2" : "#e8edf1"}"/>`,
        `<text x="${this.left - 6}" y="${this.row(v) + 4}" text-anchor="end" fill="#62707e">${axisNumber(v)}</text>`,
      );
    if (timeLabel) {
      for (const t of Axes.ticks(
        (this.begin - this.origin) * this.unitTime,
        (this.end - this.origin) * this.unitTime,
        6,
      )) {
        const column = this.column(this.origin + t / this.unitTime);
        parts.push(
          `<line x1="${column}" x2="${column}" y1="${this.height - this.bottom}" y2="${this.height - this.bottom + 4}" stroke="#98a5b2"/>`,
          `<text x="${column}" y="${this.height - this.bottom + 17}" text-anchor="middle" fill="#62707e">${axisNumber(t)}</text>`,
        );
      }
      parts.push(`<text x="${edge}" y="${this.height - 3}" text-anchor="end" fill="#62707e">${timeLabel}</text>`);
    }
    parts.push(`<text x="${this.left}" y="14" fill="#2d343c">${this.label}</text>`);
    return parts.join("");
  }

  cursor(t) {
    const line = this.svg.querySelector(".cursor");
    const column = this.column(clamp(t, this.begin, this.end)).toFixed(2);
    line.setAttribute("x1", column);
    line.setAttribute("x2", column);
  }

  cursorLine() {
    return `<line class="cursor" y1="${this.top}" y2="${this.height - this.bottom}" stroke="#a01e6e" stroke-width="1.5"/>`;
  }

  seek(handler) {
    const go = (event) => {
      const place = this.svg.getBoundingClientRect();
      const column = ((event.clientX - place.left) / place.width) * this.width;
      const share = (column - this.left) / (this.width - this.left - this.right);
      handler(this.begin + clamp(share, 0, 1) * (this.end - this.begin));
    };
    this.svg.addEventListener("pointerdown", (event) => {
      this.svg.setPointerCapture(event.pointerId);
      go(event);
    });
    this.svg.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) go(event);
    });
    return this;
  }
}

const axisNumber = (value) =>
  (Math.abs(value) >= 1e4 ? (value / 1e3).toPrecision(3) / 1 + "k" : String(+value.toPrecision(6))).replace("-", "−");

function extent(...lists) {
  let low = 0;
  let top = 0;
  for (const list of lists)
    for (const value of list) {
      low = Math.min(low, value);
      top = Math.max(top, value);
    }
  const room = 0.06 * (top - low);
  return [low < 0 ? low - room : 0, top + room];
}

const end = D.film.time[D.film.time.length - 1];
const plots = [];

function shading(axes) {
  return D.contacts
    .map(
      (c) =>
        `<rect x="${far(axes.column(c.begin))}" y="${axes.top}" height="${axes.height - axes.top - axes.bottom}" ` +
        `width="${far(Math.max(axes.column(c.end) - axes.column(c.begin), 1))}" fill="#e4eaf0"/>`,
    )
    .join("");
}

const plotted = clamp($("series").clientWidth, 300, 760);
for (const [name, label] of [
  ["u", "u [m/s] along the slope"],
  ["v", "v [m/s] normal to it"],
  ["omega", "ω [rad/s] spin"],
]) {
  const axes = new Axes($("series"), plotted, 104, { label, range: extent(R[name]) }).window(0, end);
  axes.svg.innerHTML =
    shading(axes) +
    axes.frame() +
    `<polyline points="${axes.points(R.t, R[name])}" fill="none" stroke="#0072b2" stroke-width="1.6"/>` +
    axes.cursorLine();
  plots.push(axes.seek(goTo));
}

function around(values) {
  // a few wrong poses must not hide the others
  const sizes = values.map(Math.abs).sort((a, b) => a - b);
  const size = 1.6 * sizes[Math.floor(0.95 * (sizes.length - 1))] || 1;
  return [-size, size];
}

for (const [label, columns, unit] of G === null
  ? []
  : [
      [
        "recorded − simulated [mm]: x blue, y orange",
        [
          [0, "#0072b2"],
          [1, "#d55e00"],
        ],
        1e3,
      ],
      ["recorded − simulated [°]: orientation", [[2, "#0072b2"]], 180 / Math.PI],
    ]) {
  const lists = columns.map(([k]) => G.residuals.slice(0, G.used).map((row) => unit * row[k]));
  const axes = new Axes($("series"), plotted, 120, { label, range: around(lists.flat()) }).window(0, end);
  const dots = columns
    .map(([k, colour]) =>
      G.times
        .filter((t) => t <= end)
        .map((t, i) => {
          const value = clamp(unit * G.residuals[i][k], axes.low, axes.high);
          return `<circle cx="${far(axes.column(t))}" cy="${far(axes.row(value))}" r="1.4" fill="${i < G.used ? colour : "#c3ccd5"}"/>`;
        })
        .join(""),
    )
    .join("");
  axes.svg.innerHTML =
    shading(axes) +
    axes.frame() +
    `<line x1="${axes.left}" x2="${axes.width - axes.right}" ` +
    `y1="${axes.row(0)}" y2="${axes.row(0)}" stroke="#98a5b2"/>` +
    dots +
    axes.cursorLine();
  plots.push(axes.seek(goTo));
}

const names = Object.keys(D.energy);
const colours = ["#0072b2", "#56b4e9", "#bfc8d2", "#009e73", "#d55e00", "#e69f00", "#cc79a7", "#333333"];
const sums = names.map(() => Array.from({ length: last + 1 }));
for (let i = 0; i <= last; i++) names.reduce((sum, name, k) => (sums[k][i] = sum + D.energy[name][i]), 0);
const energies = new Axes($("series"), plotted, 224, {
  label: "energy [J]",
  range: extent(sums[sums.length - 1]),
  bottom: 34,
}).window(0, end);
energies.svg.innerHTML =
  names
    .map((_, k) => {
      const below = k ? sums[k - 1] : sums[0].map(() => 0);
      return `<polygon points="${energies.points(R.t, sums[k])} ${energies.points([...R.t].reverse(), [...below].reverse())}" fill="${colours[k]}"/>`;
    })
    .join("") +
  energies.frame("time [s]") +
  energies.cursorLine();
plots.push(energies.seek(goTo));
$("layers").innerHTML = names
  .map((name, k) => `<span><i style="background:${colours[k]}"></i>${escaped(name)}</span>`)
  .join("");

/* The close-up: forces of one contact, the friction force within the band that friction allows. */
let shownContact = -2;
let closeup = null;

function drawCloseup(i) {
  if (i === shownContact) return;
  shownContact = i;
  closeup = null;
  $("closeup").innerHTML = "";
  if (i < 0) return;
  const c = D.contacts[i];
  const first = before(R.t, c.begin);
  if (c.end === c.begin) {
    $("closeup").innerHTML =
      '<p class="hint">An impact of rigid surfaces has no duration: there is an impulse, but no force over time.</p>';
    return;
  }
  const times = [];
  const normal = [];
  const tangential = [];
  const up = [];
  for (let k = first; k <= last && R.t[k] <= c.end; k++)
    if (R.t[k] >= c.begin && R.feature[k]) {
      times.push(R.t[k]);
      normal.push(R.normal[k]);
      tangential.push(R.tangential[k]);
      up.push(R.friction[k] * R.normal[k]);
    }
  const down = up.map((value) => -value);
  const brief = c.end - c.begin < 0.5;
  const unitTime = brief ? 1e3 : 1;
  const time = brief ? "ms since touchdown" : "s since touchdown";
  const panel = (height, bottom, label, values, range, band) => {
    const axes = new Axes($("closeup"), 380, height, { label, range, bottom, unitTime, origin: c.begin }).window(
      c.begin,
      c.end,
    );
    axes.svg.innerHTML =
      (band
        ? `<polygon points="${axes.points(times, up)} ${axes.points([...times].reverse(), [...down].reverse())}" fill="#f8ee8c"/>`
        : "") +
      axes.frame(bottom > 10 ? time : "") +
      `<polyline points="${axes.points(times, values)}" fill="none" stroke="${band ? "#d55e00" : "#0072b2"}" stroke-width="1.8"/>` +
      axes.cursorLine();
    return axes.seek(goTo);
  };
  closeup = [
    panel(134, 6, "N [N] normal force", normal, extent(normal), false),
    panel(164, 34, "F [N] friction force, yellow: ± f N", tangential, extent(tangential, up, down), true),
  ];
}

/* The table. */
$("rebounds").tHead.innerHTML = "<tr>" + D.table.columns.map((name) => `<th>${escaped(name)}</th>`).join("") + "</tr>";
$("rebounds").tBodies[0].innerHTML =
  D.table.rows
    .map(
      (cells) =>
        "<tr>" +
        cells
          .map(
            (cell) =>
              `<td>${escaped(cell.replace(/ *-> */, " → ").replaceAll("-", cell.match(/[a-z]/) ? "-" : "−"))}</td>`,
          )
          .join("") +
        "</tr>",
    )
    .join("") || `<tr><td colspan="${D.table.columns.length}" style="text-align:left">no rebounds</td></tr>`;
if (D.contacts.length)
  [...$("rebounds").tBodies[0].rows].forEach((row, i) => row.addEventListener("click", () => goToContact(i)));

/* Where we are: a position in the film. */
const film = D.film.film;
const length = film[film.length - 1];
let position = 0;
let playing = false;
let clock = 0;

function show(where, fromSlider) {
  position = clamp(where, 0, length);
  const t = interpolate(film, D.film.time, position);
  const state = stateAt(R, t);
  const i = contactAt(t);
  const push = i >= 0 ? pushAt(i, t) : null;
  if (!fromSlider) $("slider").value = Math.round(position * FPS);
  $("time").textContent = fixed(t, 4, "s");
  drawScene(state, push, t);
  plots.forEach((axes) => axes.cursor(t));
  $("now").innerHTML = entries([
    ["position", fixed(state.x, 3, "m")],
    ["along, u", fixed(state.u, 3, "m/s")],
    ["normal, v", fixed(state.v, 3, "m/s")],
    ["orientation", fixed((state.phi * 180) / Math.PI, 1, "°")],
    ["spin, ω", fixed(state.omega, 2, "rad/s")],
    ["speed", fixed(Math.hypot(state.u, state.v), 3, "m/s")],
  ]);
  let said = "in flight";
  if (push) {
    const c = D.contacts[i];
    const most = push.friction * push.normal;
    said =
      `contact ${i + 1}, ${push.feature}: ${c.mode}\n${push.words ? push.words + "; " : ""}` +
      `${push.unit === "N" ? "force" : "impulse"} ${quantity(push.normal, push.unit)}${most > 0 ? `, grip ${(Math.abs(push.tangential) / most).toFixed(2)}` : ""}`;
  } else if (t >= end) said = `the end: ${D.status}`;
  $("contact").textContent = said;
  const begun = D.contacts.filter((c) => c.begin <= t).length - 1;
  drawCloseup(begun);
  if (closeup) closeup.forEach((axes) => axes.cursor(t));
  [...$("rebounds").tBodies[0].rows].forEach((row, k) =>
    row.classList.toggle("current", k === begun && D.contacts.length > 0),
  );
}

function pause() {
  playing = false;
  $("play").textContent = "Play";
}

function goTo(t) {
  pause();
  show(interpolate(D.film.time, film, t));
}

function goToContact(i) {
  pause();
  const k = 2 * i + 1;
  show(film[k] + 0.45 * (film[k + 1] - film[k]));
}

function tick(now) {
  if (!playing) return;
  show(position + ($("speed").value * Math.max(now - clock, 0)) / 1000);
  clock = now;
  if (position >= length) pause();
  else requestAnimationFrame(tick);
}

function toggle() {
  if (playing) {
    pause();
    return;
  }
  if (position >= length) show(0);
  playing = true;
  $("play").textContent = "Pause";
  clock = performance.now();
  requestAnimationFrame(tick);
}

function jump(direction) {
  const held = D.contacts.map((_, i) => film[2 * i + 1] + 0.45 * (film[2 * i + 2] - film[2 * i + 1]));
  const found =
    direction > 0
      ? held.findIndex((where) => where > position + 1e-6)
      : held.findLastIndex((where) => where < position - 1e-6);
  if (found >= 0) goToContact(found);
  else {
    pause();
    show(direction > 0 ? length : 0);
  }
}

$("slider").max = Math.ceil(length * FPS);
$("slider").addEventListener("input", () => {
  pause();
  show($("slider").value / FPS, true);
});
$("play").addEventListener("click", toggle);
$("previous").addEventListener("click", () => jump(-1));
$("next").addEventListener("click", () => jump(1));
document.addEventListener("keydown", (event) => {
  if (event.target.closest("input, select, button")) {
    if (event.key !== " " || event.target.id !== "slider") return;
  }
  if (event.key === " ") toggle();
  else if (event.key === "ArrowRight") {
    pause();
    show(position + 1 / FPS);
  } else if (event.key === "ArrowLeft") {
    pause();
    show(position - 1 / FPS);
  } else return;
  event.preventDefault();
});
document.title = $("title").textContent = D.title;
$("setting").textContent = D.setting;
if (G !== null)
  $("recorded").textContent =
    "Recorded: dashed outline, at its last frame; dots, its mass centre in each; green, " +
    "as far as the simulated motion was fitted to it; grey, beyond.";
$("outcome").innerHTML = entries(D.outcome);
show(0);
