"use strict";
/* Velocities and energy over time, and what the body does now. */
const LAYERS = ["#0072b2", "#56b4e9", "#bfc8d2", "#d55e00"];

const axisNumber = (value) =>
  Math.abs(value) >= 1e4 ? `${brief(Number((value / 1e3).toPrecision(3)))}k` : brief(value);

/* One plot over the time of the film. */
class Axes {
  constructor(height, label, range, bottom = 6) {
    const [low, high] = range[1] > range[0] ? range : [range[0] - 1, range[1] + 1];
    const width = clamp($("series").clientWidth, 260, 760);
    Object.assign(this, { width, height, bottom, label, low, high, left: 58, right: 10, top: 22 });
    this.end = Math.max(shown.rows.t.at(-1), 1e-3);
    $("series").insertAdjacentHTML("beforeend", `<svg class="plot" viewBox="0 0 ${width} ${height}"></svg>`);
    this.svg = $("series").lastElementChild;
    this.svg.addEventListener("pointerdown", (event) => {
      this.svg.setPointerCapture(event.pointerId);
      this.#seek(event);
    });
    this.svg.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) this.#seek(event);
    });
  }

  #seek({ clientX }) {
    const place = this.svg.getBoundingClientRect();
    const column = ((clientX - place.left) / place.width) * this.width;
    goTo(clamp((column - this.left) / (this.width - this.left - this.right), 0, 1) * this.end);
  }

  column(t) {
    return this.left + (t / this.end) * (this.width - this.left - this.right);
  }

  row(v) {
    const share = (v - this.low) / (this.high - this.low);
    return this.height - this.bottom - share * (this.height - this.top - this.bottom);
  }

  /* Points that are apart on the screen. */
  points(values) {
    const kept = [];
    let [column, row] = [-Infinity, -Infinity];
    values.forEach((value, i) => {
      const [x, y] = [this.column(shown.rows.t[i]), this.row(value)];
      if (i !== values.length - 1 && Math.abs(x - column) + Math.abs(y - row) < 0.5) return;
      [column, row] = [x, y];
      kept.push(`${far(x)},${far(y)}`);
    });
    return kept;
  }

  line(values) {
    return `<polyline points="${this.points(values).join(" ")}" fill="none" stroke="var(--blue)" stroke-width="1.6"/>`;
  }

  band(up, down, colour) {
    const points = [...this.points(up), ...this.points(down).reverse()];
    return `<polygon points="${points.join(" ")}" fill="${colour}"/>`;
  }

  /* Grid and labels; of time where there is room below. */
  frame() {
    const [edge, foot] = [this.width - this.right, this.height - this.bottom];
    const parts = [`<text x="${this.left}" y="14" fill="var(--ink)">${this.label}</text>`];
    for (const v of ticks(this.low, this.high, this.height > 110 ? 6 : 4, ""))
      parts.push(
        `<line x1="${this.left}" x2="${edge}" y1="${far(this.row(v))}" y2="${far(this.row(v))}" stroke="var(--${v === 0 ? "line" : "grid"})"/>`,
        `<text x="${this.left - 6}" y="${far(this.row(v) + 4)}" text-anchor="end" fill="var(--pale)">${axisNumber(v)}</text>`,
      );
    if (this.bottom < 30) return parts.join("");
    for (const t of ticks(0, this.end, 7, ""))
      parts.push(words(this.column(t), foot + 17, axisNumber(t), "var(--pale)"));
    parts.push(`<text x="${edge}" y="${this.height - 3}" text-anchor="end" fill="var(--pale)">time [s]</text>`);
    return parts.join("");
  }

  /* Contacts, as bands behind everything. */
  shading({ t, t_touchdown: begin }) {
    const bands = Array.from(t, (end, i) => {
      const [from, to] = [begin[i], end].map((time) => this.column(time));
      return (
        `<rect x="${far(from)}" y="${this.top}" height="${this.height - this.top - this.bottom}" ` +
        `width="${far(Math.max(to - from, 1))}" fill="var(--shade)"/>`
      );
    });
    return bands.join("");
  }

  draw(content) {
    this.svg.innerHTML = `${content}<line y1="${this.top}" y2="${this.height - this.bottom}" stroke="var(--force)" stroke-width="1.5"/>`;
    return this;
  }

  cursor(t) {
    const column = far(this.column(clamp(t, 0, this.end)));
    for (const end of ["x1", "x2"]) this.svg.lastElementChild.setAttribute(end, column);
  }
}

function extentOf(values) {
  const [low, high] = bounds([0, ...values]);
  const room = 0.06 * (high - low);
  return [low < 0 ? low - room : 0, high + room];
}

/* The plots. */
let plots = [];

function drawSeries() {
  const { rows, rebounds } = shown;
  $("series").innerHTML = "";
  plots = [
    ["u", "u [m/s] along the slope"],
    ["v", "v [m/s] normal to it"],
    ["omega", "ω [rad/s] spin"],
  ].map(([name, label]) => {
    const one = new Axes(104, label, extentOf(rows[name]));
    return one.draw(one.shading(rebounds) + one.frame() + one.line(rows[name]));
  });
  const layers = Object.entries(energiesOf(shown));
  const sums = [rows.t.map(() => 0)];
  for (const [, values] of layers) sums.push(sums.at(-1).map((sum, i) => sum + values[i]));
  const one = new Axes(224, "energy [J]", extentOf(sums.at(-1)), 34);
  const bands = layers.map((_, k) => one.band(sums[k + 1], sums[k], LAYERS[k]));
  plots.push(one.draw(bands.join("") + one.frame()));
  $("layers").innerHTML = layers
    .map(([name], k) => `<span><i style="background:${LAYERS[k]}"></i>${name}</span>`)
    .join("");
}

/* Where the energy [J] is in each row, above the lowest place of the descent; what is left of that at the launch is in the
   contacts, or lost. */
function energiesOf({ rows, scene: { body, slope } }) {
  const { mass, inertia } = body;
  const each = (value) => rows.t.map((_, i) => value(i));
  const heights = each((i) => rows.y[i] * Math.cos(slope.angle) - rows.x[i] * Math.sin(slope.angle));
  const [lowest] = bounds(heights);
  const layers = {
    translation: each((i) => 0.5 * mass * (rows.u[i] ** 2 + rows.v[i] ** 2)),
    rotation: each((i) => 0.5 * inertia * rows.omega[i] ** 2),
    potential: heights.map((height) => mass * slope.gravity * (height - lowest)),
  };
  const left = each((i) => Object.values(layers).reduce((sum, values) => sum + values[i], 0));
  return { ...layers, "stored in contacts, or lost": left.map((sum) => Math.max(left[0] - sum, 0)) };
}

/* What the body does at a time. */
function tellNow(t) {
  const { rows, rebounds, status } = shown;
  const state = stateAt(rows, t);
  $("now").innerHTML = entries([
    ["position", fixed(state.x, 3, "m")],
    ["along, u", fixed(state.u, 3, "m/s")],
    ["normal, v", fixed(state.v, 3, "m/s")],
    ["orientation", fixed((state.phi * 180) / Math.PI, 1, "°")],
    ["spin, ω", fixed(state.omega, 2, "rad/s")],
    ["speed", fixed(Math.hypot(state.u, state.v), 3, "m/s")],
  ]);
  for (const one of plots) one.cursor(t);
  const push = pushAt(t);
  if (!push) {
    $("contact").textContent = t >= rows.t.at(-1) ? `the end: ${status.replace("_", " ")}` : "in flight";
    return;
  }
  const { i, row, part, touches } = push;
  const sum = (value) => touches.reduce((total, one) => total + value(one), 0);
  const [normal, most] = [sum((one) => one.normal), sum((one) => one.friction * one.normal)];
  const signs =
    row === null ? "" : `${rows.slip[row] ? "slides" : "sticks"}, ${rows.spin[row] ? "turns" : "does not turn"}; `;
  const grip = most > 0 ? `, grip ${Math.min(Math.abs(sum((one) => one.tangential)) / most, 1).toFixed(2)}` : "";
  const much =
    rebounds.duration[i] > 0 ? `force ${fixed(normal / 1e3, 3, "kN")}` : `impulse ${fixed(normal, 2, "N s")}`;
  $("contact").textContent = `contact ${i + 1}, ${part}: ${D.modes[rebounds.mode[i]]}\n${signs}${much}${grip}`;
}
