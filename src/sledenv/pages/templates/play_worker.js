"use strict";
/* A worker of the page that simulates, with a kernel of its own. A scene is what Kernel.descend takes but for the launch,
   which is { orientation, spin, speed, fall, drop } here, in SI units, from a place x of the slope; and the size of the
   body. */
let kernel = null;
const CRASHED = ["tumbled", "buried", "non_finite"];
const TURN = 2 * Math.PI;
const HALVINGS = 50; // of the turn of a crest

/* The same turned by whole turns into [-pi, pi]: within_a_turn in simulation/support.py. */
function withinTurn(angle) {
  const rest = angle % TURN;
  return Math.abs(rest) > Math.PI ? rest - Math.sign(rest) * TURN : rest;
}

/* Heights [m] of the mass centre at which a body touches the ground from above, one for each orientation:
   resting_heights in simulation/support.py. A line that touches the ground keeps the body above it, if the point of the
   body that is outermost against it lies behind the crest before and before the crest behind. Such lines are those of
   pieces, of a crest the one that touches it where the body does, of a dip one for each arc that is rounder. */
function restingHeights({ body, size, slope, x }, angles) {
  if (!slope.profile.length) return kernel.arms(body, angles).b;
  const pieces = kernel.pieces(slope);
  const found = angles.map(() => -Infinity);
  const armsAt = (tilts) =>
    kernel.arms(
      body,
      angles.map((phi, i) => withinTurn(phi - tilts[i])),
    );
  const footOf = ({ a, b }, tilt, i) => x - a[i] * Math.cos(tilt) + b[i] * Math.sin(tilt);
  const feetOf = (tilts) => {
    const arms = armsAt(tilts);
    return tilts.map((tilt, i) => footOf(arms, tilt, i));
  };
  /* Lines of these tilts, NaN where there is none, through the point that a tilt tells. */
  const keepAbove = (tilts, pointOf, isOver) => {
    const arms = armsAt(tilts.map((tilt) => tilt || 0));
    tilts.forEach((tilt, i) => {
      if (Number.isNaN(tilt) || !isOver(footOf(arms, tilt, i))) return;
      const [place, height] = pointOf(tilt);
      found[i] = Math.max(found[i], height + (arms.b[i] + (x - place) * Math.sin(tilt)) / Math.cos(tilt));
    });
  };
  const pointOfBend = (j) => (tilt) => {
    const radius = pieces.bend[j] * pieces.radius[j];
    return [pieces.qx[j] - radius * Math.sin(tilt), pieces.qy[j] + radius * Math.cos(tilt)];
  };
  const onCrest = (j, before, behind) => {
    const touches = angles.map((_, i) => before[i] > pieces.bx[j] && behind[i] < pieces.ex[j]);
    if (!touches.includes(true)) return;
    const cones = angles.map(() => [pieces.tilt[j - 1], pieces.tilt[j]]);
    const middles = () => cones.map(([first, last]) => 0.5 * (first + last));
    for (let n = 0; n < HALVINGS; n++) {
      const middle = middles();
      feetOf(middle).forEach((foot, i) => (cones[i][foot > pointOfBend(j)(middle[i])[0] ? 0 : 1] = middle[i]));
    }
    const tilts = middles().map((tilt, i) => (touches[i] ? tilt : NaN));
    keepAbove(tilts, pointOfBend(j), () => true);
  };
  const inDip = (j, { across, along, r }, isOver) => {
    if (r >= pieces.radius[j]) return;
    const tilts = angles.map((phi) => {
      const aside = x - across * Math.cos(phi) - along * Math.sin(phi) - pieces.qx[j];
      const tilt = Math.asin(aside / (pieces.radius[j] - r));
      return tilt >= pieces.tilt[j - 1] && tilt <= pieces.tilt[j] ? tilt : NaN;
    });
    keepAbove(tilts, pointOfBend(j), isOver);
  };
  const crests = [...pieces.bend.keys()].filter((j) => pieces.bend[j] > 0);
  const first = pieces.ex.findLastIndex((end, j) => j === 0 || end < x - size);
  let before = null; // feet on the piece before
  for (let j = first; j < pieces.x.length && (j === first || pieces.bx[j] <= x + size); j++) {
    const [low, high] = [crests.findLast((k) => k <= j), crests.find((k) => k > j)];
    const isOver = (foot) => !(foot < pieces.ex[low]) && !(foot > pieces.bx[high]);
    const tilts = angles.map(() => pieces.tilt[j]);
    const feet = feetOf(tilts);
    keepAbove(tilts, () => [pieces.x[j], pieces.y[j]], isOver);
    if (before && pieces.bend[j] > 0) onCrest(j, before, feet);
    if (before && pieces.bend[j] < 0) for (const arc of body.arcs) inDip(j, arc, isOver);
    before = feet;
  }
  return found;
}

/* States of launches: the lowest point of the body is at the height of the drop. */
function states(scene, launches) {
  const angles = launches.map(({ orientation }) => withinTurn(orientation));
  const b = restingHeights(scene, angles);
  return launches.map(({ drop, speed, fall, spin }, i) => ({
    x: scene.x,
    y: drop + b[i],
    phi: angles[i],
    u: speed,
    v: 0 - fall,
    omega: spin,
  }));
}

/* Progress, retention and reward of a descent: descent_jam in simulation/jam.py, operation by operation. */
function judge({ status, outcome }, mass, length) {
  const passed = outcome.t_line < Infinity;
  const finished = passed && !CRASHED.includes(status);
  const x = status === "non_finite" ? 0 : passed ? length : outcome.x;
  const u = finished ? Math.max(outcome.u_line, 0) : 0;
  const supplied = finished ? outcome.supplied : 1;
  const retention = Math.min((0.5 * mass * (u * u)) / (supplied > 0 ? supplied : Infinity), 1);
  const progress = Math.min(Math.max(x / length, 0), 1);
  return { progress, retention, reward: 0.5 * progress + 0.5 * Math.sqrt(retention) };
}

function descend(scene, launch, rows) {
  const found = kernel.descend({ ...scene, launch, rows });
  return { ...found, launch, jam: judge(found, scene.body.mass, scene.slope.length) };
}

/* A path of a few points, x and y in turn. */
function path({ x, y }) {
  const step = Math.max(Math.ceil(x.length / 150), 1);
  const points = [];
  for (let i = 0; i < x.length; i += step) points.push(x[i], y[i]);
  if (x.length) points.push(x[x.length - 1], y[x.length - 1]);
  return Float32Array.from(points);
}

/* Of each contact the depth [m] of the body in the ground, gap rate and slip velocity [m/s]: touches_in in
   plot/trajectories.py. */
function motions({ trajectory, contacts }, body) {
  const tilt = (k) => Math.atan2(-contacts.normal_x[k], contacts.normal_y[k]);
  const turned = Float64Array.from(contacts.row, (row, k) => trajectory.phi[row] - tilt(k));
  const { b: lowest } = kernel.arms(body, turned);
  const size = Math.max(...body.arcs.map(({ across, along, r }) => Math.hypot(across, along) + r));
  const found = { depth: [], gap_rate: [], slip_velocity: [] };
  contacts.row.forEach((row, k) => {
    const [n_x, n_y] = [contacts.normal_x[k], contacts.normal_y[k]];
    const [across, up] = [trajectory.x[row] - contacts.x[k], trajectory.y[row] - contacts.y[k]];
    const [u, v, omega] = ["u", "v", "omega"].map((name) => trajectory[name][row]);
    const a = n_y * across - n_x * up;
    const [cosine, sine] = [Math.cos(turned[k]), Math.sin(turned[k])];
    let [nearest, b] = [1e-6 * size, lowest[k]];
    for (const arc of body.arcs) {
      const apart = Math.abs(arc.across * cosine + arc.along * sine - a);
      if (apart < nearest) [nearest, b] = [apart, arc.r + arc.across * sine - arc.along * cosine];
    }
    found.depth.push(Math.max(b - (n_x * across + n_y * up), 0));
    found.gap_rate.push(n_x * u + n_y * v - a * omega);
    found.slip_velocity.push(n_y * u - n_x * v + b * omega);
  });
  return found;
}

const TASKS = {
  async load({ bytes }) {
    kernel = await Kernel.load(bytes);
  },

  /* One descent with its trajectory, and how the body moves in its contacts. With a state given, that is the launch. */
  descend({ scene, launch, state: given }) {
    const state = given ?? states(scene, [launch])[0];
    const found = descend(scene, state);
    return { ...found, scene, contacts: { ...found.contacts, ...motions(found, scene.body) } };
  },

  /* A ride, as far as spins are given for it, from the launch of its scene. */
  ride({ scene, ride }) {
    return descend({ ...scene, ride }, scene.launch);
  },

  rewards({ scene, launches }) {
    return states(scene, launches).map((state) => descend(scene, state, false).jam.reward);
  },

  paths({ scene, launches }) {
    return states(scene, launches).map((state) => {
      const { status, jam, trajectory } = descend(scene, state);
      return { status, reward: jam.reward, path: path(trajectory) };
    });
  },
};

self.addEventListener("message", async ({ data }) => {
  try {
    self.postMessage({ found: await TASKS[data.task](data) });
  } catch (error) {
    self.postMessage({ error: String(error) });
  }
});
