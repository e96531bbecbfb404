/* Heights at which bodies rest: node resting.mjs KERNEL.JS PLAY_WORKER.JS KERNEL.WASM CASES, which it prints as JSON. */
import fs from "node:fs";
import vm from "node:vm";

const [, , script, worker, file, cases] = process.argv;
globalThis.self = { addEventListener() {} };
const text = [script, worker].map((one) => fs.readFileSync(one, "utf8")).join("");
const { load, heights } = vm.runInThisContext(`${text};({ load: TASKS.load, heights: restingHeights })`);
await load({ bytes: fs.readFileSync(file) });
const found = JSON.parse(fs.readFileSync(cases, "utf8")).map((one) => Array.from(heights(one, one.angles)));
console.log(JSON.stringify(found));
