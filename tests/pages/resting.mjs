/* Heights at which bodies rest: node resting.mjs KERNEL.JS KERNEL.WASM CASES, which it prints as JSON. */
import fs from "node:fs";
import vm from "node:vm";

const [, , script, file, cases] = process.argv;
const Kernel = vm.runInThisContext(`${fs.readFileSync(script, "utf8")};Kernel`);
const kernel = await Kernel.load(fs.readFileSync(file));
const given = JSON.parse(fs.readFileSync(cases, "utf8"));
const found = given.map(({ body, slope, x, angles }) => Array.from(kernel.heights(body, slope, x, angles)));
console.log(JSON.stringify(found));
