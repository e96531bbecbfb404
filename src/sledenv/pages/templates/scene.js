"use strict";
const $ = (id) => document.getElementById(id);
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

/* Numbers and words. */
const SPECIAL = new Map(Object.entries({ Infinity, "-Infinity": -Infinity, NaN }));
const parsed = (text) => JSON.parse(text, (_, value) => SPECIAL.get(value) ?? value); // numbers with all digits
const fixed = (value, digits, unit) =>
  value === null || Number.isNaN(value)
    ? "–"
    : (Math.abs(value) < 1e5
        ? (Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value).toFixed(digits)
        : value.toExponential(2)
      ).replace("-", "−") + (unit ? " " + unit : "");
const escaped = (text) => String(text).replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);
const entries = (pairs) =>
  pairs.map(([name, value]) => `<div><dt>${escaped(name)}</dt><dd>${escaped(value)}</dd></div>`).join("");
const words = (column, row, text, colour) =>
  `<text x="${far(column)}" y="${far(row)}" text-anchor="middle" fill="${colour}">${escaped(text)}</text>`;
const far = (value) => clamp(value, -1e7, 1e7).toFixed(2);

/* Places of the ticks of an axis, at most so many. */
function ticks(low, high, most, unit) {
  const power = 10 ** Math.floor(Math.log10((high - low) / most));
  const known =
    unit === "°" && high - low > 60 ? [15, 30, 45, 90, 180, 360] : [1, 2, 5, 10].map((factor) => factor * power);
  const step = known.find((candidate) => (high - low) / candidate <= most) ?? high - low;
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++)
    found.push(+(i * step).toPrecision(12));
  return found;
}

const bounds = (values) =>
  values.reduce(([low, high], one) => [Math.min(low, one), Math.max(high, one)], [Infinity, -Infinity]);

/* Interpolation. */
function before(values, value) {
  // index of the last entry <= value, at least 0
  let low = 0;
  let high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return Math.max(low - 1, 0);
}

function stateAt(rows, t) {
  // positions follow the recorded velocities, which is exact in flight
  const last = rows.t.length - 1;
  const i = Math.min(before(rows.t, t), Math.max(last - 1, 0));
  const j = Math.min(i + 1, last);
  const step = rows.t[j] - rows.t[i];
  const s = step > 0 ? clamp((t - rows.t[i]) / step, 0, 1) : 0;
  const state = {};
  for (const [name, rate] of [
    ["x", "u"],
    ["y", "v"],
    ["phi", "omega"],
  ]) {
    const bend = step * s * (1 - s) * ((1 - s) * rows[rate][i] - s * rows[rate][j]);
    state[name] = rows[name][i] + s * s * (3 - 2 * s) * (rows[name][j] - rows[name][i]) + bend;
    state[rate] = rows[rate][i] + s * (rows[rate][j] - rows[rate][i]);
  }
  return state;
}

function between(from, to, value) {
  const i = before(from, value);
  const j = Math.min(i + 1, from.length - 1);
  const step = from[j] - from[i];
  return step > 0 ? to[i] + clamp((value - from[i]) / step, 0, 1) * (to[j] - to[i]) : to[i];
}

/* The line of the ground { x, y } [m], level before its first point and behind its last: of the pieces that the kernel
   lays, bends in chords that are so short that a body of some size [m] does not show how far off they are. */
const FINE = 1e-3; // of the size

function lineOf(pieces, size) {
  const line = { x: [], y: [] };
  for (let k = 1; k < pieces.x.length; k++) {
    const [begin, end, radius] = [pieces.tilt[k - 1], pieces.tilt[k], pieces.radius[k]];
    const chords = Math.ceil(Math.abs(end - begin) * Math.sqrt(radius / (8 * FINE * size)));
    for (let i = 0; i <= chords; i++) {
      const tilt = begin + (chords ? i / chords : 0) * (end - begin);
      line.x.push(pieces.qx[k] - pieces.bend[k] * radius * Math.sin(tilt));
      line.y.push(pieces.qy[k] + pieces.bend[k] * radius * Math.cos(tilt));
    }
  }
  return line;
}

/* Height [m] of a line over the plane of the slope, and its points between two places. */
const heightOn = ({ x, y }, place) => (x.length ? between(x, y, place) : 0);

const pointsBetween = (line, left, right) => [
  [left, heightOn(line, left)],
  ...line.x.map((x, i) => [x, line.y[i]]).filter(([x]) => x > left && x < right),
  [right, heightOn(line, right)],
];

/* The slope, descending to the right, and the body: slope-frame points [m] to pixels. */
class Scene {
  /* slope: with the line of its ground; body: as pages/scenes.py draws it; points: of the slope frame, to be in sight;
     close: pixels per metre with which the body is followed, 0 if never, undefined where it would be too small to see. */
  constructor({ slope, body, size, close }, points, width, [lowest, highest]) {
    Object.assign(this, { slope, body, size, W: width, cosine: Math.cos(slope.angle), sine: Math.sin(slope.angle) });
    [this.first, this.last] = bounds([0, slope.length ?? 0, ...points.map(([x]) => x)]); // surely in sight
    const ground = pointsBetween(slope.line, this.first, this.last);
    const seen = [...points, ...ground, ...ground.map(([x, y]) => [x, y + 2 * size])].map((one) => this.world(...one));
    const [[left, right], [bottom, top]] = [0, 1].map((k) => bounds(seen.map((one) => one[k])));
    const margin = Math.max(1.3 * size, 0.03 * (right - left));
    const [wide, high] = [right - left + 2 * margin, top - bottom + 2 * margin];
    this.scale = Math.min(width / wide, highest / high, 90 / size);
    this.follow = close === undefined ? this.scale * size < 10 : close > 0;
    if (this.follow) this.scale = close ?? 45 / size;
    this.H = this.follow ? highest : clamp(high * this.scale + 24, lowest, highest); // 24: words below the slope
    this.middle = [0.5 * (left + right), 0.5 * (bottom + top)];
  }

  world(x, y) {
    return [x * this.cosine + y * this.sine, y * this.cosine - x * this.sine];
  }

  pixel(x, y) {
    const [column, row] = this.world(x, y);
    return [this.W / 2 + this.scale * (column - this.middle[0]), this.H / 2 - this.scale * (row - this.middle[1])];
  }

  /* Where in the slope frame a pixel is: the inverse of pixel. */
  place(column, row) {
    const across = (column - this.W / 2) / this.scale + this.middle[0];
    const up = this.middle[1] - (row - this.H / 2) / this.scale;
    return [across * this.cosine - up * this.sine, across * this.sine + up * this.cosine];
  }

  height(x) {
    return heightOn(this.slope.line, x);
  }

  /* The surface between two places, so far below it. */
  surface(left, right, depth = 0) {
    return pointsBetween(this.slope.line, left, right).map(([x, y]) => this.at(x, y - depth));
  }

  at(x, y) {
    return this.pixel(x, y).map(far).join(",");
  }

  outline(shape, { x, y, phi }) {
    const c = Math.cos(phi);
    const s = Math.sin(phi);
    return shape.map(([a, b]) => this.at(x + a * c - b * s, y + a * s + b * c)).join(" ");
  }

  /* What puts something drawn at the origin to another place. */
  moved({ x, y, phi }) {
    const [from, to] = [this.pixel(0, 0), this.pixel(x, y)];
    const back = from.map((one) => far(-one));
    return `translate(${to.map(far)}) rotate(${((-phi * 180) / Math.PI).toFixed(3)}) translate(${back})`;
  }

  /* The body in a pose; parts that touch are marked. */
  sled(pose, attributes, touching = []) {
    const { outline, hull, touched, pieces } = this.body;
    const layers = [{ colour: hull, points: outline }, ...pieces].map(
      ({ part = "", colour, points }) =>
        `<polygon data-part="${escaped(part)}" points="${this.outline(points, pose)}" ` +
        `fill="${touching.includes(part) ? touched : colour}" stroke="#2d343c" stroke-width="0.7" stroke-linejoin="round"/>`,
    );
    const [column, row] = this.pixel(pose.x, pose.y).map(far);
    return `<g ${attributes}>${layers.join("")}<circle cx="${column}" cy="${row}" r="2.5" fill="#2d343c"/></g>`;
  }

  sky() {
    return `<rect width="${this.W}" height="${this.H.toFixed(0)}" fill="var(--sky)"/>`;
  }

  /* The land, with the finish, where a body is between these places [m]. */
  ground(left, right) {
    const { slope, scale, W } = this;
    const reach = (2 * (W + this.H)) / scale;
    [left, right] = [Math.min(left, 0) - reach, Math.max(right, this.follow ? 0 : (slope.length ?? 0)) + reach];
    const surface = this.surface(left, right).join(" ");
    const parts = [
      `<polygon points="${surface} ${this.at(right, -reach)} ${this.at(left, -reach)}" fill="var(--ground)"/>`,
      ...this.zones(left, right),
    ];
    const most = Math.min(((right - left) * scale) / 70, 2000);
    const [, step] = ticks(0, right - left, most, "");
    for (let x = Math.ceil(left / step) * step; x < right; x += step) {
      const [column, row] = this.pixel(x, this.height(x));
      parts.push(
        `<line x1="${far(column)}" x2="${far(column)}" y1="${far(row)}" y2="${far(row + 6)}" stroke="var(--line)"/>`,
      );
      if (this.follow || (column > 24 && column < W - 24))
        parts.push(words(column, row + 24, `${+x.toPrecision(6)} m`, "var(--pale)"));
    }
    parts.push(`<polyline class="surface" points="${surface}" fill="none" stroke="var(--line)" stroke-width="2"/>`);
    if (slope.length !== null) {
      const foot = this.height(slope.length);
      const room = this.follow ? Infinity : (this.pixel(slope.length, foot)[1] - 24) / scale;
      const top = foot + Math.min(4 * this.size, room);
      const [column, row] = this.pixel(slope.length, top);
      parts.push(
        `<polyline points="${this.at(slope.length, foot)} ${this.at(slope.length, top)}" stroke="var(--ink)" ` +
          `stroke-width="4" stroke-dasharray="12 9"/>`,
        words(this.follow ? column : Math.min(column, W - 20), row - 7, "finish", "var(--pale)"),
      );
    }
    return parts.join("");
  }

  /* Bands below the surface, each with its words where there is room. */
  zones(left, right) {
    return (this.slope.zones ?? []).flatMap((zone) => {
      const [begin, end] = [Math.max(zone.begin, left), Math.min(zone.end ?? Infinity, right)];
      if (!(begin < end)) return [];
      const points = [...this.surface(begin, end), ...this.surface(begin, end, 12 / this.scale).reverse()];
      const last = Math.max(begin, this.follow ? begin : Math.min(end, this.last));
      const middle = 0.5 * (begin + last);
      const [column, row] = this.pixel(middle, this.height(middle));
      const room = this.follow || 7 * zone.words.length < (last - begin) * this.scale;
      return [
        `<polygon class="zone" points="${points.join(" ")}" fill="${zone.colour}" stroke="var(--line)"/>`,
        ...(room ? [words(column, row + 48, zone.words, "var(--ink)")] : []),
      ];
    });
  }

  /* Where a rebound touched first. */
  contact(x) {
    const [column, row] = this.pixel(x, this.height(x));
    const corners = [
      [column, row],
      [column - 5, row + 9],
      [column + 5, row + 9],
    ].map((one) => one.map(far));
    return `<polygon class="contact" points="${corners.join(" ")}" fill="#009e73"/>`;
  }

  /* Between two pixels. */
  arrow(foot, tip, attributes) {
    const [dx, dy] = [tip[0] - foot[0], tip[1] - foot[1]];
    const size = Math.hypot(dx, dy);
    if (!(size > 0)) return "";
    const head = Math.min(12, size);
    const [ax, ay] = [(dx / size) * head, (dy / size) * head];
    return (
      `<polyline ${attributes} points="${foot.map(far)} ${far(tip[0] - 0.6 * ax)},${far(tip[1] - 0.6 * ay)}" ` +
      `stroke-width="3.2"/><polygon ${attributes} points="${tip.map(far)} ` +
      `${far(tip[0] - ax - 0.42 * ay)},${far(tip[1] - ay + 0.42 * ax)} ` +
      `${far(tip[0] - ax + 0.42 * ay)},${far(tip[1] - ay - 0.42 * ax)}"/>`
    );
  }

  /* What contacts do to the body: the friction cones, which lie below it, and what lies above it. */
  push({ touches, largest }) {
    const length = (0.3 * this.H) / this.scale;
    const found = { cone: "", force: "" };
    for (const { x, y, normal_x, normal_y, friction, normal, tangential } of touches) {
      const place = (up, along) => [x + up * normal_x + along * normal_y, y + up * normal_y - along * normal_x];
      const high = length / Math.hypot(1, friction);
      const edges = [-1, 1].map((side) => this.at(...place(high, side * high * friction)));
      const foot = this.at(x, y);
      found.cone += `<polygon class="cone" points="${foot} ${edges.join(" ")}" fill="var(--cone)"/>`;
      for (const edge of edges)
        found.force += `<polyline points="${foot} ${edge}" stroke="#2d343c" stroke-width="0.7"/>`;
      if (!(largest > 0)) continue;
      const tip = this.pixel(...place((length * normal) / largest, (length * tangential) / largest));
      const arrow = this.arrow(this.pixel(x, y), tip, 'fill="var(--force)" stroke="var(--force)"');
      found.force += `<g class="force">${arrow}</g>`;
    }
    return found;
  }

  /* A path through points that are apart on the screen. */
  path({ x, y }, stroke = "var(--blue)") {
    const apart = 1 / this.scale;
    const kept = [];
    let last = [Infinity, Infinity];
    for (let i = 0; i < x.length; i++)
      if (i === x.length - 1 || Math.abs(x[i] - last[0]) + Math.abs(y[i] - last[1]) > apart)
        kept.push(this.at(...(last = [x[i], y[i]])));
    return `<polyline points="${kept.join(" ")}" fill="none" stroke="${stroke}" stroke-width="1.3"/>`;
  }

  /* What moves the picture so that the body is in it, if it is followed: steadily, as the ground around goes. */
  camera({ x, y }) {
    if (!this.follow) return "";
    const around = Array.from({ length: 13 }, (_, i) => this.height(x + i - 6));
    const [column, row] = this.pixel(x, y);
    const [, ground] = this.pixel(x, around.reduce((sum, one) => sum + one) / around.length);
    const down = Math.max(0.72 * this.H - ground, 0.2 * this.H - row);
    return `translate(${(0.25 * this.W - column).toFixed(2)} ${down.toFixed(2)})`;
  }
}
