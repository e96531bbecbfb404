"""Random contacts, one touchdown state each: at two tolerances, and against springs integrated by scipy."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest

from sledenv.kernel.records import CHORD, JAMMED, LOG_FULL, NON_FINITE, STEP_BUDGET, TIMEOUT
from sledenv.simulation.bodies import Segment
from sledenv.simulation.outcomes import DescentBatch
from sledenv.simulation.scene import ContactLaw
from sledenv.simulation.settings import DEFAULT, Settings
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate_batch
from sledenv.simulation.support import lowest_arms
from tests import outline_oracle as oracle
from tests.bodies import rod, segment_by_share


class Contacts(NamedTuple):
    """Touchdowns of one body: one a lane."""

    body: Segment
    laws: np.ndarray  # (N, 5) fields of ContactLaw
    slopes: np.ndarray  # (N, 3) fields of Slope
    states: np.ndarray  # (N, 6) fields of State
    speeds: np.ndarray  # (N,) entry speed scale [m/s], as the solver takes it
    max_time: float  # [s]


def random_body(rng: np.random.Generator) -> Segment:
    """A disc, a rod or a segment, uniform or not; up to .9 of the way to the arc."""
    mass, radius = 10.0 ** rng.uniform(-1.0, 2.0), 10.0 ** rng.uniform(-2.0, 0.5)
    kind = rng.choice(["disc", "rod", "lamina", "segment"], p=[0.3, 0.05, 0.25, 0.4])
    if kind == "lamina":
        return circular_segment(mass, radius, rng.uniform(0.1, math.pi))
    if kind == "rod":
        return rod(mass, radius, mass * radius**2 * 10.0 ** rng.uniform(-1.5, 0.0))
    half_angle = rng.uniform(0.05, math.pi) if kind == "segment" else math.pi
    body = segment_by_share(mass, radius, rng.uniform(0.0, 0.9) * rng.choice([0.0, 1.0], p=[0.1, 0.9]), 1.0, half_angle)
    return body.replace(inertia=mass * (radius + body.eccentricity) ** 2 * 10.0 ** rng.uniform(-1.5, 0.0))


def random_contacts(n: int, lanes: int, seed: int) -> Iterator[Contacts]:
    """``n`` touchdowns, some with exact zeros of what can be zero, ``lanes`` of each body."""
    rng = np.random.default_rng(seed)

    def some(values: np.ndarray, *shares: tuple[float, float]) -> np.ndarray:
        factors, weights = zip(*shares, strict=True)
        return values * rng.choice(factors, lanes, p=weights)

    for _ in range(n // lanes):
        body = random_body(rng)
        size = body.radius + body.eccentricity
        per_mass = 10.0 ** rng.uniform(3.0, 9.0)  # [1/s^2] stiffness
        asymmetry = np.where(rng.random(lanes) < 0.1, 1.0 - 10.0 ** rng.uniform(-6.0, -1.0, lanes), rng.random(lanes))
        laws = np.stack(
            [
                np.full(lanes, per_mass * body.mass),
                some(asymmetry, (0.0, 0.1), (1.0, 0.9)),
                some(rng.uniform(0.0, 2.0, lanes), (0.0, 0.1), (0.2, 0.4), (1.0, 0.5)),
                some(size * 10.0 ** rng.uniform(-4.0, -0.5, lanes), (0.0, 0.3), (1.0, 0.7)),
                some(size * 10.0 ** rng.uniform(-4.0, -0.5, lanes), (0.0, 0.5), (1.0, 0.5)),
            ],
            axis=1,
        )
        angles = some(rng.uniform(-0.6, 0.6, lanes), (0.0, 0.2), (1.0, 0.8))
        gravity = some(np.full(lanes, 9.81), (0.0, 0.1), (1.0, 0.9))
        slopes = np.stack([angles, np.full(lanes, math.inf), gravity], axis=1)
        phi = rng.uniform(-math.pi, math.pi, lanes)
        edge = rng.choice([0.0, body.half_angle, -body.half_angle, math.pi], lanes)
        phi = np.where(rng.random(lanes) < 0.1, edge, phi)
        a, b = lowest_arms(body.record, phi)[1].T
        v_t = some(rng.normal(size=lanes), (0.0, 0.1), (0.01, 0.1), (1.0, 0.5), (5.0, 0.3))
        omega = some(rng.normal(size=lanes) / size, (0.0, 0.1), (0.01, 0.1), (1.0, 0.5), (5.0, 0.3))
        v_n = some(-np.abs(rng.normal(size=lanes)), (0.0, 0.03), (1e-9, 0.04), (1e-3, 0.13), (1.0, 0.5), (5.0, 0.3))
        zero = np.zeros(lanes)
        states = np.stack([zero, b, phi, v_t - b * omega, v_n + a * omega, omega], axis=1)
        speeds = np.max([np.abs(v_n), np.abs(v_t), size * np.abs(omega), np.sqrt(gravity * size), zero + 1e-12], axis=0)
        yield Contacts(body, laws, slopes, states, speeds, 20.0 * math.pi / math.sqrt(per_mass))


def followed(contacts: Contacts, tolerance: float = DEFAULT.tolerance) -> DescentBatch:
    """Each contact up to its separation, to rest, or to the end of the time."""
    body, laws, slopes, states, _, max_time = contacts
    return simulate_batch(
        body, laws, slopes, states, Settings(max_time=max_time, max_rebounds=1, tolerance=tolerance), keep_rebounds=True
    )


def outcomes(contacts: Contacts, tolerance: float = DEFAULT.tolerance) -> np.ndarray:
    return followed(contacts, tolerance).outcomes


def distances(contacts: Contacts, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Largest difference of two results: velocities by the entry speed, places by the size and what it covers.

    At least 1 where the endings differ.
    """
    size, speeds, time = contacts.body.radius + contacts.body.eccentricity, contacts.speeds, contacts.max_time
    units = {"u": speeds, "v": speeds, "omega": speeds / size}
    units |= {"t": time, "x": size + speeds * time, "phi": 1.0 + speeds * time / size}
    found = np.max([np.abs(one[name] - other[name]) / unit for name, unit in units.items()], axis=0)
    return np.where(one["status"] == other["status"], found, np.maximum(found, 1.0))


def spreads(contacts: Contacts, amount: float) -> np.ndarray:
    """Largest change of the results where a velocity or the height at entry changes by ``amount`` of its scale."""
    body, laws, _, states, speeds, _ = contacts
    size = body.radius + body.eccentricity
    here = outcomes(contacts)
    found = np.zeros(len(states))
    for column, unit in ((1, speeds * np.sqrt(body.mass / laws[:, 0])), (3, speeds), (4, speeds), (5, speeds / size)):
        for sign in (1.0, -1.0) if column > 1 else (1.0,):
            moved = states.copy()
            moved[:, column] += sign * amount * unit
            found = np.maximum(found, distances(contacts, here, outcomes(contacts._replace(states=moved))))
    return found


def chosen(contacts: Contacts, lanes: np.ndarray) -> Contacts:
    """Some of the touchdowns."""
    body, laws, slopes, states, speeds, max_time = contacts
    return Contacts(body, laws[lanes], slopes[lanes], states[lanes], speeds[lanes], max_time)


def assert_as_close_as_the_entry_allows(
    contacts: Contacts, found: np.ndarray, other: np.ndarray, error: float, most: np.ndarray | float = 100.0
) -> None:
    """The results differ by so many errors at most, or by 100 times what such an error of the entry changes."""
    apart = distances(contacts, found, other)
    far = np.flatnonzero(~(apart <= most * error))
    if len(far):
        some = chosen(contacts, far)
        worst = apart[far] / (100.0 * spreads(some, error))
        i = int(np.argmax(worst))
        assert worst[i] <= 1.0, (some.body, some.laws[i].tolist(), some.slopes[i].tolist(), some.states[i].tolist())


def on_the_chord(n: int, seed: int) -> Iterator[Contacts]:
    """Segments with the chord down, one corner at the slope and coming down, many with exact zeros."""
    rng = np.random.default_rng(seed)

    def some(value: float, share: float) -> float:
        return 0.0 if rng.random() < share else float(value)

    def log(low: float, high: float) -> float:
        return float(low * (high / low) ** rng.random())

    for _ in range(n):
        body = circular_segment(log(3.0, 300.0), log(0.1, 2.0), math.radians(rng.uniform(15.0, 165.0)))
        law = ContactLaw.from_restitution(
            1.0 - some(rng.uniform(0.0, 0.9), 0.05),
            stiffness=log(1e6, 1e9),
            friction=some(rng.uniform(0.0, 1.0), 0.25),
            rolling_arm=0.01,
            corner_rolling_arm=some(rng.uniform(0.0, 0.02), 0.5),
        )
        steep = 0.05 * rng.random() if rng.random() < 0.5 else log(1e-5, 0.05)
        phi = rng.choice([-1.0, 1.0]) * (math.pi - some(steep, 0.1))
        a, b = lowest_arms(body.record, np.array([phi]))[1][0]
        omega, u = some(rng.uniform(-3.0, 3.0), 0.15), some(rng.uniform(-6.0, 6.0), 0.15)
        state = np.array([[0.0, b, phi, u, a * omega - log(0.05, 4.0), omega]])
        slope = np.array([[some(rng.uniform(0.0, 0.4), 0.2), math.inf, 9.81]])
        yield Contacts(body, np.array([law]), slope, state, np.array([max(np.hypot(u, state[0, 4]), 1e-3)]), 1.0)


def away_from_edges(n: int, lanes: int, seed: int) -> Iterator[Contacts]:
    """Random touchdowns for two periods, without those that graze or begin at an edge."""
    for drawn in random_contacts(n, lanes, seed):
        body, states = drawn.body, drawn.states
        a = lowest_arms(body.record, states[:, 2])[1][:, 0]
        closing = states[:, 4] - a * states[:, 5] < -1e-6 * drawn.speeds
        edge = np.isin(np.abs(states[:, 2]), (body.half_angle, math.pi))
        some = np.flatnonzero(closing & ~edge)
        if len(some):
            yield chosen(drawn, some)._replace(max_time=0.2 * drawn.max_time)


LOOSE = 1e-10
SURVEYS = [(6, 100), pytest.param(1000, 1000, marks=[pytest.mark.slow, pytest.mark.jit_only])]


@pytest.mark.parametrize(("bodies", "lanes"), SURVEYS)
def test_a_contact_does_not_depend_on_the_tolerance(bodies: int, lanes: int) -> None:
    """Oracle: the same contact with longer steps, which find their events in other places; no status of a failure.

    The tolerance is that of a step. A body that swings on its corner makes hundreds of them, and nothing damps what
    their errors add up to.
    """
    for contacts in random_contacts(bodies * lanes, lanes, seed=2):
        tight, loose = outcomes(contacts), outcomes(contacts, LOOSE)
        assert not np.isin([tight["status"], loose["status"]], (STEP_BUDGET, NON_FINITE)).any()
        most = np.maximum(100.0, 2.0 * loose["steps"])
        apart = distances(contacts, tight, loose)
        far = np.flatnonzero(~(apart <= most * LOOSE))
        if len(far):  # a grazing touch may end on either side, and so may a body pressed in as deep as it is thick
            worse = apart[far] > 100.0 * spreads(chosen(contacts, far), LOOSE)
            assert np.count_nonzero(worse) <= max(1, len(apart) // 50)


@pytest.mark.parametrize("phi", [1.5353, -1.5353])
@pytest.mark.parametrize("omega", [7.4e-4, -7.4e-4])
def test_a_body_that_grazes_without_weight_stays_at_the_surface(phi: float, omega: float) -> None:
    """Oracle: the mass centre of a disc follows b(phi); turning alone presses it on, by less than rounding tells."""
    radius, eccentricity = 1.336, 0.74
    body = Segment(0.122, radius, eccentricity, 0.058, math.pi)
    a, b = lowest_arms(body.record, np.array([phi]))[1][0]
    laws, slopes = np.array([[3341.0, 0.37, 0.0, 0.0, 0.0]]), np.array([[0.128, math.inf, 0.0]])
    states = np.array([[0.0, b, phi, 0.65, a * omega, omega]])
    found = followed(Contacts(body, laws, slopes, states, np.array([0.65]), 0.38))
    end = found.outcomes[0]
    assert end["status"] == TIMEOUT
    assert end["y"] == pytest.approx(radius - eccentricity * math.cos(end["phi"]), abs=1e-13)
    load = eccentricity * math.cos(phi) * omega**2 / (1.0 / body.mass + a**2 / body.inertia)
    assert found.rebounds["normal_impulse"][0, 0] == pytest.approx(load * 0.38, rel=0.02)


ENDINGS = {"rebounds": LOG_FULL, "rest": JAMMED, "max_time": TIMEOUT}


def integrated(contacts: Contacts, lane: int) -> oracle.Descent:
    """One of the contacts, by the oracle."""
    body, laws, slopes, states, _, max_time = contacts
    arcs = tuple(oracle.Arc(*arc[:4], bool(arc.corner)) for arc in body.arcs)
    case = oracle.Case(
        oracle.Body(body.mass, body.inertia, arcs),
        oracle.Law(*laws[lane]),
        oracle.Slope(slopes[lane, 0], slopes[lane, 2]),
        oracle.State(*states[lane]),
    )
    return oracle.follow_compliant(case, max_rebounds=1, max_time=max_time)


@pytest.mark.jit_only
@pytest.mark.parametrize("count", [18, pytest.param(2000, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("near", "error"), [(False, 1e-12), (True, 3e-9)], ids=["any", "on the chord"])
def test_a_contact_is_that_of_springs(count: int, near: bool, error: float) -> None:
    """Oracle: tests/outline_oracle.py. Both ends that stick at different depths slip by that difference times the spin.

    How it ends, velocities, places, and when and where a body comes to lie on its chord.
    """
    seen: Counter[str] = Counter()
    unsupported = 0
    for contacts in on_the_chord(count, seed=8) if near else away_from_edges(count, 2, seed=5):
        batch = followed(contacts)
        for lane in range(len(contacts.states)):
            try:
                wanted = integrated(contacts, lane)
            except oracle.Unsupported:  # three points at once
                unsupported += 1
                continue
            one, found = chosen(contacts, np.array([lane])), batch.outcomes[lane : lane + 1]
            expected = found.copy()
            expected["t"], expected["status"] = wanted.time, ENDINGS[wanted.end]
            for name in ("x", "phi", "u", "v", "omega"):
                expected[name] = getattr(wanted.state, name)
            assert_as_close_as_the_entry_allows(one, found, expected, error)
            contact = wanted.rebounds[0]
            lies = [found[name][0] for name in ("t_on_chord", "x_on_chord")]
            assert lies == pytest.approx(contact.lies, abs=1e-8)
            if contact.both:
                assert batch.rebounds[lane, 0]["feature"] == CHORD
            seen.update((wanted.end, "two points" if contact.both else "one point"))
    assert unsupported <= 0.03 * count
    if near:
        assert min(seen[key] for key in ("rebounds", "rest", "max_time", "two points", "one point")) > 0
