/* Runs descents with the kernel for pages in Node: node kernels.mjs KERNEL.JS KERNEL.WASM INPUT OUTPUT. */
import fs from "node:fs";
import vm from "node:vm";

const [, , script, file, input, output] = process.argv;
const Kernel = vm.runInThisContext(`${fs.readFileSync(script, "utf8")};Kernel`);
const kernel = await Kernel.load(fs.readFileSync(file));
const numbers = [];
for (const one of JSON.parse(fs.readFileSync(input, "utf8"))) {
  const found = kernel.descend(one);
  numbers.push(...Object.values(found.outcome), ...Object.values(found.jam));
  numbers.push(found.rebounds.t.length, found.trajectory.t.length);
  for (const table of [found.rebounds, found.trajectory, found.contacts])
    for (const column of Object.values(table)) for (const number of column) numbers.push(number);
}
fs.writeFileSync(output, new Uint8Array(Float64Array.from(numbers).buffer));
