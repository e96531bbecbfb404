"""The kernel for pages computes what Python does, bit for bit."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sledenv.kernel.entries import LIBRARY
from sledenv.pages import kernel
from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.ride import Ride
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.settings import DEFAULT, Settings
from sledenv.simulation.shapes import circular_segment, hull, polygon
from sledenv.simulation.simulate import simulate
from sledenv.simulation.sleds import sled
from sledenv.simulation.support import support_height
from tests.bodies import rod
from tests.profiles import random_case

NODE = shutil.which("node")
RUNNER, SCRIPT = Path(__file__).with_name("kernels.mjs"), kernel.KERNEL.parent / "templates/kernel.js"
needs_node = pytest.mark.skipif(NODE is None, reason="needs node, which runs WebAssembly (Debian: nodejs)")
REMAKE = "the kernel has other sources than kernel.wasm: make wasm, and commit what it writes"


def in_node(given: bytes, folder: Path) -> np.ndarray:
    """Numbers that the kernel for pages gives in Node."""
    assert NODE is not None
    given_file, found = folder / "given", folder / "found"
    given_file.write_bytes(given)
    command = [NODE, RUNNER, SCRIPT, kernel.KERNEL, given_file, found]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert not done.returncode, done.stderr
    return np.frombuffer(found.read_bytes())


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


def _body(rng: np.random.Generator) -> Body:
    """A sled with its rider, a hull, a polygon, a segment, a rod or a disc."""
    mass, size = rng.uniform(1.0, 120.0), rng.uniform(0.1, 1.0)
    match rng.integers(6):
        case 0:
            return sled(rider_mass=rng.uniform(50.0, 100.0), balance=rng.uniform(-0.3, 0.3))
        case 1:
            angles = np.arange(4) * math.tau / 4.0 + rng.uniform(0.0, 1.0, 4)
            circles = [(size * math.cos(t), size * math.sin(t), size * rng.uniform(0.02, 0.3)) for t in angles]
            return hull(mass, circles, inertia=mass * size**2 * rng.uniform(0.3, 1.0), centre=(0.0, 0.0))
        case 2:
            angles = np.sort(rng.uniform(0.0, math.tau / 5.0, 5)) * 0.8 + np.arange(5) * math.tau / 5.0
            corners = [(size * math.cos(angle), size * math.sin(angle)) for angle in angles]
            return polygon(mass, corners, rounding=rng.choice([0.0, 0.02]) * size)
        case 3:
            return circular_segment(mass, size, rng.uniform(0.3, math.pi))
        case 4:
            return rod(mass, size, mass * size**2 * rng.uniform(0.1, 0.5))
        case _:
            return segment(mass, size, size * rng.uniform(0.0, 0.8), mass * size**2)


def _case(rng: np.random.Generator) -> tuple[Body, ContactLaw, Slope, State, Settings]:
    """A random descent."""
    body = _body(rng).replace(drag_area=rng.choice([0.0, 10.0 ** rng.uniform(-3.0, 1.0)]))
    arm = rng.choice([0.0, 1e-3, 1e-2])
    friction = rng.choice([0.0, rng.uniform(0.0, 0.8)])
    law = ContactLaw(10.0 ** rng.uniform(4.0, 7.5), rng.uniform(0.0, 0.95), friction, arm)
    edges = np.sort(rng.uniform(0.0, 8.0, 4)).tolist()
    zones = [Zone(*edges[2 * k : 2 * k + 2], rng.uniform(0.0, 0.6), arm) for k in range(rng.integers(3))]
    own = {"restitution": rng.uniform(0.1, 1.0), "stiffness": 10.0 ** rng.uniform(4.0, 7.5)}
    zones = [zone._replace(**own) if k == 0 else zone for k, zone in enumerate(zones)]
    slope = Slope(rng.uniform(-0.1, 0.5), rng.uniform(8.0, 15.0), zones=zones)
    phi = rng.uniform(-math.pi, math.pi)
    height = support_height(body, phi) + rng.uniform(0.01, 1.0)
    velocity = rng.uniform([-1.0, -3.0, -8.0], [8.0, 1.0, 8.0])
    solver = rng.choice(["compliant", "rigid"], p=[0.6, 0.4])
    settings = Settings(solver=str(solver), max_time=4.0, max_rebounds=40, run_out=float(rng.choice([0.0, 2.0])))
    return body, law, slope, State(0.0, height, phi, *velocity.tolist()), settings


def _ride(seed: int, number: int) -> tuple[Body, ContactLaw, Slope, State, Settings]:
    """A random descent over dips, crests and zones; some vertices are sharp, some round."""
    case, rng = random_case((seed, number), zoned=True, planes=False), np.random.default_rng((seed, number, 1))
    count = len(case.slope.profile)
    slope = case.slope._replace(rounding=(rng.random(count) < rng.random()) * 10.0 ** rng.uniform(-2.0, 1.0, count))
    launch = case.launch._replace(y=case.launch.y + 0.5)  # over dips that are less deep now
    return case.body, case.law, slope, launch, Settings(max_time=3.0, max_rebounds=40)


def _numbers(descent: Descent) -> Iterator[Any]:
    """All numbers of a descent, in the order in which the runner writes them."""
    yield [descent.outcome[name] for name in descent.outcome.dtype.names]
    yield descent.jam
    yield [len(descent.rebounds), len(descent.trajectory)]
    for table in (descent.rebounds, descent.trajectory, descent.contacts):
        yield from (table[name] for name in table.dtype.names if name != "contacts")


def assert_bits(found: np.ndarray, descents: Sequence[Descent]) -> None:
    """The bits are those of the descents, signs of zeros too; but not of NaN, whose bits no processor promises."""
    expected = np.concatenate([np.asarray(part, float) for descent in descents for part in _numbers(descent)])
    same = (found.view(np.int64) == expected.view(np.int64)) | (np.isnan(found) & np.isnan(expected))
    assert same.all()


@needs_node
@pytest.mark.jit_only
@pytest.mark.parametrize(("count", "seeds"), [(40, [1]), pytest.param(200, range(2, 27), marks=pytest.mark.slow)])
def test_descents_in_node_have_the_bits_of_python(count: int, seeds: Sequence[int], tmp_path: Path) -> None:
    """Oracle: ``simulate``, in all numbers of ledger, metrics, rebounds, trajectory; a fifth of them over profiles."""
    for seed in seeds:
        rng = np.random.default_rng(seed)
        cases = [_case(rng) if number % 5 else _ride(seed, number) for number in range(count)]
        found = in_node(json.dumps([kernel.descent_input(*case) for case in cases]).encode(), tmp_path)
        descents = [simulate(*scene, settings, record="trajectory") for *scene, settings in cases]
        assert_bits(found, descents)
        assert sum(len(descent.rebounds) for descent in descents) > 2 * count  # there is something to compare


def _flown(number: int, rng: np.random.Generator) -> tuple[dict[str, Any], Descent]:
    """A ride with random trims over dips and crests: what the page is given, and how it ends."""
    body, law, slope, launch, settings = _ride(7, number)
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


@needs_node
@pytest.mark.jit_only
def test_rides_in_a_page_have_the_bits_of_python(tmp_path: Path) -> None:
    """Oracle: ``Ride``, in every number of ledger, metrics, rebounds and trajectory."""
    rng = np.random.default_rng(11)
    cases, descents = zip(*(_flown(number, rng) for number in range(30)), strict=True)
    found = in_node(json.dumps(cases).encode(), tmp_path)
    assert_bits(found, descents)
    assert sum(len(case["ride"]["spins"]) for case in cases) > 60  # there is something to compare


def test_default_limits_travel_with_the_kernel() -> None:
    """Oracle: the default settings; infinities are strings there."""
    told = kernel.told(kernel.KERNEL.read_bytes())["limits"]
    assert {name: float(value) for name, value in told.items()} == DEFAULT.limits._asdict()
