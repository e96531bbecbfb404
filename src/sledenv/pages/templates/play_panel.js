"use strict";
/* Sliders and numbers, a pair for each parameter. */
const GROUPS = {
  launch: "Launch",
  ground: "Ground",
  surface: "Surface",
  slope: "Slope",
  body: "Body",
  hand: "Launch noise (standard deviations)",
};
const FLAT = '<button id="flat" type="button">Flat ground</button>';
const HIGHEST = 1000; // of a slider whose steps are factors
const SLID = 10; // by a slider of what has no upper end

const toSlider = ({ step, low, high }, value) =>
  step > 0 ? value : (HIGHEST * Math.log(value / low)) / Math.log(high / low);
const fromSlider = ({ step, low, high }, value) =>
  step > 0 ? value : Number((low * Math.exp((value / HIGHEST) * Math.log(high / low))).toPrecision(3));

function rowOf(one) {
  const last = one.high < Infinity ? one.high : one.low + SLID;
  const ends = one.step > 0 ? `min="${one.low}" max="${last}" step="${one.step}"` : `min="0" max="${HIGHEST}" step="1"`;
  const name = `${one.label}${one.unit ? ` [${one.unit}]` : ""}`;
  return (
    `<div class="parameter"><label for="number-${one.name}">${escaped(one.label)}</label><span>${escaped(rangeOf(one))}</span>` +
    `<input type="range" ${ends} data-slider="${one.name}" aria-label="${escaped(name)}, slider">` +
    `<input type="number" id="number-${one.name}" min="${one.low}" ${one.high < Infinity ? `max="${one.high}"` : ""} step="any" data-number="${one.name}" ` +
    `aria-label="${escaped(name)}"></div>`
  );
}

function buildPanel() {
  $("groups").innerHTML = Object.entries(GROUPS)
    .filter(([group]) => group !== "ground" || canHaveBumps())
    .map(([group, title], i) => {
      const rows = E.parameters.filter((one) => one.group === group).map(rowOf);
      const open = i === 0 || window.innerWidth > 860;
      return `<details ${open ? "open" : ""}><summary>${title}</summary>${rows.join("")}${group === "ground" ? FLAT : ""}</details>`;
    })
    .join("");
  $("contexts").hidden = E.contexts.length < 2;
  $("chosen-context").innerHTML = E.contexts
    .map(({ name }, i) => `<option value="${i}">${escaped(name)}</option>`)
    .join("");
  $("chosen-body").innerHTML = E.bodies.map(({ name }, i) => `<option value="${i}">${escaped(name)}</option>`).join("");
}

/* Show what is chosen; what someone is typing stays. */
function fillPanel() {
  fillRows(grabbed ? Object.keys(chosen.changed) : Object.keys(PARAMETERS));
  if (grabbed) return;
  $("chosen-context").value = chosen.context;
  $("chosen-body").value = chosen.body;
  if (canHaveBumps()) $("flat").disabled = !verticesOf().length;
}

function fillRows(names) {
  for (const name of names) {
    if (!$(`number-${name}`)) continue; // of bumps that this page does not have
    const value = shownOf(name);
    document.querySelector(`[data-slider="${name}"]`).value = toSlider(
      PARAMETERS[name],
      Number.isNaN(value) ? PARAMETERS[name].low : value,
    );
    const typed = $(`number-${name}`);
    if (document.activeElement !== typed) typed.value = Number.isNaN(value) ? "" : Number(value.toPrecision(7));
    typed.setAttribute("aria-invalid", isChanged(name) && problemOf(name, value) !== "");
  }
}

function onInput({ target }) {
  const { slider, number: name } = target.dataset;
  const typed = target.value.trim() === "" ? NaN : Number(target.value);
  if (slider) chosen.changed[slider] = fromSlider(PARAMETERS[slider], typed);
  else if (name) chosen.changed[name] = typed;
  else if (target.id === "chosen-context") chosen = start(Number(target.value));
  else if (target.id === "chosen-body") {
    chosen.body = Number(target.value);
    for (const own of ["mass", "gyration"]) delete chosen.changed[own];
  } else return;
  changed();
}

function onPress({ target }) {
  if (target.id === "reset") chosen = start(chosen.context);
  else if (target.id === "flat") chosen.profile = [];
  else return;
  changed();
}

$("panel").addEventListener("input", onInput);
$("panel").addEventListener("click", onPress);
$("panel").addEventListener("submit", (event) => event.preventDefault());
$("panel").addEventListener("change", () => fillPanel());
