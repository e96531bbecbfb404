"use strict";
/* A worker of the page that simulates, with a kernel of its own. A scene is what Kernel.descend takes but for the launch,
   which is { orientation, spin, speed, fall, drop } here, in SI units, from a place x of the slope. */
let kernel = null;
const TURN = 2 * Math.PI;

/* The same turned by whole turns into [-pi, pi]: within_a_turn in simulation/support.py. */
function withinTurn(angle) {
  const rest = angle % TURN;
  return Math.abs(rest) > Math.PI ? rest - Math.sign(rest) * TURN : rest;
}

/* States of launches: the lowest point of the body is at the height of the drop. */
function states(scene, launches) {
  const angles = launches.map(({ orientation }) => withinTurn(orientation));
  const heights = kernel.heights(scene.body, scene.slope, scene.x, angles);
  return launches.map(({ drop, speed, fall, spin }, i) => ({
    x: scene.x,
    y: drop + heights[i],
    phi: angles[i],
    u: speed,
    v: 0 - fall,
    omega: spin,
  }));
}

function descend(scene, launch, rows) {
  return { ...kernel.descend({ ...scene, launch, rows }), launch };
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
