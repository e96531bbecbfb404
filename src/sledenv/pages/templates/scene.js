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

/* The slope, descending to the right, and the sled: slope-frame points [m] to pixels. */
class Scene {
  constructor({ slope, body, size, close }, points, width, [lowest, highest]) {
    // slope: with the line of its ground; points: of the slope frame, to be in sight; close: pixels per metre with which the sled is followed, 0 if never
    Object.assign(this, { slope, body, size, W: width, cosine: Math.cos(slope.angle), sine: Math.sin(slope.angle) });
    const low = [Infinity, Infinity];
    const top = [-Infinity, -Infinity];
    const ends = slope.length === null ? [0] : [0, slope.length];
    this.last = Math.max(...ends, ...points.map(([x]) => x)); // place that is surely in sight
    this.first = Math.min(0, ...points.map(([x]) => x));
    const ground = pointsBetween(slope.line, this.first, this.last);
    for (const point of [
      ...points,
      ...ground.flatMap(([x, y]) => [
        [x, y],
        [x, y + 2 * size],
      ]),
    ])
      this.world(...point).forEach((value, k) => {
        low[k] = Math.min(low[k], value);
        top[k] = Math.max(top[k], value);
      });
    const margin = Math.max(1.3 * size, 0.03 * (top[0] - low[0]));
    const wide = top[0] - low[0] + 2 * margin;
    const high = top[1] - low[1] + 2 * margin;
    this.scale = Math.min(width / wide, highest / high, 90 / size);
    this.follow = close === undefined ? this.scale * size < 10 : close > 0; // the sled would be too small to see
    if (this.follow) this.scale = close ?? 45 / size;
    const written = slope.zones?.length ? 50 : 24; // room for what is written below the slope
    this.H = this.follow ? 0.84 * highest : clamp(high * this.scale + written, lowest, highest);
    this.middle = this.follow ? this.world(...points[0]) : [0.5 * (low[0] + top[0]), 0.5 * (low[1] + top[1])];
  }

  world(x, y) {
    return [x * this.cosine + y * this.sine, y * this.cosine - x * this.sine];
  }

  pixel(x, y) {
    const [column, row] = this.world(x, y);
    return [this.W / 2 + this.scale * (column - this.middle[0]), this.H / 2 - this.scale * (row - this.middle[1])];
  }

  place(column, row) {
    // where in the slope frame a pixel is: the inverse of pixel
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

  outline(shape, x, y, phi) {
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

  sled(x, y, phi, attributes, touching = []) {
    // touching: parts of a sled with its rider that are marked
    const [column, row] = this.pixel(x, y);
    const whole = this.outline(this.body.outline, x, y, phi);
    if (this.body.pieces) {
      const { hull, touched, pieces } = this.body;
      const fine = this.scale * this.size < 40 ? 0.5 : 1;
      const inside = pieces.map(
        ({ part, colour, points }) =>
          `<polygon data-part="${escaped(part)}" points="${this.outline(points, x, y, phi)}" ` +
          `fill="${touching.includes(part) ? touched : colour}" stroke="#2d343c" stroke-width="${fine}" stroke-linejoin="round"/>`,
      );
      return (
        `<g ${attributes}><polygon points="${whole}" fill="${hull}" stroke="#62707e" stroke-width="${fine}"/>${inside.join("")}` +
        `<circle cx="${column.toFixed(2)}" cy="${row.toFixed(2)}" r="${3 * fine}" fill="#2d343c"/></g>`
      );
    }
    return (
      `<g ${attributes}><polygon points="${whole}" fill="#f6c7a3" stroke="#2d343c" stroke-width="1.3"/>` +
      `<polygon points="${this.outline(this.body.heavy, x, y, phi)}" fill="#d55e00"/>` +
      `<polygon points="${whole}" fill="none" stroke="#2d343c" stroke-width="1.3"/>` +
      `<circle cx="${column.toFixed(2)}" cy="${row.toFixed(2)}" r="3" fill="#2d343c"/></g>`
    );
  }

  sky() {
    return `<rect width="${this.W}" height="${this.H.toFixed(0)}" fill="var(--sky)"/>`;
  }

  ground(left, right) {
    // where a sled is between these places [m]
    const { slope, scale, W } = this;
    const reach = (2 * (W + this.H)) / scale;
    const parts = [];
    left = Math.min(left, 0) - reach;
    right = Math.max(right, slope.length !== null && !this.follow ? slope.length : 0) + reach;
    parts.push(
      `<polygon points="${this.surface(left, right).join(" ")} ${this.at(right, -reach)} ${this.at(left, -reach)}" fill="var(--ground)"/>`,
    );
    parts.push(...this.zones(left, right));
    const least = 70 / scale;
    const power = 10 ** Math.floor(Math.log10(least));
    const step = [1, 2, 5, 10].map((factor) => factor * power).find((candidate) => candidate >= least);
    for (let i = Math.ceil((left + 0.5 * reach) / step), n = 0; i * step < right - 0.5 * reach && n < 2000; i++, n++) {
      const surface = this.height(i * step);
      const [column, row] = this.pixel(i * step, surface - 20 / scale);
      parts.push(
        `<polyline points="${this.at(i * step, surface)} ${this.at(i * step, surface - 6 / scale)}" stroke="var(--line)"/>`,
      );
      if (this.follow || (column > 24 && column < W - 24))
        parts.push(
          `<text x="${far(column)}" y="${far(row + 4)}" text-anchor="middle" fill="var(--pale)">${+(i * step).toPrecision(6)} m</text>`,
        );
    }
    parts.push(
      `<polyline class="surface" points="${this.surface(left, right).join(" ")}" fill="none" stroke="var(--line)" stroke-width="2"/>`,
    );
    if (slope.length !== null) {
      const foot = this.height(slope.length);
      const room = (this.pixel(slope.length, foot)[1] - 24) / scale;
      const top = foot + (this.follow ? 4 * this.size : Math.min(4 * this.size, room));
      const [end, row] = this.pixel(slope.length, top);
      const column = this.follow ? end : Math.min(end, W - 20);
      parts.push(
        `<polyline points="${this.at(slope.length, foot)} ${this.at(slope.length, top)}" stroke="var(--ink)" stroke-width="4" ` +
          `stroke-dasharray="12 9"/><text x="${far(column)}" y="${far(row - 7)}" text-anchor="middle" fill="var(--pale)">finish</text>`,
      );
    }
    return parts.join("");
  }

  zones(left, right) {
    // bands below the surface; their words are repeated where a zone is longer than the picture
    const { scale, W, slope } = this;
    const depth = 12 / scale;
    const parts = [];
    for (const zone of slope.zones ?? []) {
      const begin = Math.max(zone.begin, left);
      const end = Math.min(zone.end ?? Infinity, right);
      if (!(begin < end)) continue;
      parts.push(
        `<polygon class="zone" points="${[...this.surface(begin, end), ...this.surface(begin, end, depth).reverse()].join(" ")}" ` +
          `fill="${zone.colour}" stroke="var(--line)"/>`,
      );
      const last = Math.min(end, slope.length ?? Infinity, this.follow ? Infinity : this.last);
      const room = (last - begin) * scale;
      const said = [zone.words, zone.brief].find((text) => 7 * (text.length + 1) < room);
      if (!said) continue;
      const count = clamp(Math.floor(((last - begin) * scale) / (0.7 * W)), 1, 2000);
      for (let i = 0; i < count; i++) {
        const middle = begin + ((i + 0.5) / count) * (last - begin);
        const [column, row] = this.pixel(middle, this.height(middle) - 44 / scale);
        parts.push(
          `<text x="${far(column)}" y="${far(row + 4)}" text-anchor="middle" fill="var(--ink)">${escaped(said)}</text>`,
        );
      }
    }
    return parts;
  }

  contact(paths) {
    // where a rebound touched: places of the slope frame, in pieces
    const [w, h] = [5 / this.scale, 9 / this.scale];
    const [[[x, y]]] = paths;
    const lines = paths.map((path) => {
      const points = path.length > 1 ? path : [path[0], path[0]];
      return `<polyline points="${points.map((one) => this.at(...one)).join(" ")}" fill="none" stroke="#009e73" stroke-width="4"/>`;
    });
    const mark = `${this.at(x, y)} ${this.at(x - w, y - h)} ${this.at(x + w, y - h)}`;
    return `${lines.join("")}<polygon points="${mark}" fill="#009e73"/>`;
  }

  arrow(foot, tip, attributes) {
    // between two pixels
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

  push({ touches, largest }) {
    // what contacts do to the body: the friction cones, which lie below it, and what lies above it
    const length = (0.3 * this.H) / this.scale;
    const cones = [];
    const forces = [];
    touches.forEach(({ x, y, normal_x, normal_y, friction, normal, tangential }, k) => {
      const place = (up, along) => [x + up * normal_x + along * normal_y, y + up * normal_y - along * normal_x];
      const norm = Math.hypot(1, friction);
      const edges = [-1, 1].map((side) => this.at(...place(length / norm, (side * length * friction) / norm)));
      const foot = this.at(x, y);
      cones.push(`<polygon class="cone" points="${foot} ${edges.join(" ")}" fill="#f8ee8c"/>`);
      for (const edge of edges) forces.push(`<polyline points="${foot} ${edge}" stroke="#2d343c" stroke-width="0.7"/>`);
      if (k === 0) {
        const label = this.pixel(...place((1.07 * length) / norm, 0));
        forces.push(
          `<text x="${far(label[0])}" y="${far(label[1])}" text-anchor="middle" fill="var(--pale)">friction cone</text>`,
        );
      }
      if (!(largest > 0)) return;
      const tip = this.pixel(...place((length * normal) / largest, (length * tangential) / largest));
      forces.push(`<g class="force">${this.arrow(this.pixel(x, y), tip, 'fill="#a01e6e" stroke="#a01e6e"')}</g>`);
    });
    return { cone: cones.join(""), force: forces.join("") };
  }

  path(points, stroke = "var(--blue)") {
    return `<polyline points="${points.map(([x, y]) => this.at(x, y)).join(" ")}" fill="none" stroke="${stroke}" stroke-width="1.3"/>`;
  }

  shift(x, y) {
    // what moves the picture so that the sled stays in it, if it is followed
    const [column, row] = this.pixel(x, y);
    const [, ground] = this.pixel(x, this.height(x));
    const H = this.H;
    const down = Math.max(Math.min(0.72 * H - ground, 0.85 * H - row), 0.15 * H - row);
    return this.follow ? `translate(${(this.W / 2 - column).toFixed(2)} ${down.toFixed(2)})` : "";
  }
}
