"use strict";
/* What is simulated: parameters in their ranges, the address that holds them, the lines of Python that say the same. */
const D = JSON.parse($("data").textContent);
const E = parsed(D.exact); // numbers with all digits
const PARAMETERS = Object.fromEntries(E.parameters.map((one) => [one.name, one]));
const ZONE = ["begin", "end", "friction", "rolling_arm", "corner_rolling_arm"];
const OWN = ["restitution", "stiffness"]; // which a zone may have

/* Numbers in `changed` are in the units that a reader sees; what is not in it is as the page began, and so are zones and
   vertices of the ground that are null. A launch that is kept, to compare others with it, is in SI units. */
const start = (context) => ({
  context,
  body: E.contexts[context].body,
  solver: D.solver,
  changed: {},
  zones: null,
  profile: null,
  kept: null,
});
let chosen = start(0);

const here = () => E.contexts[chosen.context];
const zonesOf = () => chosen.zones ?? here().slope.zones;
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

function problemOfZones(zones, length) {
  if (zones.length > D.most_zones) return `${zones.length} zones: there may be at most ${D.most_zones}`;
  let reached = -Infinity;
  for (const [k, zone] of zones.entries()) {
    const name = `zone ${k + 1}`;
    if (ZONE.some((field) => Number.isNaN(zone[field]))) return `${name}: must have a begin and a friction`;
    if (zone.begin < 0) return `${name} begins at ${zone.begin} m: must begin at 0 m or later`;
    if (zone.begin < reached) return `${name} begins at ${zone.begin} m: the one before ends at ${reached} m`;
    if (zone.begin >= length) return `${name} begins at ${zone.begin} m: the slope ends at ${length} m`;
    if (zone.end <= zone.begin) return `${name} ends at ${zone.end} m: must end behind its begin, ${zone.begin} m`;
    if (zone.end > length && zone.end < Infinity)
      return `${name} ends at ${zone.end} m: must end at ${length} m, the end of the slope, or have no end`;
    for (const field of chosen.zones ? ZONE.slice(2) : [])
      if (!(zone[field] >= 0 && zone[field] <= 2)) return `${name}, ${field} = ${zone[field]}: must be from 0 to 2`;
    if (zone.restitution !== undefined && !(zone.restitution > 0 && zone.restitution <= 1))
      return `${name}, restitution = ${zone.restitution}: must be above 0 and at most 1`;
    if (zone.stiffness !== undefined && !(zone.stiffness > 0 && zone.stiffness < Infinity))
      return `${name}, stiffness = ${zone.stiffness}: must be above 0`;
    reached = zone.end;
  }
  return "";
}

function problem() {
  for (const [name, value] of Object.entries(chosen.changed)) {
    const found = problemOf(name, value);
    if (found) return found;
  }
  return problemOfZones(zonesOf(), valueOf("length")) || problemOfGround();
}

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
  const slope = { ...own, zones: zonesOf(), ...groundOf() };
  if (chosen.solver === "rigid") {
    law.restitution = Math.sqrt((1 - asymmetry) / (1 + asymmetry));
    law.settle_speed = settle;
  }
  return { body: { ...given, mass, inertia }, law, slope, limits, solver: chosen.solver, x: here().launch.x };
}

const LAUNCH = ["orientation", "spin", "speed", "fall", "drop"];
const launchOf = () => Object.fromEntries(LAUNCH.map((name) => [name, valueOf(name)]));

/* The launch as the page began, to the last bit; null if it has been changed. */
function givenLaunch() {
  const other = LAUNCH.some(isChanged) || chosen.body !== here().body || verticesOf() !== here().vertices;
  return other ? null : here().launch;
}

/* The address. */
const zoneText = (zone) =>
  (OWN.some((name) => zone[name] !== undefined) ? [...ZONE, ...OWN] : ZONE)
    .map((name) => (zone[name] === Infinity ? "" : zone[name]))
    .join(",");

function address() {
  const parts = new URLSearchParams();
  if (chosen.context) parts.set("context", here().name);
  if (chosen.body !== here().body) parts.set("body", bodyOf().name);
  if (chosen.solver !== D.solver) parts.set("solver", chosen.solver);
  for (const name in PARAMETERS) if (isChanged(name)) parts.set(name, chosen.changed[name]);
  if (chosen.zones) parts.set("zones", chosen.zones.map(zoneText).join(";"));
  if (chosen.profile) parts.set("profile", vertexText(chosen.profile));
  if (chosen.kept) parts.set("kept", LAUNCH.map((name) => chosen.kept[name]).join(","));
  return parts.toString();
}

/* A kept launch, and what is wrong with it. */
function readLaunch(text) {
  const numbers = text.split(",").map((part) => (part.trim() === "" ? NaN : Number(part)));
  if (numbers.length !== LAUNCH.length) return { wrong: `kept = ${text}: must be ${LAUNCH.length} numbers` };
  const wrong = LAUNCH.map((name, i) => problemOf(name, numbers[i] / PARAMETERS[name].factor)).find(
    (one) => one !== "",
  );
  if (wrong) return { wrong: `kept, ${wrong}` };
  return { kept: Object.fromEntries(LAUNCH.map((name, i) => [name, numbers[i]])) };
}

function readZones(text) {
  return text
    .split(";")
    .filter((one) => one !== "")
    .map((one) => {
      const numbers = one.split(",").map((part, i) => (part === "" ? (i === 1 ? Infinity : NaN) : Number(part)));
      const own = OWN.map((name, i) => [name, numbers[ZONE.length + i]]).filter(
        ([, value]) => value !== undefined && !Number.isNaN(value),
      );
      return Object.fromEntries([...ZONE.map((name, i) => [name, numbers[i] ?? NaN]), ...own]);
    });
}

/* Take what an address holds; returns what is wrong with it, and is left out. */
function readAddress(text) {
  const wrong = [];
  const asked = new URLSearchParams(text);
  const context = asked.has("context") ? E.contexts.findIndex(({ name }) => name === asked.get("context")) : 0;
  if (context < 0)
    wrong.push(`context = ${asked.get("context")}: must be one of ${E.contexts.map(({ name }) => name).join(", ")}`);
  asked.delete("context");
  chosen = start(Math.max(context, 0));
  for (const [name, value] of asked) {
    if (name === "body") {
      const found = E.bodies.findIndex((one) => one.name === value);
      if (found >= 0) chosen.body = found;
      else wrong.push(`body = ${value}: must be one of ${E.bodies.map((one) => one.name).join(", ")}`);
    } else if (name === "solver") {
      if (["compliant", "rigid"].includes(value)) chosen.solver = value;
      else wrong.push(`solver = ${value}: must be compliant or rigid`);
    } else if (name === "zones") chosen.zones = readZones(value);
    else if (name === "profile") chosen.profile = readVertices(value);
    else if (name === "kept") {
      const { kept, wrong: found } = readLaunch(value);
      if (found) wrong.push(found);
      else chosen.kept = kept;
    } else if (Object.hasOwn(PARAMETERS, name)) {
      const number = value.trim() === "" ? NaN : Number(value);
      const found = problemOf(name, number);
      if (found) wrong.push(Number.isNaN(number) ? found.replace("nothing", value) : found);
      else chosen.changed[name] = number;
    } else wrong.push(`${name}: there is no such parameter`);
  }
  const found = problemOfZones(zonesOf(), valueOf("length"));
  if (found) {
    wrong.push(found);
    chosen.zones = null;
    if (problemOfZones(zonesOf(), valueOf("length"))) delete chosen.changed.length;
  }
  const wrongGround = problemOfGround();
  if (wrongGround) {
    wrong.push(wrongGround);
    setVertices(null);
    delete chosen.changed.rounding;
    if (problemOfGround()) Object.assign(chosen, { body: here().body, solver: D.solver });
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
    ...(python.startsWith("sledenv.") ? [] : ["from sledenv import Arc, Body, Segment"]),
    "",
    `body = ${python}${replaced}`,
    `law = sledenv.ContactLaw(${spelled({ stiffness, asymmetry, friction, rolling_arm, corner_rolling_arm })})`,
    `slope = sledenv.Slope(${spelled({ angle, length, gravity })}, zones=[${zones ? `\n${zones}` : ""}]${profile}${air})`,
    `launch = sledenv.State(${spelled(launch)})`,
    `descent = sledenv.simulate(body, law, slope, launch, solver="${solver}", ${settings})`,
    "print(descent.status, float(descent.jam.reward))",
  ].join("\n");
}

/* What is touched of the ground: ground_name in simulation/outcomes.py. */
function groundName(code, rounding = []) {
  const k = Math.floor(code / 2);
  return `${code % 2 ? (rounding[k] > 0 ? "bend" : "vertex") : "piece"} ${k}`;
}

/* The table of rebounds that rebound_columns in pages/columns.py gives. */
function csvOf({ rebounds, launch, input }) {
  const { parts } = E.bodies[input.body];
  const words = {
    feature: (code) => (code ? parts[code - 1] : "none"),
    ground: (code) => groundName(code),
    mode: (code) => D.modes[code],
  };
  const names = Object.keys(D.columns);
  const [first, ...others] = Object.values(D.columns);
  const lines = [[first, "phi_rad", ...others]];
  for (let i = 0; i < rebounds.t.length; i++) {
    const [since, phi] = i ? [rebounds.t[i - 1], rebounds.phi[i - 1]] : [0, launch.phi];
    const [begin, ...cells] = names.map((name) => words[name]?.(rebounds[name][i]) ?? rebounds[name][i]);
    lines.push([begin, phi + rebounds.omega_before[i] * (begin - since), ...cells]);
  }
  return lines.map((cells) => cells.join(",").replaceAll("Infinity", "inf") + "\n").join("");
}
