/* Runs calls of the kernel for pages in Node: node kernels.mjs KERNEL.JS KERNEL.WASM WAY TASK INPUT OUTPUT. WAY is how it
   multiplies and adds: by its program or by an instruction, for which it must be there. */
import fs from "node:fs";
import vm from "node:vm";

const [, , script, file, way, task, input, output] = process.argv;
const Kernel = vm.runInThisContext(`${fs.readFileSync(script, "utf8")};Kernel`);
const kernel = await Kernel.load(fs.readFileSync(file), way === "instruction");
if (kernel.takesInstruction !== (way === "instruction")) throw new Error("the instruction is not there, or rounds twice");
const numbers = [];
if (task === "fused") {
  const given = new Float64Array(fs.readFileSync(input).buffer.slice(0));
  const fused = kernel.functions["fused.f64"];
  for (let i = 0; i < given.length; i += 3) numbers.push(fused(given[i], given[i + 1], given[i + 2]));
} else
  for (const one of JSON.parse(fs.readFileSync(input, "utf8"))) {
    const found = kernel.descend(one);
    numbers.push(...Object.values(found.outcome), found.rebounds.t.length, found.trajectory.t.length);
    for (const table of [found.rebounds, found.trajectory, found.contacts])
      for (const column of Object.values(table)) for (const number of column) numbers.push(number);
  }
fs.writeFileSync(output, new Uint8Array(Float64Array.from(numbers).buffer));
