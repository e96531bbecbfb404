"""The kernel for pages computes what Python does, bit for bit."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sledenv.kernel.entries import LIBRARY
from sledenv.pages import kernel
from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.ride import Ride
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate
from sledenv.simulation.sleds import sled
from sledenv.simulation.support import support_height
from tests.bodies import rod
from tests.profiles import random_case

SCRIPT = kernel.KERNEL.parent / "templates/kernel.js"
REMAKE = "the kernel has other sources than kernel.wasm: make wasm, and commit what it writes"


def in_node(runner: str, *files: Path) -> str:
    """Output of a script of this folder that Node runs with the kernel for pages."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs node, which runs WebAssembly (Debian: nodejs)")
    command = [node, Path(__file__).with_name(runner), SCRIPT, kernel.KERNEL, *files]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    return done.stdout


def test_the_kernel_for_pages_is_of_these_sources() -> None:
    """Oracle: the digest of the sources, and the layouts that they give now."""
    told = kernel.told(kernel.KERNEL.read_bytes())
    assert told["fingerprint"] == LIBRARY.fingerprint, REMAKE
    assert told == json.loads(json.dumps(kernel.layout())), REMAKE


def test_the_kernel_for_pages_asks_nothing_of_who_runs_it() -> None:
    """Oracle: it has no section 2, of imports; it is small enough for a page."""
    content = kernel.KERNEL.read_bytes()
    assert content.startswith(b"\0asm")
    assert 2 not in [kind for kind, *_ in kernel.sections(content)]
    assert len(content) < 260_000


BODIES = (sled(), segment(60.0, 0.4, 0.15, 6.0), circular_segment(60.0, 0.5, 1.9), rod(20.0, 0.6, 2.4))


def _case(seed: int, number: int) -> tuple[Body, ContactLaw, Slope, State, Settings]:
    """A random descent: over dips, crests and zones, sharp and round; or on a plane, in air, some rigid."""
    case, rng = random_case((seed, number), zoned=True, planes=False), np.random.default_rng((seed, number, 1))
    settings = Settings(max_time=3.0, max_rebounds=40)
    if number % 2:
        count = len(case.slope.profile)
        slope = case.slope._replace(rounding=(rng.random(count) < rng.random()) * 10.0 ** rng.uniform(-2.0, 1.0, count))
        launch = case.launch._replace(y=case.launch.y + 0.5)  # over dips that are less deep now
        return case.body, case.law, slope, launch, settings
    body = BODIES[rng.integers(len(BODIES))].replace(drag_area=rng.choice([0.0, 10.0 ** rng.uniform(-3.0, 1.0)]))
    slope = case.slope._replace(profile=(), length=12.0, zones=(), air_density=1.3)
    law = case.law._replace(stiffness=10.0 ** rng.uniform(4.0, 7.5))
    launch = case.launch._replace(y=support_height(body, case.launch.phi) + rng.uniform(0.01, 1.0))
    solver = str(rng.choice(["compliant", "rigid"]))
    return body, law, slope, launch, replace(settings, solver=solver, run_out=float(rng.choice([0.0, 2.0])))


def _numbers(descent: Descent) -> Iterator[Any]:
    """All numbers of a descent, in the order in which the runner writes them."""
    yield [descent.outcome[name] for name in descent.outcome.dtype.names]
    yield descent.jam
    yield [len(descent.rebounds), len(descent.trajectory)]
    for table in (descent.rebounds, descent.trajectory, descent.contacts):
        yield from (table[name] for name in table.dtype.names if name != "contacts")


def assert_bits(cases: Sequence[Any], descents: Sequence[Descent], folder: Path) -> None:
    """In Node they have the bits of the descents, signs of zeros too; not of NaN, which no processor promises."""
    given, numbers = folder / "given", folder / "found"
    given.write_text(json.dumps(cases))
    in_node("kernels.mjs", given, numbers)
    found = np.frombuffer(numbers.read_bytes())
    expected = np.concatenate([np.asarray(part, float) for descent in descents for part in _numbers(descent)])
    same = (found.view(np.int64) == expected.view(np.int64)) | (np.isnan(found) & np.isnan(expected))
    assert same.all()


@pytest.mark.parametrize(("count", "seeds"), [(40, [1]), pytest.param(200, range(2, 27), marks=pytest.mark.slow)])
def test_descents_in_node_have_the_bits_of_python(count: int, seeds: Sequence[int], tmp_path: Path) -> None:
    """Oracle: ``simulate``, in all numbers of ledger, metrics, rebounds, trajectory."""
    for seed in seeds:
        cases = [_case(seed, number) for number in range(count)]
        descents = [simulate(*scene, settings, record="trajectory") for *scene, settings in cases]
        assert_bits([kernel.descent_input(*case) for case in cases], descents, tmp_path)
        assert sum(len(descent.rebounds) for descent in descents) > 2 * count  # there is something to compare


def _flown(number: int, rng: np.random.Generator) -> tuple[dict[str, Any], Descent]:
    """A ride with random trims over dips and crests: what the page is given, and how it ends."""
    body, law, slope, launch, settings = _case(7, 2 * number + 1)
    rotor, shortest = rng.uniform(1.0, 10.0), rng.choice([0.0, 0.1])
    ride = Ride(body, law, slope, launch, settings, record="trajectory", rotor_inertia=rotor, shortest_flight=shortest)
    ride.await_flight()
    spins = []
    while ride.status == "running":
        spins.append(rng.uniform(-2.0, 2.0))
        ride.trim(spins[-1])
        ride.hop()
    given = kernel.descent_input(body, law, slope, launch, settings)
    given["limits"]["shortest_flight"] = shortest
    return given | {"ride": {"rotor_inertia": rotor, "spins": spins}}, ride.descent()


def test_rides_in_a_page_have_the_bits_of_python(tmp_path: Path) -> None:
    """Oracle: ``Ride``, in every number of ledger, metrics, rebounds and trajectory."""
    rng = np.random.default_rng(11)
    cases, descents = zip(*(_flown(number, rng) for number in range(30)), strict=True)
    assert_bits(cases, descents, tmp_path)
    assert sum(len(case["ride"]["spins"]) for case in cases) > 60  # there is something to compare
