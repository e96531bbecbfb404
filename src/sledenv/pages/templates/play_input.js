"use strict";
/* What is simulated: parameters in their ranges, the address that holds them, the lines of Python that say the same. */
const D = JSON.parse($("data").textContent);
const E = parsed(D.exact); // numbers with all digits
const PARAMETERS = Object.fromEntries(E.parameters.map((one) => [one.name, one]));

/* Numbers in `changed` are in the units that a reader sees; what is not in it is as the page began, and so are
   vertices of the ground that are null. */
const start = (context) => ({ context, body: E.contexts[context].body, changed: {}, profile: null });
let chosen = start(0);

const here = () => E.contexts[chosen.context];
const bodyOf = () => E.bodies[chosen.body];

/* In SI units, as the page began. */
function begun(name) {
  if (name === "mass") return bodyOf().given.mass;
  return name === "gyration" ? bodyOf().gyration : here().values[name];
}

const isChanged = (name) => Object.hasOwn(chosen.changed, name);
const valueOf = (name) => (isChanged(name) ? chosen.changed[name] * PARAMETERS[name].factor + 0 : begun(name));
const shownOf = (name) =>
  isChanged(name) ? chosen.changed[name] : Number((begun(name) / PARAMETERS[name].factor).toPrecision(6));

/* What is wrong. */
const brief = (value) =>
  String(Number(value.toPrecision(6)))
    .replace("-", "−")
    .replace("Infinity", "∞");
const rangeOf = ({ low, high, unit }) => `${brief(low)} to ${brief(high)}${unit ? " " + unit : ""}`;

function problemOf(name, value) {
  const { low, high, label } = PARAMETERS[name];
  if (Number.isFinite(value) && value >= low && value <= high) return "";
  return `${label} = ${Number.isNaN(value) ? "nothing" : value}: must be a number from ${rangeOf(PARAMETERS[name])}`;
}

function problem() {
  for (const [name, value] of Object.entries(chosen.changed)) {
    const found = problemOf(name, value);
    if (found) return found;
  }
  const late = here().slope.zones.find(({ begin }) => begin >= valueOf("length"));
  return late ? `length = ${valueOf("length")}: must be above ${late.begin} m, where a zone begins` : problemOfGround();
}

/* Zones as the page began; none ends behind the end of the slope. */
const zonesWithin = (length) =>
  here().slope.zones.map((zone) => (zone.end > length ? { ...zone, end: Infinity } : zone));

/* What the kernel takes. */
function sceneOf() {
  const { given, limits, settle_speed: settle } = bodyOf();
  const mass = valueOf("mass");
  const turned = isChanged("mass") || isChanged("gyration");
  const inertia = turned ? mass * valueOf("gyration") * valueOf("gyration") : given.inertia;
  const squared = valueOf("restitution") * valueOf("restitution");
  const asymmetry = isChanged("restitution")
    ? Math.min((1 - squared) / (1 + squared), 1 - 2 ** -53)
    : here().law.asymmetry;
  const law = { stiffness: valueOf("stiffness"), asymmetry };
  for (const name of ["friction", "rolling_arm", "corner_rolling_arm"]) law[name] = valueOf(name);
  const { gravity, air_density } = here().slope;
  const own = { angle: valueOf("angle"), length: valueOf("length"), gravity, air_density };
  const slope = { ...own, zones: zonesWithin(own.length), ...groundOf() };
  if (D.solver === "rigid") law.settle_speed = settle;
  return { body: { ...given, mass, inertia }, law, slope, limits, solver: D.solver, x: here().launch.x };
}

const LAUNCH = ["orientation", "spin", "speed", "fall", "drop"];
const launchOf = () => Object.fromEntries(LAUNCH.map((name) => [name, valueOf(name)]));

/* The launch as the page began, to the last bit; null if it has been changed. */
function givenLaunch() {
  const other = LAUNCH.some(isChanged) || chosen.body !== here().body || verticesOf() !== here().vertices;
  return other ? null : here().launch;
}

/* The address. */
function address() {
  const parts = new URLSearchParams();
  if (chosen.context) parts.set("context", here().name);
  if (chosen.body !== here().body) parts.set("body", bodyOf().name);
  for (const name in PARAMETERS) if (isChanged(name)) parts.set(name, chosen.changed[name]);
  if (chosen.profile) parts.set("profile", vertexText(chosen.profile));
  return parts.toString();
}

/* Take what an address holds; returns what is wrong with it, and is left out. */
function readAddress(text) {
  const wrong = [];
  const asked = new URLSearchParams(text);
  const placeIn = (list, what, missing) => {
    if (!asked.has(what)) return missing;
    const found = list.findIndex(({ name }) => name === asked.get(what));
    if (found < 0)
      wrong.push(`${what} = ${asked.get(what)}: must be one of ${list.map(({ name }) => name).join(", ")}`);
    asked.delete(what);
    return found < 0 ? missing : found;
  };
  chosen = start(placeIn(E.contexts, "context", 0));
  chosen.body = placeIn(E.bodies, "body", chosen.body);
  for (const [name, value] of asked) {
    if (name === "profile") chosen.profile = readVertices(value);
    else if (Object.hasOwn(PARAMETERS, name)) {
      const number = value.trim() === "" ? NaN : Number(value);
      const found = problemOf(name, number);
      if (found) wrong.push(Number.isNaN(number) ? found.replace("nothing", value) : found);
      else chosen.changed[name] = number;
    } else wrong.push(`${name}: there is no such parameter`);
  }
  const found = problem();
  if (found) {
    wrong.push(found);
    chosen = start(chosen.context);
  }
  return wrong;
}

/* The same in Python. */
const number = (value) =>
  value === Infinity ? "math.inf" : Number.isInteger(value) && Math.abs(value) < 1e15 ? `${value}.0` : String(value);
const spelled = (values) =>
  Object.entries(values)
    .map(([name, value]) => `${name}=${number(value)}`)
    .join(", ");

function roundingText(radii) {
  if (!radii.some((radius) => radius > 0)) return "";
  const alike = radii.every((radius) => radius === radii[0]);
  return `, rounding=${alike ? number(radii[0]) : `[${radii.map(number).join(", ")}]`}`;
}

function pythonOf({ scene, launch, input }) {
  const { body, law, slope, solver } = scene;
  const { python, settings, given } = E.bodies[input.body];
  const { stiffness, asymmetry, friction, rolling_arm, corner_rolling_arm } = law;
  const same = body.mass === given.mass && body.inertia === given.inertia;
  const replaced = same ? "" : `.replace(${spelled({ mass: body.mass, inertia: body.inertia })})`;
  const zones = slope.zones.map((zone) => `    sledenv.Zone(${spelled(zone)}),\n`).join("");
  const listed = (words) => words.map((one, i) => (i % 4 ? ` ${one},` : `\n    ${one},`)).join("");
  const pairs = slope.profile.map((vertex) => `(${vertex.map(number).join(", ")})`);
  const profile = pairs.length ? `, profile=[${listed(pairs)}\n]${roundingText(slope.rounding)}` : "";
  const { angle, length, gravity, air_density } = slope;
  const air = body.drag_area > 0 ? `, air_density=${number(air_density)}` : "";
  const endless = [length, ...slope.zones.map(({ end }) => end), ...slope.rounding].includes(Infinity);
  return [
    ...(endless ? ["import math"] : []),
    "import sledenv",
    ...(python.startsWith("sledenv.") ? [] : ["from sledenv.bodies import Arc, Body, Segment"]),
    "",
    `body = ${python}${replaced}`,
    `law = sledenv.ContactLaw(${spelled({ stiffness, asymmetry, friction, rolling_arm, corner_rolling_arm })})`,
    `slope = sledenv.Slope(${spelled({ angle, length, gravity })}, zones=[${zones ? `\n${zones}` : ""}]${profile}${air})`,
    `launch = sledenv.State(${spelled(launch)})`,
    `descent = sledenv.simulate(body, law, slope, launch, solver="${solver}", ${settings})`,
    "print(descent.status, float(descent.jam.reward))",
  ].join("\n");
}
