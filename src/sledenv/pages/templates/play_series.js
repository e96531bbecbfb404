"use strict";
/* Velocities, energy and forces over time, and what the body does now. */
const LAYERS = ["#0072b2", "#56b4e9", "#bfc8d2", "#009e73", "#d55e00", "#e69f00", "#cc79a7", "var(--pale)"];

/* A quantity with three digits and, where it needs one, a prefix of its unit. */
function quantity(value, unit) {
  const found = [
    [1e9, "G"],
    [1e6, "M"],
    [1e3, "k"],
  ].find(([factor]) => Math.abs(value) >= factor);
  const [factor, prefix] = found ?? [1, ""];
  return `${(value / factor).toPrecision(3).replace("-", "−")} ${prefix}${unit}`;
}

const axisNumber = (value) =>
  (Math.abs(value) >= 1e4 ? `${Number((value / 1e3).toPrecision(3))}k` : brief(value)).replace("-", "−");

/* One plot over time, between two times. */
class Axes {
  constructor(parent, width, height, { bottom = 6, label, range, begin, end, unitTime = 1, origin = 0 }) {
    const [low, high] = range[1] > range[0] ? range : [range[0] - 1, range[1] + 1];
    const last = end > begin ? end : begin + 1e-3;
    Object.assign(this, { width, height, bottom, label, low, high, begin, end: last, unitTime, origin });
    Object.assign(this, { left: 58, right: 10, top: 22 });
    parent.insertAdjacentHTML("beforeend", `<svg class="plot" viewBox="0 0 ${width} ${height}"></svg>`);
    this.svg = parent.lastElementChild;
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
    const share = (column - this.left) / (this.width - this.left - this.right);
    goTo(this.begin + clamp(share, 0, 1) * (this.end - this.begin));
  }

  column(t) {
    return this.left + ((t - this.begin) / (this.end - this.begin)) * (this.width - this.left - this.right);
  }

  row(v) {
    const share = (v - this.low) / (this.high - this.low);
    return this.height - this.bottom - share * (this.height - this.top - this.bottom);
  }

  /* Points that are apart on the screen. */
  points(times, values) {
    const kept = [];
    let [column, row] = [-Infinity, -Infinity];
    for (let i = 0; i < times.length; i++) {
      const [x, y] = [this.column(times[i]), this.row(values[i])];
      if (i !== times.length - 1 && Math.abs(x - column) + Math.abs(y - row) < 0.5) continue;
      [column, row] = [x, y];
      kept.push(`${far(x)},${far(y)}`);
    }
    return kept;
  }

  line(times, values, colour) {
    return `<polyline points="${this.points(times, values).join(" ")}" fill="none" stroke="${colour}" stroke-width="1.6"/>`;
  }

  /* A line with gaps, where values are null. */
  lines(times, values, colour) {
    const pieces = [[]];
    values.forEach((value, i) => (value === null ? pieces.push([]) : pieces[pieces.length - 1].push(i)));
    const drawn = pieces.map((piece) => [times, values].map((list) => piece.map((i) => list[i])));
    return drawn.map(([t, v]) => this.line(t, v, colour)).join("");
  }

  band(times, up, down, colour) {
    const points = [...this.points(times, up), ...this.points(times, down).reverse()];
    return `<polygon points="${points.join(" ")}" fill="${colour}"/>`;
  }

  /* Grid and labels; of time where there is room below. */
  frame(words) {
    const parts = [];
    const edge = this.width - this.right;
    const foot = this.height - this.bottom;
    for (const v of ticks(this.low, this.high, this.height > 110 ? 6 : 4, ""))
      parts.push(
        `<line x1="${this.left}" x2="${edge}" y1="${far(this.row(v))}" y2="${far(this.row(v))}" stroke="var(--${v === 0 ? "line" : "grid"})"/>`,
        `<text x="${this.left - 6}" y="${far(this.row(v) + 4)}" text-anchor="end" fill="var(--pale)">${axisNumber(v)}</text>`,
      );
    if (words) {
      const [begin, end] = [this.begin, this.end].map((t) => (t - this.origin) * this.unitTime);
      for (const t of ticks(begin, end, 7, "")) {
        const column = far(this.column(this.origin + t / this.unitTime));
        parts.push(
          `<line x1="${column}" x2="${column}" y1="${foot}" y2="${foot + 4}" stroke="var(--line)"/>`,
          `<text x="${column}" y="${foot + 17}" text-anchor="middle" fill="var(--pale)">${axisNumber(t)}</text>`,
        );
      }
      parts.push(`<text x="${edge}" y="${this.height - 3}" text-anchor="end" fill="var(--pale)">${words}</text>`);
    }
    parts.push(`<text x="${this.left}" y="14" fill="var(--ink)">${this.label}</text>`);
    return parts.join("");
  }

  /* Contacts, as bands behind everything. */
  shading({ t, t_touchdown: begin }) {
    return [...t]
      .map((end, i) => {
        const [from, to] = [begin[i], end].map((time) => this.column(time));
        return (
          `<rect x="${far(from)}" y="${this.top}" height="${this.height - this.top - this.bottom}" ` +
          `width="${far(Math.max(to - from, 1))}" fill="var(--shade)"/>`
        );
      })
      .join("");
  }

  draw(content) {
    const cursor = `<line class="cursor" y1="${this.top}" y2="${this.height - this.bottom}" stroke="var(--force)" stroke-width="1.5"/>`;
    this.svg.innerHTML = content + cursor;
    return this;
  }

  cursor(t) {
    const column = far(this.column(clamp(t, this.begin, this.end)));
    for (const end of ["x1", "x2"]) this.svg.lastElementChild.setAttribute(end, column);
  }
}

function extentOf(...lists) {
  const [low, high] = extent(lists.flatMap((list) => extent(list)));
  const room = 0.06 * (high - low);
  return [low < 0 ? low - room : 0, high + room];
}

/* The plots. */
let plots = [];

function drawSeries() {
  const { rows, rebounds } = shown;
  const end = rows.t[rows.t.length - 1];
  const width = clamp($("series").clientWidth, 260, 760);
  $("series").innerHTML = "";
  const axes = (height, given) => new Axes($("series"), width, height, { begin: 0, end, ...given });
  plots = [
    ["u", "u [m/s] along the slope"],
    ["v", "v [m/s] normal to it"],
    ["omega", "ω [rad/s] spin"],
  ].map(([name, label]) => {
    const one = axes(104, { label, range: extentOf(rows[name]) });
    return one.draw(one.shading(rebounds) + one.frame() + one.line(rows.t, rows[name], "var(--blue)"));
  });
  if (D.ghost) plots.push(...residualPlots(axes));
  const layers = energiesOf(shown);
  const names = Object.keys(layers);
  const sums = [rows.t.map(() => 0)];
  for (const name of names) sums.push(sums[sums.length - 1].map((sum, i) => sum + layers[name][i]));
  const one = axes(224, { label: "energy [J]", range: extentOf(sums[names.length]), bottom: 34 });
  const bands = names.map((_, k) => one.band(rows.t, sums[k + 1], sums[k], LAYERS[k]));
  plots.push(one.draw(bands.join("") + one.frame("time [s]")));
  $("layers").innerHTML = names
    .map((name, k) => `<span><i style="background:${LAYERS[k]}"></i>${escaped(name)}</span>`)
    .join("");
}

/* Recorded less simulated pose in each frame, whole turns left out. */
function residualPlots(axes) {
  const { rows, rebounds } = shown;
  const end = rows.t[rows.t.length - 1];
  const { poses, times, used } = D.ghost;
  const seen = times.filter((t) => t <= end);
  const apart = seen.map((t, i) => {
    const { x, y, phi } = stateAt(rows, t);
    const turn = poses[i][2] - phi;
    return [
      1e3 * (poses[i][0] - x),
      1e3 * (poses[i][1] - y),
      ((turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI))) * 180) / Math.PI,
    ];
  });
  const plot = (label, columns) => {
    const sizes = apart.slice(0, used).flatMap((row) => columns.map(([k]) => Math.abs(row[k])));
    sizes.sort((a, b) => a - b);
    const size = 1.6 * sizes[Math.floor(0.95 * (sizes.length - 1))] || 1; // a few wrong poses must not hide the others
    const one = axes(120, { label, range: [-size, size] });
    const dots = columns.flatMap(([k, colour]) =>
      apart.map((row, i) => {
        const fill = i < used ? colour : "var(--line)";
        return `<circle cx="${far(one.column(seen[i]))}" cy="${far(one.row(clamp(row[k], -size, size)))}" r="1.4" fill="${fill}"/>`;
      }),
    );
    return one.draw(one.shading(rebounds) + one.frame() + dots.join(""));
  };
  const [blue, red] = ["var(--blue)", "var(--red)"];
  return [
    plot("recorded − simulated [mm]: x blue, y orange", [
      [0, blue],
      [1, red],
    ]),
    plot("recorded − simulated [°]: orientation", [[2, blue]]),
  ];
}

/* Where the energy [J] is in each row: energy_layers in plot/energy.py. */
function energiesOf({ rows, rebounds, scene: { body, law, slope } }) {
  const { mass, inertia } = body;
  const [cosine, sine] = [Math.cos(slope.angle), Math.sin(slope.angle)];
  const each = (value) => rows.t.map((_, i) => value(i));
  const heights = each((i) => rows.y[i] * cosine - rows.x[i] * sine);
  const lowest = heights.reduce((low, one) => Math.min(low, one), Infinity);
  const springs = rows.touches.map((touches) => touches.map((one) => springOf(one, law, slope)));
  const stored = springs.map((own) => own.reduce((sum, one) => sum + 0.5 * one.loading * one.compression ** 2, 0));
  // Where a gap turns, the force of the second of two rows tells how far a spring is compressed that began inside.
  for (let i = 0; i + 1 < rows.t.length; i++)
    if (rows.t[i] === rows.t[i + 1]) stored[i] = Math.min(stored[i], stored[i + 1]);
  const layers = {
    translation: each((i) => 0.5 * mass * (rows.u[i] ** 2 + rows.v[i] ** 2)),
    rotation: each((i) => 0.5 * inertia * rows.omega[i] ** 2),
    potential: heights.map((height) => mass * slope.gravity * (height - lowest)),
    "stored in the contact": stored,
  };
  const moving = each((i) => layers.translation[i] + layers.rotation[i]);
  const lost = lossesOf(rows, springs, rebounds, moving);
  D.losses.forEach((name, c) => (layers[`lost by ${name}`] = lost[c]));
  for (const name of D.flight_losses.filter((one) => rows[one].some((energy) => energy > 0)))
    layers[`lost by ${name}`] = rows[name];
  return layers;
}

/* Compression of a contact and its stiffness while the gap closes and while it opens: _springs in plot/energy.py. */
const STILL = 1e-9; // [m/s] rounding of the rate of a gap that turns
function springOf({ x, normal, gap_rate: rate, depth }, law, slope) {
  let { stiffness, asymmetry } = law;
  for (const zone of slope.zones ?? []) {
    if (!(x >= zone.begin && x < zone.end)) continue;
    stiffness = zone.stiffness ?? stiffness;
    if (Number.isFinite(zone.restitution)) asymmetry = (1 - zone.restitution ** 2) / (1 + zone.restitution ** 2);
  }
  const [loading, unloading] = [stiffness * (1 + asymmetry), stiffness * (1 - asymmetry)];
  const pressed = rate > -STILL ? unloading : loading;
  return { compression: pressed > 0 ? Math.min(normal / pressed, depth) : depth, loading, unloading };
}

/* The rebounds say how much each contact lost; the power of the contact forces says when. What had no force was lost in
   an impact of rigid surfaces, where the kinetic energy falls. */
function lossesOf(rows, springs, rebounds, moving) {
  const sum = (i, power) => rows.touches[i].reduce((all, one, k) => all + power(one, springs[i][k]), 0);
  const powers = [
    (i) => sum(i, (one, own) => (own.loading - own.unloading) * own.compression * Math.max(one.gap_rate, 0)),
    (i) => sum(i, (one) => Math.abs(one.tangential * one.slip_velocity)),
    (i) => Math.abs(rows.rolling[i] * rows.omega[i]),
  ];
  const found = D.losses.map(() => rows.t.map(() => 0));
  rebounds.t.forEach((end, r) => {
    const begin = rebounds.t_touchdown[r];
    const last = before(rows.t, end);
    let first = before(rows.t, begin);
    while (first > 0 && rows.t[first - 1] >= begin) first -= 1;
    let struck = first;
    for (let i = first; i < last; i++)
      if (moving[i] - moving[i + 1] > moving[struck] - moving[Math.min(struck + 1, last)]) struck = i;
    D.losses.forEach((name, c) => {
      const loss = rebounds[`loss_${name}`][r];
      const done = [0];
      for (let i = first; i < last; i++)
        done.push(done[done.length - 1] + 0.5 * (rows.t[i + 1] - rows.t[i]) * (powers[c](i) + powers[c](i + 1)));
      const all = done[done.length - 1];
      const forced = all > Math.max(0.1 * loss, 0);
      for (let i = first; i < rows.t.length; i++) {
        const share = i > last ? 1 : forced ? done[i - first] / all : Number(i > struck);
        found[c][i] += loss * share;
      }
    });
  });
  return found;
}

/* Contacts in some rows, in lists of one for each row or null, by what touches: by_label in plot/trajectories.py. */
function contactsByName(rows, inside) {
  const { parts } = E.bodies[shown.input.body];
  const profile = rows.touches.some((touches) => touches.some(({ ground }) => ground > 0));
  const found = new Map();
  inside.forEach((k, i) => {
    const told = [];
    for (const one of [...rows.touches[k]].sort((a, b) => a.x - b.x)) {
      const label = parts[one.part - 1] + (profile ? ` on ${groundName(one.ground, shown.scene.slope.rounding)}` : "");
      told.push(label);
      const count = told.filter((other) => other === label).length;
      const name = count > 1 ? `${label}, ${count}` : label;
      if (!found.has(name)) found.set(name, Array(inside.length).fill(null));
      found.get(name)[i] = one;
    }
  });
  return found;
}

/* Forces of one rebound over time, the friction force within the band that friction allows; of several contacts the sums
   and, thinner, the forces of each. */
const SEVERAL = ["#56b4e9", "#e69f00", "#cc79a7", "#009e73"];
let forces = [];

function drawForces(i) {
  const { rows, rebounds, scene: given } = shown;
  forces = [];
  $("forces").innerHTML = "";
  if (!rebounds.t.length) return;
  const [begin, end] = [rebounds.t_touchdown[i], rebounds.t[i]];
  if (end === begin) {
    $("forces").innerHTML =
      '<p class="hint">An impact of rigid surfaces has no duration: there is an impulse, but no force over time.</p>';
    return;
  }
  const inside = rows.t.map((_, k) => k).filter((k) => rows.t[k] >= begin && rows.t[k] <= end && rows.feature[k]);
  const [times, normal, tangential] = ["t", "normal", "tangential"].map((name) => inside.map((k) => rows[name][k]));
  const boundOf = (touches) => touches.reduce((sum, one) => sum + frictionAt(one.x, given) * one.normal, 0);
  const most = inside.map((k) => boundOf(rows.touches[k]));
  const short = end - begin < 0.5;
  const width = clamp($("forces").clientWidth, 240, 420);
  const axes = (height, label, range, bottom) =>
    new Axes($("forces"), width, height, {
      label,
      range,
      bottom,
      begin,
      end,
      origin: begin,
      unitTime: short ? 1e3 : 1,
    });
  const above = axes(120, "N [N] normal force", extentOf(normal), 6);
  const below = axes(
    150,
    "F [N] friction force, shaded: ± f N",
    extentOf(
      tangential,
      most,
      most.map((value) => -value),
    ),
    34,
  );
  const band = below.band(
    times,
    most,
    most.map((value) => -value),
    "var(--cone)",
  );
  const each = [...contactsByName(rows, inside)];
  const colourOf = (k) => SEVERAL[k % SEVERAL.length];
  const several = (axis, name) => {
    if (each.length < 2) return "";
    const lines = each.map(([, list], k) =>
      axis.lines(
        times,
        list.map((one) => one && one[name]),
        colourOf(k),
      ),
    );
    return `<g class="each">${lines.join("")}</g>`;
  };
  forces = [
    above.draw(above.frame() + above.line(times, normal, "var(--blue)") + several(above, "normal")),
    below.draw(
      band +
        below.frame(`${short ? "ms" : "s"} since touchdown`) +
        below.line(times, tangential, "var(--red)") +
        several(below, "tangential"),
    ),
  ];
  const keys = each.map(([name], k) => `<span><i style="background:${colourOf(k)}"></i>${escaped(name)}</span>`);
  if (each.length > 1) $("forces").insertAdjacentHTML("beforeend", `<div class="legend">${keys.join("")}</div>`);
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
  for (const one of [...plots, ...forces]) one.cursor(t);
  const push = pushAt(t);
  if (!push) {
    $("contact").textContent = t >= rows.t[rows.t.length - 1] ? `the end: ${status.replace("_", " ")}` : "in flight";
    return;
  }
  const { i, row, part, touches } = push;
  const [normal, tangential] = ["normal", "tangential"].map((name) => touches.reduce((sum, one) => sum + one[name], 0));
  const most = touches.reduce((sum, one) => sum + one.friction * one.normal, 0);
  const signs = row === undefined || !rows.feature[row] ? "" : motionWords(rows.slip[row], rows.spin[row]);
  const grip = most > 0 ? `, grip ${Math.min(Math.abs(tangential) / most, 1).toFixed(2)}` : "";
  const much = rebounds.duration[i] > 0 ? `force ${quantity(normal, "N")}` : `impulse ${quantity(normal, "N s")}`;
  $("contact").textContent = `contact ${i + 1}, ${part}: ${D.modes[rebounds.mode[i]]}\n${signs}${much}${grip}`;
}

/* From the signs of slip and spin: motion_words in simulation/words.py. */
const motionWords = (slip, spin) => `${slip ? "slides" : "sticks"}, ${spin ? "turns" : "does not turn"}; `;
