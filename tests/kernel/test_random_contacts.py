"""Random contacts, one touchdown state each: at two tolerances, and against an independent method."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest

from sledenv.kernel.records import CHORD, JAMMED, LOG_FULL, NON_FINITE, STEP_BUDGET, TIMEOUT
from sledenv.simulation.bodies import Segment, segment
from sledenv.simulation.outcomes import DescentBatch
from sledenv.simulation.settings import DEFAULT, Settings
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate_batch
from sledenv.simulation.support import lowest_arms
from tests import extrapolation
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


LOOSE = 1e-10
PRECISION = 1e-12  # of the oracle


SURVEYS = [(50, 100), pytest.param(1000, 1000, marks=[pytest.mark.slow, pytest.mark.jit_only])]


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


ENDINGS = {
    extrapolation.SEPARATED: LOG_FULL,
    extrapolation.TIMEOUT: TIMEOUT,
    extrapolation.JAMMED: JAMMED,
}


def integrated(contacts: Contacts) -> tuple[np.ndarray, np.ndarray]:
    """Codes of how the contacts end, and the results, by extrapolation."""
    body, laws, slopes, states, _, max_time = contacts
    codes, found = np.zeros(len(states), int), outcomes(contacts)
    for i, (law, slope, (_, _, phi, u, v, omega)) in enumerate(zip(laws, slopes, states, strict=True)):
        p = np.array([*(getattr(body, name) for name in Segment.fields), *law, slope[0], slope[2]])
        entry = np.array([0.0, phi, 0.0, u, v, omega])
        codes[i], t, (x, phi, _, u, v, omega) = extrapolation.contact(p, entry, max_time, 1.0)
        for name, value in {"t": t, "x": x, "phi": phi, "u": u, "v": v, "omega": omega}.items():
            found[name][i] = value
    found["status"] = [ENDINGS.get(code, -1) for code in codes]
    return codes, found


@pytest.mark.jit_only
@pytest.mark.parametrize(("bodies", "lanes"), [(40, 5), pytest.param(1000, 12, marks=pytest.mark.slow)])
def test_a_contact_is_that_of_an_independent_method(bodies: int, lanes: int) -> None:
    """Oracle: extrapolated midpoint rule and trial of all branches, tests/extrapolation.py, for two periods.

    Without touchdowns that graze or begin at an edge. Where two points touch, both corners or a corner and the far end
    of the arc of a body that is buried, the oracle says no more than that.
    """
    compared = undecided = 0
    for drawn in random_contacts(bodies * lanes, lanes, seed=5):
        body, states = drawn.body, drawn.states
        a = lowest_arms(body.record, states[:, 2])[1][:, 0]
        closing = states[:, 4] - a * states[:, 5] < -1e-6 * drawn.speeds
        edge = np.isin(np.abs(states[:, 2]), (body.half_angle, math.pi))
        contacts = chosen(drawn, np.flatnonzero(closing & ~edge))._replace(max_time=0.2 * drawn.max_time)
        batch = followed(contacts)
        codes, expected = integrated(contacts)
        decided = codes != extrapolation.UNDECIDED
        undecided += np.count_nonzero(~decided)
        both = codes == extrapolation.BOTH_CORNERS
        two = (batch.rebounds[:, 0]["feature"] == CHORD) | (batch.status == "buried")
        assert np.array_equal(two[decided], both[decided])
        same = np.flatnonzero(decided & ~both)
        compared += len(same)
        assert_as_close_as_the_entry_allows(chosen(contacts, same), batch.outcomes[same], expected[same], PRECISION)
    assert compared > 0.8 * bodies * lanes
    assert undecided < 0.002 * bodies * lanes


def contact_of(body: Segment, law: tuple[float, ...], slope: tuple[float, float], state: tuple[float, ...]) -> Contacts:
    """One touchdown, for ten periods."""
    speed = max(abs(value) for value in state[3:5])
    columns = (np.array([row]) for row in (law, (slope[0], math.inf, slope[1]), (0.0, *state[1:])))
    return Contacts(body, *columns, np.array([speed]), 20.0 * math.pi * math.sqrt(body.mass / law[0]))


SEGMENT = segment(2.203875383780148, 0.010307818127086013, 0.0, 3.389284127863658e-05, 1.7303834323101066)
NEARLY_A_DISC = segment(
    1.518510633770974, 0.011772303248635032, 5.260297408156035e-06, 0.00010517633874891525, 3.0130853945865574
)
ROLLING = segment(6.455217403349629, 0.576492413255222, 0.16732821121858368, 2.8764746066912794, 2.43658542980601)
UPRIGHT = segment(0.3330875857855089, 0.010893069804946112, 0.005322540923221938, 4.099292211189562e-05)
EDGE = segment(0.2128210113346139, 0.28885731419792515, 0.1913113516140024, 0.004029803503108958, 0.9027148010775059)
FLAT = segment(44.164223759245914, 2.2359848567921947, 1.1727898155485408, 23.960096893995317, 1.3023432632328806)

LEVEL = segment(42.916911759718246, 0.2909479602146949, 0.25609324238852105, 0.279497072002727, 0.6449766730856418)
DEEP = segment(86.10380659002807, 0.021046605817784822, 0.0067030239217833335, 0.004883270027284517, 3.0222596560554913)
SLIDER = segment(7.853537137303034, 2.0642428024176285, 0.34124836921944557, 14.398470358559983, 2.109608617588168)


@pytest.mark.parametrize(
    ("body", "law", "slope", "state"),
    [
        pytest.param(
            SEGMENT,
            (2886.238693032883, 0.951302593248404, 1.1922800225332297, 2.0514194065547344e-05, 0.0),
            (0.0, 9.81),
            (
                0.0,
                0.010307818127086013,
                1.1201322404410927,
                0.5893143783758924,
                -0.002288198627842114,
                -57.0543246627548,
            ),
            id="the near corner comes down after the body has passed its middle",
        ),
        pytest.param(
            NEARLY_A_DISC,
            (49362.17421798464, 0.16259466373863118, 0.38837541971498446, 0.00037655533465540234, 0.0),
            (0.4663531079661519, 0.0),
            (0.0, 0.01177243099399622, 1.595083531673982, -4.3368358652415795, -0.6943443747876411, 116.43490551361835),
            id="the series of the sine converges less than those of the velocities",
        ),
        pytest.param(
            ROLLING,
            (605029293.7345995, 0.27647646115294544, 1.5075611552365904, 0.17063114971410476, 0.0014344758426233254),
            (0.0, 9.81),
            (
                0.0,
                0.6119681308884724,
                -1.7844304194280014,
                1.27978831563119e-05,
                -5.761177819737343,
                -2.091266278479492e-05,
            ),
            id="a rolling touchdown with hardly any drive",
        ),
        pytest.param(
            UPRIGHT,
            (556612.5853030714, 0.01081495289102996, 0.0, 5.399291687916829e-06, 0.0),
            (0.0, 9.81),
            (0.0, 0.005570528881724174, 0.0, 0.023572704861973808, -0.0006396372536761728, -4.231681652223595),
            id="drive and force of the slip both grow from zero",
        ),
        pytest.param(
            EDGE,
            (10638.428556875639, 0.016964362416300394, 0.24403217535240396, 0.0, 0.025893764486452614),
            (0.0, 9.81),
            (
                0.0,
                0.17480583366269833,
                -0.932950431198174,
                -0.17192191931786588,
                -0.2928605818219166,
                2.020239171830678,
            ),
            id="the gap rate starts from zero",
        ),
        pytest.param(
            FLAT,
            (11534817632.752542, 0.0, 0.40103221703813796, 0.024947417737184757, 0.047063800579265014),
            (-0.22647606394420677, 0.0),
            (0.0, 0.5797166872023234, math.pi, 3.4844388522311798, -6.164667120368964e-10, 0.0),
            id="a flat landing that hardly presses",
        ),
        pytest.param(
            LEVEL,
            (
                524078247.11018515,
                0.7004022283320812,
                0.17325002824700086,
                0.00025262689238709065,
                0.024172214518149677,
            ),
            (-0.11395947839999027, 0.0),
            (0.0, 0.023592714967093135, math.pi, -0.002013995262202715, -0.5323754807530292, 0.0),
            id="both corners leave with all slack gone",
        ),
        pytest.param(
            DEEP,
            (3227025.579627771, 0.35979604124780196, 1.8891408880309266, 1.1411582149329828e-05, 0.001537076052072069),
            (0.0, 9.81),
            (0.0, 0.02543800630189369, -2.285160563863186, -3.2884640354839565, -6.618144356726748, 61.737239966895956),
            id="hand-overs between arc and corner accumulate",
        ),
        pytest.param(
            SLIDER,
            (1659319947.2736757, 0.49720302999707566, 1.8764680282059416, 0.2300291802828638, 0.0),
            (-0.093340820030972, 9.81),
            (
                0.0,
                1.8007953547832267,
                0.6887975492227802,
                4.526351347119479,
                -0.8214004823717983,
                -2.6414472657380497,
            ),
            id="the search for the end of the slip stands still where there is none",
        ),
    ],
)
def test_touchdowns_that_are_easily_misjudged(
    body: Segment, law: tuple[float, ...], slope: tuple[float, float], state: tuple[float, ...]
) -> None:
    """Oracle: the same contact with longer steps; each of these once ended elsewhere, or not at all."""
    contacts = contact_of(body, law, slope, state)
    tight, loose = outcomes(contacts), outcomes(contacts, LOOSE)
    assert tight["status"] in (LOG_FULL, TIMEOUT, JAMMED)
    assert distances(contacts, tight, loose)[0] <= 300.0 * LOOSE
