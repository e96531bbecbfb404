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

const TASKS = {
  async load({ bytes }) {
    kernel = await Kernel.load(bytes);
  },

  /* One descent with its trajectory. With a state given, that is the launch. */
  descend({ scene, launch, state: given }) {
    const state = given ?? states(scene, [launch])[0];
    return { ...descend(scene, state), scene };
  },

  /* A ride, as far as spins are given for it, from the launch of its scene. */
  ride({ scene, ride }) {
    return descend({ ...scene, ride }, scene.launch);
  },

  rewards({ scene, launches }) {
    return states(scene, launches).map((state) => descend(scene, state, false).jam.reward);
  },
};

self.addEventListener("message", async ({ data }) => {
  try {
    self.postMessage({ found: await TASKS[data.task](data) });
  } catch (error) {
    self.postMessage({ error: String(error) });
  }
});
