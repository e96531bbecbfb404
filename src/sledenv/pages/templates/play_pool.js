"use strict";
/* Workers that simulate. One that takes too long over a task is ended and replaced, so that nothing hangs. */
const PATIENCE = 2; // [s] for a descent
let own = null; // the kernel of the page itself, which lays the ground that is drawn

/* Words that are other ones: what is written anew would be laid out anew in each picture. */
function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function tell(text) {
  $("problem").textContent = text;
  $("problem").hidden = text === "";
}

/* Nothing can be simulated here. */
function giveUp(text) {
  tell(text);
  document.querySelector("main").hidden = true;
}

const doesNotStart = (error) => giveUp(`The kernel does not start in this browser: ${error.message}.`);

/* Bytes of the kernel, which runs in the page itself then; or null if there is no use in going on. */
async function unpacked(text) {
  if (typeof WebAssembly !== "object" || typeof DecompressionStream !== "function") {
    giveUp("This browser has no WebAssembly or cannot unpack it, so it cannot simulate. Any of the last years can.");
    return null;
  }
  let bytes = null;
  try {
    const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    bytes = await new Response(stream).arrayBuffer();
  } catch {
    giveUp("This file is damaged: the kernel in it cannot be unpacked. Get the file once more.");
    return null;
  }
  try {
    own = await Kernel.load(bytes);
  } catch (error) {
    doesNotStart(error);
    return null;
  }
  return bytes;
}

class Pool {
  constructor(count, bytes) {
    const scripts = ["kernel", "worker"].map((id) => $(id).textContent);
    this.address = URL.createObjectURL(new Blob(scripts, { type: "text/javascript" }));
    this.bytes = bytes;
    this.waiting = []; // tasks
    this.idle = []; // workers
    this.left = count; // that can still be hired, when there is work
  }

  /* A promise of what a task of play_worker.js returns; it fails if that takes too long. */
  ask(message, descents = 1) {
    return new Promise((resolve, reject) => {
      this.waiting.push({ message, seconds: PATIENCE * descents, resolve, reject });
      this.#next();
    });
  }

  /* Forget tasks of a kind that no worker has begun. */
  forget(kind) {
    this.waiting = this.waiting.filter(({ message }) => message.task !== kind);
  }

  #hire() {
    const hand = { worker: null, task: null, timer: 0 };
    try {
      hand.worker = new Worker(this.address);
    } catch (error) {
      giveUp(`This browser lets no worker run in a page of its own, so it cannot simulate: ${error.message}.`);
      return;
    }
    hand.worker.addEventListener("message", ({ data }) => {
      const { resolve, reject } = hand.task;
      clearTimeout(hand.timer);
      this.idle.push(hand);
      if (data.error) reject(new Error(data.error));
      else resolve(data.found);
      this.#next();
    });
    hand.worker.addEventListener("error", doesNotStart);
    this.#give(hand, {
      message: { task: "load", bytes: this.bytes },
      seconds: Infinity,
      resolve: () => {},
      reject: doesNotStart,
    });
  }

  #next() {
    while (this.idle.length && this.waiting.length) this.#give(this.idle.pop(), this.waiting.shift());
    if (this.waiting.length && this.left > 0) {
      this.left -= 1;
      this.#hire();
    }
  }

  #give(hand, task) {
    hand.task = task;
    if (task.seconds < Infinity)
      hand.timer = setTimeout(() => {
        hand.worker.terminate();
        this.#hire();
        task.reject(new Error(`stopped after ${task.seconds} s`));
      }, 1e3 * task.seconds);
    hand.worker.postMessage(task.message);
  }
}
