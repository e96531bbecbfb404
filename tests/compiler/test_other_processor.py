"""The object for another processor computes the same bits there, linked to a program and run under an emulator."""

from __future__ import annotations

import math
import shutil
import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sledenv.compiler.entries import Entry, Table
from sledenv.kernel.contacts import SPACE
from sledenv.kernel.entries import LIBRARY, run_complete, run_embark, run_lanes, run_lay, run_lowest
from sledenv.kernel.geometry import PIECE
from sledenv.kernel.params import SCENE, ZONE_FIELDS, ContactLaw, Limits, Slope, State
from sledenv.kernel.records import OUTCOME, REBOUND, TRAJECTORY
from sledenv.simulation.bodies import segment_records
from sledenv.simulation.shapes import polygon

COMPILER, EMULATOR, ROOT = "aarch64-linux-gnu-gcc", "qemu-aarch64-static", "/usr/aarch64-linux-gnu"
LANES = 2000
LIMITS = Limits(4.0, 1e5, 1e-12, 0.01, 20.0, 0.0, 0.0, 0.0, 1e8, 0.0)
Call = tuple[Entry, tuple[Any, ...]]


def calls(seed: int) -> list[Call]:
    """Random descents of both laws, alone and many at once, on a plane and over bumps, and the geometry of bodies."""
    rng = np.random.default_rng(seed)
    mass, radius = rng.uniform(0.5, 120.0, LANES), np.exp(rng.uniform(-3.0, 0.0, LANES))
    half_angle = np.where(rng.random(LANES) < 0.3, math.pi, rng.uniform(0.3, 3.1, LANES))
    least = np.maximum(radius * np.cos(half_angle), 0.0)
    eccentricity = least + (radius - least) * rng.uniform(0.05, 0.95, LANES)
    inertia = mass * radius**2 * rng.uniform(0.1, 1.0, LANES)
    bodies = segment_records(np.column_stack([mass, radius, eccentricity, inertia, half_angle]))
    bodies[::4] = polygon(80.0, [(0.0, 0.0), (0.5, 0.1), (0.4, 0.6), (0.1, 0.7)], rounding=0.02).record
    slopes = np.column_stack([rng.uniform(-0.1, 0.4, LANES), rng.uniform(3.0, 15.0, LANES), np.full(LANES, 9.81)])
    arms, friction = rng.uniform(0.0, 0.01, (LANES, 2)), rng.uniform(0.0, 0.6, LANES)
    laws = np.column_stack([np.exp(rng.uniform(9.0, 16.0, LANES)), rng.uniform(0.0, 0.95, LANES), friction, arms])
    restitution = rng.uniform(0.0, 1.0, LANES)
    phi, lowest = rng.uniform(-math.pi, math.pi, LANES), (np.empty(LANES, np.int64), np.empty((LANES, 2)))
    numbers = np.arange(float(LANES))
    run_lowest(bodies, numbers, phi, *lowest)
    height = lowest[1][:, 1] + rng.uniform(0.01, 1.0, LANES)
    velocity = rng.uniform([-1.0, -3.0, -8.0], [5.0, 1.0, 8.0], (LANES, 3))
    launches = np.column_stack([np.zeros(LANES), height, phi, velocity])
    scenes = np.zeros(LANES, SCENE)
    for names, columns in ((ContactLaw._fields, laws), (Slope._fields, slopes), (State._fields, launches)):
        for name, column in zip(names, columns.T, strict=True):
            scenes[name] = column
    scenes["body"], scenes["settle_speed"], scenes["rotor_inertia"] = numbers, 1e-3, 1.0
    made: list[Call] = [
        (run_complete, (bodies.copy(),)),
        (run_lowest, (bodies, numbers, phi, np.empty(LANES, np.int64), np.empty((LANES, 2)))),
    ]
    bumps = np.array([[1.0, 0.0], [2.0, 0.2], [3.0, -0.1], [5.0, 0.1]])
    for is_rigid, vertices in ((0, bumps), (1, bumps[:0])):
        pieces = np.zeros(len(vertices) + 1, PIECE)
        run_lay(vertices, pieces)
        rows = scenes.copy()
        rows["ground_end"] = float(len(pieces))
        if is_rigid:
            rows["asymmetry"] = (1.0 - restitution**2) / (1.0 + restitution**2)
        tables = rows, bodies, pieces, np.empty((0, ZONE_FIELDS))
        flights, logs, trims = np.zeros(LANES, OUTCOME), np.zeros((LANES, 20), REBOUND), np.empty((0, 2))
        made.append((run_embark, (*tables, flights.copy())))
        run_embark(*tables, flights)
        given, trajectory = (is_rigid, LIMITS, *tables, trims), np.zeros(4000, TRAJECTORY)
        made.append((run_lanes, (*given, flights.copy(), logs, trajectory[:0], np.zeros(1, SPACE), LANES)))
        made.append((run_lanes, (*given, flights, logs.copy(), trajectory, np.zeros(1, SPACE), 1)))
    return made


def as_bytes(call: Call) -> bytes:
    """A call as the program reads it."""
    entry, given = call
    numbers = np.array([number for one in given if isinstance(one, tuple) for number in one], float)
    passed: list[bytes] = [struct.pack("<q", max(numbers.nbytes, 8)) + numbers.tobytes().ljust(8, b"\0")]
    for kind, one in zip(entry.kinds, given, strict=True):
        if isinstance(kind, Table):
            content = one.tobytes().ljust(8, b"\0")
            passed += [
                struct.pack("<q", len(content)) + content,
                *(struct.pack("<qq", 0, n) for n in one.shape),
            ]
        elif not issubclass(kind, tuple):
            passed.append(struct.pack("<qq", 0, one))
    return entry.name.encode().ljust(64, b"\0") + struct.pack("<q", len(passed)) + b"".join(passed)


def results(made: list[Call], written: bytes) -> list[list[np.ndarray]]:
    """Read the arrays that the program has written."""
    place, found = 0, []
    for _, given in made:
        place += max(8, 8 * sum(len(one) for one in given if isinstance(one, tuple)))
        tables = []
        for one in given:
            if isinstance(one, np.ndarray):
                tables.append(np.frombuffer(written, one.dtype, one.size, place).reshape(one.shape))
                place += max(one.nbytes, 8)
        found.append(tables)
    assert place == len(written)
    return found


@pytest.mark.slow
@pytest.mark.jit_only
@pytest.mark.skipif(not (shutil.which(COMPILER) and shutil.which(EMULATOR)), reason=f"needs {COMPILER} and {EMULATOR}")
def test_an_aarch64_processor_computes_the_same_bits(tmp_path: Path) -> None:
    """Oracle: the calls made here, field by field (NaN equal to NaN, as their signs are not told)."""
    LIBRARY.make(tmp_path, "linux-aarch64")
    content = (tmp_path / "linux-aarch64.kernel").read_bytes().partition(b"\n")[2]
    (tmp_path / "kernel.o").write_bytes(content)
    made = calls(seed=3)
    (tmp_path / "calls").write_bytes(b"".join(map(as_bytes, made)))
    names = " ".join(f"ENTRY({entry.name})" for entry in {entry.name: entry for entry, _ in made}.values())
    program, source = tmp_path / "program", Path(__file__).with_name("run_calls.c")
    build = [COMPILER, "-std=gnu11", f"-DENTRIES={names}", str(source), str(tmp_path / "kernel.o"), "-o", str(program)]
    subprocess.run(build, check=True)
    run = [EMULATOR, "-L", ROOT, str(program), str(tmp_path / "calls"), str(tmp_path / "written")]
    subprocess.run(run, check=True)
    there = results(made, (tmp_path / "written").read_bytes())
    for (entry, given), tables in zip(made, there, strict=True):
        entry(*given)
        for here, found in zip((one for one in given if isinstance(one, np.ndarray)), tables, strict=True):
            if here.dtype == SPACE:  # work space
                continue
            for name in here.dtype.names or ():
                np.testing.assert_array_equal(found[name], here[name], err_msg=f"{entry.name}: {name}")
            if not here.dtype.names:
                np.testing.assert_array_equal(found, here, err_msg=entry.name)
    flights = next(one for one in made[3][1] if isinstance(one, np.ndarray) and one.dtype == OUTCOME)
    assert (flights["rebounds"] > 2).mean() > 0.5  # there is something to compare
