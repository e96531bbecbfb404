"use strict";
/* The kernel in a page: descents with the bits of those that Python simulates. The WebAssembly file tells its own
   layouts, so no table of fields stands here. */
const [FLY, WAIT] = [0, 1]; // what a lane does: kernel/batch.py
class Kernel {
  /* Of the bytes of kernel.wasm; a promise. */
  static async load(bytes) {
    const { module, instance } = await WebAssembly.instantiate(bytes);
    return new Kernel(module, instance.exports);
  }

  constructor(module, functions) {
    const [told] = WebAssembly.Module.customSections(module, "sledenv");
    this.layout = JSON.parse(new TextDecoder().decode(told));
    this.functions = functions;
    this.memory = functions.memory;
    this.free = 0; // where the next table begins
  }

  /* One descent. Given as descent_input in pages/kernel.py writes it: body { mass, inertia, drag_area, arcs }, law, slope with its
     zones, its profile and the rounding of that, launch and limits as objects of numbers with the fields of the kernel's
     tuples, solver "compliant" or "rigid", of which the law may have a settle_speed. Limits that are missing are those
     of the default settings. With rows: false there is no trajectory. With ride: { rotor_inertia [kg m^2],
     spins [rad/s] } it is a ride: it is followed to the first flight that is not too short, and on by a hop with each of
     the spins lent; its status is "running" if it has not ended then.

     Returns { status, outcome, jam, rebounds, trajectory, contacts, takeoffs }: the name of the status; objects of
     numbers, with the ledger and with the metrics of DescentJam in kernel/jam.py; tables as objects of columns, arrays of numbers with the names, units and order of REBOUND,
     TRAJECTORY and CONTACT_FORCES in kernel/records.py; and the outcomes so far at each place where a spin of a ride is
     or can be lent. Of contacts there is one for each row of the trajectory and each contact there, in this order, with t
     and row, that of the trajectory. */
  descend(given) {
    let room = given.rows === false ? 0 : 4096;
    for (;;) {
      const found = this.#run(given, room);
      if (found.outcome.samples <= room || room === 0) return found;
      room = found.outcome.samples;
    }
  }

  /* Heights [m] of the mass centre at which a body touches the ground of a slope from above, at a place x [m] and some
     orientations [rad]. */
  heights(body, slope, x, angles) {
    this.#clear();
    const same = (number) => this.#list(angles.map(() => number));
    const bodies = this.#body(body);
    const pieces = this.#laid(slope);
    const heights = same(0);
    const ground = [pieces, same(0), same(pieces.lengths[0])];
    this.#call("resting", bodies, same(0), same(x), this.#list(angles), ...ground, heights);
    return new Float64Array(this.memory.buffer, heights.place, angles.length).slice();
  }

  /* The ground: columns of PIECE in kernel/geometry.py, a row for each piece with the bend where it begins. */
  pieces(slope) {
    this.#clear();
    const { place, lengths } = this.#laid(slope);
    return this.#columns("PIECE", place, lengths[0]);
  }

  #run({ body, law, slope, launch, limits = {}, solver = "compliant", ride = null }, room) {
    const most = { ...this.layout.limits, ...limits };
    this.#clear();
    const ends = this.#fields("Limits", most, "limits");
    const zones = (slope.zones ?? []).flatMap((zone) => this.#zone(zone));
    const bodies = this.#body(body);
    const ground = this.#laid(slope);
    const scene = this.#table("SCENE", 1);
    const given = { ContactLaw: law, Slope: slope, State: launch };
    for (const [kind, what] of Object.entries({ ContactLaw: "law", Slope: "slope", State: "launch" }))
      this.#fields(kind, given[kind], what).forEach((number, i) =>
        this.#set("SCENE", this.layout.tuples[kind][i], scene.place, number),
      );
    const count = zones.length / this.layout.tuples.Zone.length;
    const rest = { ground_end: ground.lengths[0], zones_end: count, rotor_inertia: ride?.rotor_inertia ?? 1 };
    for (const [name, number] of Object.entries({ ...rest, settle_speed: law.settle_speed ?? 0 }))
      this.#set("SCENE", name, scene.place, number);
    const zoned = { place: this.#row(zones).place, lengths: [count, this.layout.tuples.Zone.length] };
    const flights = this.#table("OUTCOME", 1);
    const log = this.#table("REBOUND", Number(most.max_rebounds));
    const rows = this.#table("TRAJECTORY", room);
    const space = this.#table("SPACE", 1);
    const logs = { place: log.place, lengths: [1, ...log.lengths] };
    const trims = ride ? this.#row([0, 0]) : { place: 0, lengths: [0, 2] };
    const scenes = [scene, bodies, ground, zoned];
    this.#call("embark", ...scenes, flights);
    const call = ["descend_lanes", solver === "rigid" ? 1 : 0, ends, ...scenes, trims, flights, logs, rows, space, 1];
    const takeoffs = [];
    let outcome;
    let status;
    for (const row of ride ? [[0, WAIT], ...ride.spins.map((spin) => [spin, FLY])] : [[]]) {
      new Float64Array(this.memory.buffer, trims.place, row.length).set(row);
      new Uint8Array(this.memory.buffer, space.place, this.layout.records.SPACE.size).fill(0);
      while (this.#get("SPACE", "lane", space.place) < 1) this.#call(...call);
      outcome = this.#record("OUTCOME", flights.place);
      status = this.layout.status[outcome.status];
      if (status !== "running") break;
      takeoffs.push(outcome);
    }
    const trajectory = this.#columns("TRAJECTORY", rows.place, Math.min(outcome.samples, room));
    return {
      status,
      outcome,
      jam: this.#judge(flights, body.mass, slope.length),
      takeoffs,
      rebounds: this.#columns("REBOUND", log.place, outcome.rebounds),
      trajectory,
      contacts: this.#contacts(rows.place, trajectory),
    };
  }

  /* Jam metrics of a descent, numbers by name. */
  #judge(flights, mass, length) {
    const names = this.layout.tuples.DescentJam;
    const [masses, lengths] = [mass, length].map((one) => ({ ...this.#row([Number(one)]), lengths: [1] }));
    const metrics = this.#row(names.map(() => 0));
    this.#call("judge", flights, masses, lengths, metrics);
    const numbers = new Float64Array(this.memory.buffer, metrics.place, names.length);
    return Object.fromEntries(names.map((name, i) => [name, numbers[i]]));
  }

  /* What the kernel reads of the ground: vertices of the profile are pairs of numbers, none are a plane; each may have a
     radius. */
  #laid({ profile = [], rounding = [] }) {
    const rows = profile.flatMap(([x, y], k) => [x, y, rounding[k] ?? 0]);
    const vertices = { place: this.#row(rows).place, lengths: [profile.length, 3] };
    const pieces = this.#table("PIECE", profile.length + 1);
    this.#call("build_pieces", vertices, pieces);
    return pieces;
  }

  #clear() {
    this.free = (this.functions["__heap_base"].value + 63) & ~63;
  }

  /* Numbers of a tuple, in the order of its fields; throws if one is missing. */
  #fields(kind, values, what) {
    return this.layout.tuples[kind].map((name) => {
      const number = Number(values[name] ?? undefined);
      if (Number.isNaN(number)) throw new TypeError(`${what}.${name} = ${values[name]}: must be a number`);
      return number;
    });
  }

  /* A zone in a row: NaN where it has no restitution or stiffness of its own. */
  #zone(zone) {
    const own = this.layout.tuples.Zone.map((name) => zone[name]);
    const numbers = this.#fields("Zone", { restitution: 0, stiffness: 0, ...zone }, "zone");
    return numbers.map((number, i) => (own[i] === undefined ? NaN : number));
  }

  /* Room for some records, all zero. */
  #table(record, count) {
    const place = this.#take(count * this.layout.records[record].size);
    return { place, lengths: [count] };
  }

  #row(numbers) {
    return { place: this.#list(numbers).place, lengths: [1, numbers.length] };
  }

  #list(numbers) {
    const place = this.#take(8 * numbers.length);
    new Float64Array(this.memory.buffer, place, numbers.length).set(numbers);
    return { place, lengths: [numbers.length] };
  }

  #take(bytes) {
    const place = this.free;
    this.free = (place + bytes + 63) & ~63;
    const missing = this.free - this.memory.buffer.byteLength;
    if (missing > 0) this.memory.grow(Math.ceil(missing / 65536));
    new Uint8Array(this.memory.buffer, place, bytes).fill(0);
    return place;
  }

  #body({ mass, inertia, drag_area, arcs }) {
    const bodies = this.#table("BODY", 1);
    const [, , most] = this.layout.records.BODY.fields.begin;
    if (arcs.length > most) throw new RangeError(`body.arcs holds ${arcs.length}: must hold at most ${most}`);
    for (const [name, value] of Object.entries({ mass, inertia, drag_area, count: arcs.length }))
      this.#set("BODY", name, bodies.place, value);
    arcs.forEach((arc, i) => {
      for (const name of this.layout.arc) this.#set("BODY", name, bodies.place, arc[name], i);
    });
    this.#call("complete", bodies);
    return bodies;
  }

  /* Call an entry as Python does: the numbers of all tuples in one table, then the other arguments in order. */
  #call(name, ...given) {
    const kept = this.free;
    const numbers = [];
    const passed = [];
    this.layout.entries[name].forEach((kind, i) => {
      const one = given[i];
      if (kind.table) passed.push(one.place, ...one.lengths.map(BigInt));
      else if (kind === "int") passed.push(BigInt(one));
      else if (kind === "float") passed.push(one);
      else numbers.push(...one);
    });
    const nowhere = this.#take(16); // neither a result nor an error
    const failed = this.functions[`sledenv_${name}`](nowhere, nowhere + 8, this.#row(numbers).place, ...passed);
    this.free = kept;
    if (failed) throw new Error(`${name} has failed`);
  }

  /* Numbers of a record by name. */
  #record(record, place) {
    const names = Object.keys(this.layout.records[record].fields);
    return Object.fromEntries(names.map((name) => [name, this.#get(record, name, place)]));
  }

  #get(record, name, place) {
    const [kind, offset] = this.layout.records[record].fields[name];
    const view = new DataView(this.memory.buffer);
    if (kind === "f8") return view.getFloat64(place + offset, true);
    return kind === "i4" ? view.getInt32(place + offset, true) : Number(view.getBigInt64(place + offset, true));
  }

  #set(record, name, place, value, i = 0) {
    const [, offset] = this.layout.records[record].fields[name];
    new DataView(this.memory.buffer).setFloat64(place + offset + 8 * i, Number(value), true);
  }

  /* Copy a table of records without series, column by column, but for the records in them. */
  #columns(record, place, count) {
    const { size, fields } = this.layout.records[record];
    const columns = {};
    for (const [name, [kind, offset]] of Object.entries(fields)) {
      if (kind in this.layout.records) continue;
      const wide = kind === "f8";
      const of = wide ? Float64Array : Int32Array;
      const numbers = new of(this.memory.buffer, place, (count * size) / of.BYTES_PER_ELEMENT);
      const column = new of(count);
      const step = size / of.BYTES_PER_ELEMENT;
      for (let i = 0, k = offset / of.BYTES_PER_ELEMENT; i < count; i++, k += step) column[i] = numbers[k];
      columns[name] = column;
    }
    return columns;
  }

  /* Copy the contacts of all rows of a trajectory into one table. */
  #contacts(place, { t: times, touching }) {
    const { size, fields } = this.layout.records.TRAJECTORY;
    const [record, first] = fields.contacts;
    const { size: step, fields: parts } = this.layout.records[record];
    const [row, places] = [[], []];
    touching.forEach((count, i) => {
      for (let k = 0; k < count; k++) {
        row.push(i);
        places.push(place + i * size + first + k * step);
      }
    });
    const columns = { t: Float64Array.from(row, (i) => times[i]), row: Int32Array.from(row) };
    for (const [name, [kind, offset]] of Object.entries(parts)) {
      const of = kind === "f8" ? Float64Array : Int32Array;
      const numbers = new of(this.memory.buffer);
      columns[name] = of.from(places, (one) => numbers[(one + offset) / of.BYTES_PER_ELEMENT]);
    }
    return columns;
  }
}
