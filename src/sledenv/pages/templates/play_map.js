"use strict";
/* The reward that is expected of every launch of a grid under the launch noise, computed by workers. */
const CELLS = 50; // along each axis
const CHUNK = 40; // launches that a worker is asked for at once
const DRAWS = 64; // of the launch noise
const HALVINGS = 3;
const AXES = D.axes;
const NOISY = ["orientation", "spin"];
const VIRIDIS = ["#440154", "#472d7b", "#3b528b", "#2c728e", "#21918c", "#28ae80", "#5ec962", "#addc30", "#fde725"];
let crew = null; // workers of the map
let map = null;

const errorOf = (name) => (NOISY.includes(name) ? valueOf(`error_${name}`) / PARAMETERS[name].factor : 0); // in the unit that a reader sees

/* Values of an axis, which goes on beyond the bounds as far as the launch noise reaches. */
function axisOf(name) {
  const own = chosen.body < D.own;
  const [low, high] = own ? D.bounds[name] : { orientation: [-180, 180], spin: [-10, 10], speed: [0, 20] }[name];
  const beyond = 3 * errorOf(name);
  const step = (high - low + 2 * beyond) / (CELLS - 1);
  const values = Array.from({ length: CELLS }, (_, i) => low - beyond + i * step);
  return { name, low, high, step, values };
}

/* The map. */
function refreshMap() {
  if (problem() || !$("maps").open) return;
  const setting = sceneOf();
  const axes = AXES.map(axisOf);
  const launch = launchOf();
  const others = LAUNCH.filter((name) => !AXES.includes(name)).map((name) => launch[name]);
  const key = JSON.stringify([setting, others, axes]);
  if (map?.key !== key) {
    const rewards = new Float64Array(CELLS * CELLS).fill(NaN);
    map = { key, scene: setting, launch, axes, rewards, given: new Set(), expected: null, best: null, sought: {} };
  }
  crew.forget("rewards");
  const missing = [...map.rewards.keys()].filter((k) => Number.isNaN(map.rewards[k]) && !map.given.has(k));
  for (let i = 0; i < missing.length; i += CHUNK) askRewards(map, missing.slice(i, i + CHUNK));
  finishMap(map);
}

/* Cells that take too long are asked for one by one, and the one that does stays empty. */
async function askRewards(one, cells) {
  const [x, y] = one.axes;
  const launches = cells.map((k) => ({
    ...one.launch,
    [x.name]: x.values[Math.floor(k / CELLS)] * PARAMETERS[x.name].factor,
    [y.name]: y.values[k % CELLS] * PARAMETERS[y.name].factor,
  }));
  try {
    const found = await crew.ask({ task: "rewards", scene: one.scene, launches }, cells.length > 1 ? 5 : 1);
    cells.forEach((k, i) => (one.rewards[k] = found[i]));
  } catch {
    if (one !== map) return; // nobody waits for these any more
    if (cells.length > 1) for (const k of cells) askRewards(one, [k]);
    else one.given.add(cells[0]);
  }
  if (one === map) finishMap(one);
}

function finishMap(one) {
  const missing = one.rewards.reduce((count, value) => count + Number.isNaN(value), 0);
  one.count = one.rewards.length - missing;
  one.complete = missing === one.given.size;
  if (one.complete) {
    one.expected ??= smoothed(one);
    seekBest(one);
  }
  requestDraw();
}

/* The expected reward where both errors are normal: the mean of the cells around, weighted by the density of the errors. */
function smoothed({ rewards, axes }) {
  const filled = rewards.map((value) => (Number.isNaN(value) ? 0 : value));
  return convolved(convolved(filled, axes[0], CELLS), axes[1], 1);
}

function convolved(values, { name, step }, stride) {
  const spread = errorOf(name) / step; // in cells
  const reach = Math.ceil(4 * spread);
  const weights = Array.from({ length: 2 * reach + 1 }, (_, i) => Math.exp(-0.5 * ((i - reach) / (spread || 1)) ** 2));
  const all = weights.reduce((sum, one) => sum + one);
  return values.map((_, k) => {
    const place = Math.floor(k / stride) % CELLS;
    let sum = 0;
    for (let d = -reach; d <= reach; d++) {
      const other = clamp(place + d, 0, CELLS - 1);
      sum += weights[d + reach] * values[k + (other - place) * stride];
    }
    return sum / all;
  });
}

const within = ({ low, high, step }, value) => value >= low - 1e-9 * step && value <= high + 1e-9 * step;
const placesOf = (k) => [Math.floor(k / CELLS), k % CELLS];
const valuesOf = (one, k) => placesOf(k).map((place, i) => one.axes[i].values[place]);
const stepOf = (name) => (name === "orientation" ? 0.01 : 0.001); // in which a launch is chosen on a map
const noisy = () => NOISY.some((name) => errorOf(name) > 0);

/* The best launch of a map, in the unit that a reader sees: of its highest cell, and then thrice of the launches around it,
   half as far each time. All are tried with the same draws of the launch noise. What an agent does not choose stays as it
   is set. */
async function seekBest(one) {
  const held = AXES.map((name) => (D.free.includes(name) ? null : shownOf(name)));
  const key = String(held);
  if (one.best?.key === key && one.best.refined) return;
  const own = (one.sought = {}); // what was sought before is given up
  let tried = [inside(one, valuesOf(one, highestCell(one, held)), held)];
  const best = (one.best = { key, launch: tried[0], reward: -Infinity, refined: false });
  for (let share = 0.5; share > 0.5 ** (HALVINGS + 2); share /= 2) {
    const rewards = await Promise.all(tried.map((launch) => meanReward(one, launch)));
    if (one !== map || one.sought !== own) return;
    const highest = Math.max(...rewards);
    if (highest > best.reward) Object.assign(best, { launch: tried[rewards.indexOf(highest)], reward: highest });
    tried = around(one, best.launch, held, share);
  }
  best.refined = true;
  requestDraw();
}

function highestCell(one, held) {
  const row = (i) => clamp(Math.round((held[i] - one.axes[i].values[0]) / one.axes[i].step), 0, CELLS - 1);
  const fits = (place, i) => (held[i] === null ? within(one.axes[i], one.axes[i].values[place]) : place === row(i));
  return [...one.expected.keys()]
    .filter((k) => placesOf(k).every(fits))
    .reduce((best, k) => (one.expected[k] > one.expected[best] ? k : best));
}

/* The launches beside one, so many cells away. */
function around(one, launch, held, share) {
  const [across, up] = held.map((value) => (value === null ? [-share, 0, share] : [0]));
  const shifts = across.flatMap((x) => up.map((y) => [x, y]));
  const shifted = shifts.map((shift) => launch.map((value, i) => value + shift[i] * one.axes[i].step));
  return shifted.map((values) => inside(one, values, held));
}

/* Within the bounds, in steps in which one can be chosen. */
function inside({ axes }, launch, held) {
  return launch.map((value, i) => {
    if (held[i] !== null) return held[i];
    const { name, low, high } = axes[i];
    return clamp(rounded(value, stepOf(name)), low, high);
  });
}

/* Of a launch with its noise; nothing is earned where it takes too long. */
async function meanReward(one, values) {
  const launch = { ...one.launch };
  AXES.forEach((name, i) => {
    launch[name] = D.free.includes(name) ? values[i] * PARAMETERS[name].factor : valueOf(name);
  });
  try {
    const rewards = await crew.ask({ task: "rewards", scene: one.scene, launches: noisyOf(launch) }, 5);
    return rewards.reduce((sum, reward) => sum + reward, 0) / rewards.length;
  } catch {
    return 0;
  }
}

/* Pictures of the maps. */
let drawing = false;

function requestDraw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    drawMaps();
  });
}

const shade = (value) => {
  const place = clamp(value, 0, 1) * (VIRIDIS.length - 1);
  const i = Math.min(Math.floor(place), VIRIDIS.length - 2);
  const part = (k, shift) => parseInt(VIRIDIS[k].slice(1 + shift, 3 + shift), 16);
  return [0, 2, 4].map((shift) => Math.round(part(i, shift) + (place - i) * (part(i + 1, shift) - part(i, shift))));
};

function pictureOf(values) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = CELLS;
  const pen = canvas.getContext("2d");
  const image = pen.createImageData(CELLS, CELLS);
  for (let i = 0; i < CELLS; i++)
    for (let j = 0; j < CELLS; j++) {
      const value = values[i * CELLS + j];
      if (!Number.isNaN(value)) image.data.set([...shade(value), 255], 4 * ((CELLS - 1 - j) * CELLS + i));
    }
  pen.putImageData(image, 0, 0);
  return canvas.toDataURL();
}

function chartOf(svg, [x, y]) {
  const width = Math.max(svg.parentElement.clientWidth, 200);
  const [left, right, top, bottom] = [44, 16, 14, 38];
  const height = top + bottom + clamp(0.72 * (width - left - right), 170, 330);
  const [w, h] = [width - left - right, height - top - bottom];
  const column = (value) => left + ((value - x.low) / (x.high - x.low)) * w;
  const row = (value) => top + ((y.high - value) / (y.high - y.low)) * h;
  return { width, height, left, top, w, h, column, row };
}

function drawChart(svg, values) {
  const [x, y] = map.axes;
  const { width, height, left, top, w, h, column, row } = chartOf(svg, map.axes);
  const begin = ({ values: all, step, low }) => (low - all[0]) / step + 0.5;
  const [wide, high] = [x, y].map((axis) => (axis.high - axis.low) / axis.step);
  const parts = [
    `<svg x="${left}" y="${top}" width="${w}" height="${h}" preserveAspectRatio="none" ` +
      `viewBox="${begin(x)} ${CELLS - begin(y) - high} ${wide} ${high}">` +
      `<image href="${pictureOf(values)}" width="${CELLS}" height="${CELLS}" preserveAspectRatio="none"/></svg>`,
    `<rect x="${left}" y="${top}" width="${w}" height="${h}" fill="none" stroke="var(--line)"/>`,
  ];
  for (const value of ticks(x.low, x.high, width < 330 ? 5 : 8, PARAMETERS[x.name].unit))
    parts.push(words(column(value), top + h + 16, brief(value), "var(--pale)"));
  for (const value of ticks(y.low, y.high, 7, ""))
    parts.push(
      `<text x="${left - 6}" y="${far(row(value) + 4)}" text-anchor="end" fill="var(--pale)">${brief(value)}</text>`,
    );
  parts.push(
    words(left + w / 2, height - 5, axisWords(x), "var(--ink)"),
    `<text transform="translate(11 ${top + h / 2}) rotate(-90)" text-anchor="middle" fill="var(--ink)">${axisWords(y)}</text>`,
  );
  if (map.best) {
    const [at, up] = map.best.launch;
    parts.push(`<g class="best" font-size="24" stroke="#2d343c">${words(column(at), row(up) + 8, "★", "#fff")}</g>`);
  }
  for (const one of marksShown()) {
    const [a, b] = AXES.map((name) => placeOfMark(one, name));
    parts.push(
      `<circle class="agent" cx="${far(column(a))}" cy="${far(row(b))}" r="8" fill="${one.colour}" stroke="#fff" stroke-width="1.5"/>` +
        words(column(a), row(b) + 4, one.sign, "#fff"),
    );
  }
  const launch = launchOf();
  const [a, b] = AXES.map((name) => launch[name] / PARAMETERS[name].factor);
  const place = `cx="${far(column(a))}" cy="${far(row(b))}" r="6" fill="none"`;
  if (within(x, a) && within(y, b))
    parts.push(
      `<circle class="cursor" ${place} stroke="#fff" stroke-width="4.5"/><circle ${place} stroke="${HAND}" stroke-width="2.5"/>`,
    );
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.innerHTML = parts.join("");
}

const axisWords = ({ name }) => `${name} at launch [${PARAMETERS[name].unit}]`;

/* Marks are of the context as the page began, whatever launch is chosen. */
function marksShown() {
  const same = Object.keys(chosen.changed).every((name) => ["orientation", "spin", "speed"].includes(name));
  const plain = same && !chosen.profile && chosen.body === here().body;
  return plain ? here().marks : [];
}

/* In the unit that a reader sees; what is not chosen is the context's. */
const placeOfMark = ({ launch }, name) => (launch[name] ?? here().values[name]) / PARAMETERS[name].factor;

let written = "";

function drawMarks() {
  const buttons = marksShown().map(
    ({ name, sign, colour, expected }, i) =>
      `<button type="button" data-mark="${i}"><i style="background:${colour}">${escaped(sign)}</i>` +
      `${escaped(name)} ${fixed(expected, 3)}</button>`,
  );
  if (buttons.join("") === written) return; // a button that someone presses stays the same
  $("marks").innerHTML = written = buttons.join("");
}

function drawMaps() {
  if (!map) return;
  drawMarks();
  drawChart($("map"), map.expected ?? map.rewards);
  $("best").disabled = !map.best?.refined;
  $("map-words").textContent = mapWords();
}

function mapWords() {
  if (!map.best) return `${map.count} of ${CELLS * CELLS} launches simulated`;
  if (!map.best.refined) return "Best of this map, white star: being refined";
  const { launch, reward } = map.best;
  const words = AXES.map((name, i) => `${name} ${fixed(launch[i], 2, PARAMETERS[name].unit)}`).join(", ");
  const given = map.given.size ? `; ${map.given.size} took too long, and count as 0` : "";
  const how = noisy() ? `mean reward ${fixed(reward, 3)} of ${DRAWS} noisy launches` : `reward ${fixed(reward, 3)}`;
  return `Best of this map, white star: ${words}, ${how}${given}.`;
}

/* A launch chosen on a map. */
function choose(values, names = AXES) {
  AXES.forEach((name, i) => {
    const { low, high } = PARAMETERS[name];
    if (names.includes(name)) chosen.changed[name] = clamp(rounded(values[i], stepOf(name)), low, high);
  });
  changed();
}

function onMark({ target }) {
  const i = target.closest("[data-mark]")?.dataset.mark;
  if (i === undefined) return;
  for (const name of Object.keys(here().marks[i].launch)) chosen.changed[name] = placeOfMark(here().marks[i], name);
  changed();
}

function pick(event) {
  const svg = event.currentTarget;
  if (!map || (event.type === "pointermove" && !(event.buttons & 1))) return;
  const box = svg.getBoundingClientRect();
  const { width, left, top, w, h } = chartOf(svg, map.axes);
  const scaled = width / box.width;
  const across = clamp(((event.clientX - box.left) * scaled - left) / w, 0, 1);
  const up = 1 - clamp(((event.clientY - box.top) * scaled - top) / h, 0, 1);
  const [x, y] = map.axes;
  choose([x.low + across * (x.high - x.low), y.low + up * (y.high - y.low)]);
}

$("map").addEventListener("pointerdown", pick);
$("map").addEventListener("pointermove", pick);
$("maps").addEventListener("toggle", () => {
  if (shown) refreshMap();
});
$("marks").addEventListener("click", onMark);
$("best").addEventListener("click", () => choose(map.best.launch, D.free));
$("scale").style.background = `linear-gradient(90deg, ${VIRIDIS})`;

/* Draws of the launch noise, the same each time. */
const NORMAL = Array.from({ length: DRAWS }, (_, k) => {
  // Box and Muller, of points that fill the square evenly: multiples of the plastic number's powers
  const [a, b] = [0.7548776662466927, 0.5698402909980532].map((rate) => (0.5 + rate * (k + 1)) % 1);
  const size = Math.sqrt(-2 * Math.log(1 - a));
  return [size * Math.cos(2 * Math.PI * b), size * Math.sin(2 * Math.PI * b)];
});

/* A launch with each of these errors; itself, if there is no launch noise. */
function noisyOf(launch) {
  if (!noisy()) return [launch];
  return NORMAL.map(([one, other]) => ({
    ...launch,
    orientation: launch.orientation + one * valueOf("error_orientation"),
    spin: launch.spin + other * valueOf("error_spin"),
  }));
}
