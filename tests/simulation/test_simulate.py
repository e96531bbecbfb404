"""Whole descents: the ledger closes, symmetries hold bit for bit, endings are exact, bad input simulates nothing."""

from __future__ import annotations

import math
import sys
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import sledenv
from sledenv import Settings
from sledenv.kernel.records import STATUS_OF_CODE, Feature, Mode, Status
from sledenv.scenarios.scenario import Given, load_scenario, scenario_names
from sledenv.simulation import simulate as simulate_module
from sledenv.simulation import simulator as simulator_module
from sledenv.simulation.bodies import Segment, segment
from sledenv.simulation.checks import limits_of
from sledenv.simulation.jam import DescentJam
from sledenv.simulation.lanes import new_logs
from sledenv.simulation.outcomes import Descent, DescentBatch
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate, simulate_batch, simulate_blocks
from sledenv.simulation.simulator import Simulator
from sledenv.simulation.support import support_height, within_a_turn
from tests import audit_geometry
from tests.bodies import rod, segment_by_share

DISC = segment(1.0, 0.1, 0.05, 7.5e-3)
SEGMENT = circular_segment(2.0, 0.5, math.radians(110.0))
ROD = rod(1.0, 0.4, 0.02)
LAW = ContactLaw(1e6, 0.5, 0.1, 0.001)
ICE = ContactLaw(1e6, 0.3, 0.03, 0.0)
INCLINE = Slope(0.2, 10.0, 9.81)
LAUNCH = State(0.0, 0.6, 0.5, 1.0, 0.0, -3.0)


def rounded(low: float, high: float) -> st.SearchStrategy[float]:
    """Multiples of 1e-6, for nothing physical depends on a number of 1e-70."""
    return st.integers(round(low * 1e6), round(high * 1e6)).map(lambda n: n * 1e-6)


bodies = st.one_of(
    st.sampled_from([DISC, SEGMENT, ROD, segment(1.0, 0.1, 0.0, 5e-3), segment(1.0, 0.1, 0.1, 0.01, 2.5)]),
    rounded(0.3, 3.0).map(lambda half_angle: circular_segment(2.0, 0.3, half_angle)),
    st.builds(
        lambda share, inertia, half_angle: segment_by_share(1.0, 0.5, share, inertia, half_angle),
        rounded(0.0, 1.0),
        rounded(0.02, 0.3),
        rounded(0.3, 3.14),
    ),
)
laws = st.builds(
    ContactLaw,
    st.sampled_from([1e4, 1e6, 1e7]),
    st.one_of(st.just(0.0), rounded(0.0, 0.95)),
    st.one_of(st.just(0.0), rounded(0.01, 3.0)),
    st.one_of(st.just(0.0), rounded(1e-4, 0.1)),
    st.one_of(st.just(0.0), rounded(1e-4, 0.02)),
)
slopes = st.builds(
    Slope,
    st.one_of(st.just(0.0), rounded(-0.3, 1.0)),
    st.sampled_from([math.inf, 2.0]),
    st.sampled_from([9.81, 9.81, 0.0]),
    st.just(()),
    st.just(()),
    st.just(0.0),
    st.sampled_from([1.2, 0.0]),
)
velocities = st.one_of(st.just(0.0), rounded(-5.0, 5.0))
spins = st.one_of(st.just(0.0), rounded(-20.0, 20.0), rounded(-200.0, 200.0))
launches = st.tuples(rounded(0.0, 1.0), rounded(-7.0, 7.0), velocities, velocities, spins)


def launched(body: Segment, launch: tuple[float, float, float, float, float]) -> State:
    """State whose lowest point has the given clearance (clearance, phi, u, v, omega)."""
    clearance, phi, u, v, omega = launch
    return State(0.0, clearance + support_height(body, phi), phi, u, v, omega)


def assert_same(one: Descent, other: Descent) -> None:
    """Compare two descents bit for bit."""
    assert one.outcome == other.outcome
    assert np.array_equal(one.rebounds, other.rebounds)
    assert np.array_equal(one.trajectory, other.trajectory)


# --- energy -----------------------------------------------------------------------------------------------------------


@given(bodies, laws, slopes, launches)
def test_the_energy_ledger_closes_and_no_loss_is_negative(
    body: Segment, law: ContactLaw, slope: Slope, launch: Any
) -> None:
    """Oracle: conservation of energy to 1e-10 of what was turned over; the second law, for each rebound too."""
    assume(launch[0] > 0.0 or law.asymmetry > 0.0)  # see test_a_graze_without_hysteresis_is_not_a_trap
    descent = simulate(body, law, slope, launched(body, launch), max_time=3.0, max_rebounds=200)
    scale = descent.energy.turnover
    assert descent.status not in (Status.RUNNING, Status.STEP_BUDGET, Status.NON_FINITE)
    assert abs(descent.energy.residual) <= 1e-10 * scale + 1e-14
    losses = descent.rebounds[["loss_hysteresis", "loss_sliding", "loss_rolling"]].tolist()
    assert min((value for row in losses for value in row), default=0.0) >= -1e-15 * (scale + 1e-3)
    total = [sum(row[i] for row in losses) for i in range(3)]
    ledger = descent.energy
    assert total == pytest.approx([ledger.hysteresis, ledger.sliding, ledger.rolling], rel=1e-12, abs=1e-300)
    if law.asymmetry == 0.0:
        assert ledger.hysteresis == 0.0
    if law.friction == 0.0:
        assert ledger.sliding == 0.0
    if law.rolling_arm == law.corner_rolling_arm == 0.0:
        assert ledger.rolling == 0.0
    assert ledger.lost == ledger.hysteresis + ledger.sliding + ledger.rolling
    assert ledger.stored >= 0.0
    assert descent.time <= 3.0


@pytest.mark.parametrize(
    ("angle", "lean", "clearance"),
    [(0.0, 1e-15, 1e-5), (1e-58, 0.3, 1e-5), (0.0, 0.0, 0.0)],
    ids=["tip", "slope", "graze"],
)
def test_what_hardly_moves_is_not_a_trap(angle: float, lean: float, clearance: float) -> None:
    """Oracle: a rod without losses falls over, however slightly it leans; one set down upright springs for ever."""
    launch = launched(ROD, (clearance, 0.5 * math.pi + lean, 0.0, 0.0, 0.0))
    for friction in (0.0, 1.0):
        end = simulate(ROD, ContactLaw(1e6, 0.0, friction, 0.0), Slope(angle), launch, max_time=1.0)
        assert end.status in (Status.TIMEOUT, Status.LOG_FULL)


@pytest.mark.parametrize("body", [DISC, SEGMENT])
def test_the_ledger_is_that_of_launch_and_end(body: Segment) -> None:
    """Oracle: kinetic and potential energy written out, zero at x = 0, y = 0; the spring at the end."""
    slope = Slope(0.3, math.inf, 9.81)
    launch = State(0.2, 1.0, 0.4, 2.0, -1.0, 3.0)
    end = simulate(body, LAW, slope, launch, max_time=0.5)

    def kinetic(s: State) -> float:
        return 0.5 * body.mass * (s.u**2 + s.v**2) + 0.5 * body.inertia * s.omega**2

    def potential(s: State) -> float:
        return body.mass * 9.81 * (s.y * math.cos(0.3) - s.x * math.sin(0.3))

    assert end.energy.initial == pytest.approx(kinetic(launch) + potential(launch), rel=1e-14)
    assert end.energy.kinetic == pytest.approx(kinetic(end.state), rel=1e-14)
    assert end.energy.potential == pytest.approx(potential(end.state), rel=1e-14)
    lowest = min(support_height(body, 0.0), support_height(body, math.pi))
    drop = 9.81 * body.mass * ((1.0 - lowest) * math.cos(0.3) + (end.state.x - 0.2) * math.sin(0.3))
    assert end.energy.supplied == pytest.approx(kinetic(launch) + drop, rel=1e-14)


def test_a_body_that_stops_in_compression_has_energy_stored() -> None:
    """Oracle: c (1 + Delta) x^2/2, at the time of greatest compression of a vertical impact without gravity."""
    wheel = segment(2.0, 0.1, 0.0, 0.01)
    quarter = 0.5 * math.pi / math.sqrt(1.5e6 / 2.0)
    end = simulate(wheel, LAW, Slope(0.0, math.inf, 0.0), State(0.0, 0.1, 0.0, 0.0, -3.0), max_time=quarter)
    assert end.status == Status.TIMEOUT
    assert end.energy.stored == pytest.approx(0.5 * 2.0 * 9.0, rel=1e-12)
    assert abs(end.state.v) < 1e-12


# --- symmetry ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("half_angle", [0.4, 1.4, 1.5, 2.5])
def test_a_body_that_falls_flat_comes_to_lie_on_its_chord(half_angle: float) -> None:
    """Oracle: symmetry: both corners strike at once, again and again, and it loses energy each time."""
    body = circular_segment(2.0, 0.3, half_angle)
    for phi, clearance in ((math.pi, 0.0), (-math.pi, 0.1), (math.pi, 0.3)):
        launch = launched(body, (clearance, phi, 0.0, 0.0, 0.0))
        end = simulate(body, ContactLaw(1e6, 0.85, 0.3, 0.0), Slope(0.0), launch, max_time=3.0)
        assert (end.status, end.state.phi) == (Status.JAMMED, phi)
        assert end.outcome["t_on_chord"] <= end.time


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
@pytest.mark.parametrize("phi", [3.2, -1e6, 1e12, -1e300])
def test_whole_turns_at_the_launch_cost_no_accuracy(phi: float, solver: Any) -> None:
    """Oracle: the ledger closes as for phi in [-pi, pi]; so it is for every way to simulate, with the same result."""
    launch, turned = State(0.0, 0.6, phi, 1.0, 0.0, -3.0), float(within_a_turn(np.array(phi)))
    descent = simulate(DISC, ICE, INCLINE, launch, solver=solver)
    assert abs(descent.energy.residual) <= 1e-12 * descent.energy.turnover
    assert descent.launch.phi == turned
    assert_same(descent, simulate(DISC, ICE, INCLINE, launch._replace(phi=turned), solver=solver))
    assert simulate_batch(DISC, ICE, INCLINE, [launch], solver=solver).outcomes[0] == descent.outcome


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_an_orientation_less_its_turns_is_as_exact_as_it_was(phi: float) -> None:
    """Oracle: phi modulo 2 pi in 400 digits; a double is known to half of the distance to the next."""
    turned = float(within_a_turn(np.array(phi)))
    assert abs(turned) <= math.pi
    assert turned == -float(within_a_turn(np.array(-phi)))
    if abs(phi) <= math.pi:
        assert turned == phi
    with mpmath.workdps(400):
        turns = (mpmath.mpf(phi) - turned) / (2 * mpmath.pi)
        assert abs(turns - mpmath.nint(turns)) * 2 * mpmath.pi <= 0.6 * math.ulp(phi)


@given(bodies, laws, launches, st.floats(-100.0, 100.0))
def test_on_an_endless_slope_the_place_does_not_matter(
    body: Segment, law: ContactLaw, launch: Any, shift: float
) -> None:
    """Oracle: translation invariance: all but x bit for bit, x up to rounding."""
    slope = Slope(0.3)
    state = launched(body, launch)
    one = simulate(body, law, slope, state, max_time=2.0, max_rebounds=50)
    other = simulate(body, law, slope, state._replace(x=shift), max_time=2.0, max_rebounds=50)
    assert one.status == other.status
    assert one.state[1:] == other.state[1:]
    assert other.state.x - one.state.x == pytest.approx(shift, abs=1e-11)
    for name in one.rebounds.dtype.names:
        if name not in ("x", "x_contact"):
            assert np.array_equal(one.rebounds[name], other.rebounds[name]), name


@pytest.mark.parametrize("phi", [0.3, 2.0, -1.0])
def test_a_conservative_descent_runs_backwards(phi: float) -> None:
    """Oracle: time reversal: without losses the reversed end state leads back to the launch, four rebounds later."""
    law, slope = ContactLaw(1e6, 0.0, 0.0, 0.0), Slope(0.1)
    launch = State(0.0, 0.5, phi, 0.7, -0.3, 2.0)
    there = simulate(DISC, law, slope, launch, max_time=100.0, max_rebounds=4)
    duration = there.time + 0.01
    end = simulate(DISC, law, slope, launch, max_time=duration).state
    back = simulate(DISC, law, slope, end._replace(u=-end.u, v=-end.v, omega=-end.omega), max_time=duration)
    turned = phi + back.launch.phi - end.phi  # by the turns that the second launch has lost
    assert back.state == pytest.approx(launch._replace(phi=turned, u=-0.7, v=0.3, omega=-2.0), abs=1e-9)


# --- endings ----------------------------------------------------------------------------------------------------------


def test_a_descent_finishes_exactly_at_the_end() -> None:
    """Oracle: x = length to the last bit, at the time and height of a parabola; of a wheel that slides, at L/u."""
    slope = Slope(0.0, 3.0, 9.81)
    end = simulate(DISC, LAW, slope, State(0.0, 5.0, 0.0, 6.0, 0.0, 1.0))
    assert (end.status, end.state.x, len(end.rebounds)) == (Status.FINISH, 3.0, 0)
    assert end.time == pytest.approx(0.5, rel=1e-15)
    assert end.state.y == pytest.approx(5.0 - 0.125 * 9.81, rel=1e-14)
    slides = ContactLaw(1e6, 0.6, 0.0, 0.0)
    end = simulate(segment(1.0, 0.1, 0.0, 5e-3), slides, slope, State(0.0, 0.1, 0.0, 2.0))
    assert (end.status, end.state.x) == (Status.FINISH, 3.0)
    assert end.time == pytest.approx(1.5, rel=1e-14)
    assert end.energy.stored > 0.0
    assert (end.rebounds[-1]["t"], end.rebounds[-1]["x"]) == (end.time, 3.0)


@pytest.mark.parametrize("max_time", [1e-9, 0.1, 1.0 / 3.0, 0.347, 0.3475, 2.0])
def test_a_descent_times_out_exactly_then(max_time: float) -> None:
    """Oracle: the time to the last bit, in flight, within a rebound (0.347 s) and later."""
    end = simulate(DISC, LAW, INCLINE._replace(length=math.inf), LAUNCH, max_time=max_time)
    assert end.status == Status.TIMEOUT
    assert end.time == max_time


def test_a_jammed_body_is_at_rest_in_a_contact_that_holds_it() -> None:
    """Oracle: zero velocities, N = m g cos beta in the spring, and a stuck last rebound."""
    rough = ContactLaw(1e6, 0.8, 0.8, 0.03)
    end = simulate(DISC, rough, Slope(0.05), LAUNCH)
    assert end.status == Status.JAMMED
    assert end.state[3:] == (0.0, 0.0, 0.0)
    assert end.rebounds[-1]["stuck"] == 2
    assert end.rebounds[-1]["mode"] == Mode.STUCK
    depth = support_height(DISC, end.state.phi) - end.state.y
    weight = 9.81 * math.cos(0.05)
    assert 1e6 * 0.2 * depth * (1.0 - 1e-9) <= weight <= 1e6 * 1.8 * depth * (1.0 + 1e-9)
    lever = 0.05 * math.sin(end.state.phi - 0.05) + 0.1 * math.sin(0.05)
    assert abs(lever) <= 0.03 * math.cos(0.05)


@pytest.mark.parametrize("launch", [State(0.0, 0.5, 0.0, 0.0, 0.0, 1e200), State(0.0, 0.5, 0.0, 1e308)], ids=str)
def test_a_state_that_overflows_is_reported(launch: State) -> None:
    """Oracle: by construction: (h omega)^2, or x within ten seconds, is infinite."""
    assert simulate(DISC, LAW, Slope(0.0), launch, max_time=10.0).status == Status.NON_FINITE


def similar(size: float, time: float, mass: float, solver: str, profile: list[tuple[float, float]]) -> Any:
    """Where and how the rebounds of a descent of another size, time scale and mass end, in units of these."""
    speed, force = size / time, mass * size / time**2
    corners = size * np.array([(0.0, 0.0), (1.0, 0.0), (1.25, 0.25), (0.125, 0.5)])
    body = sledenv.polygon(20.0 * mass, corners, rounding=0.0625 * size)
    law = ContactLaw(1e6 * force / size, 0.6, 0.15, 0.004 * size, 0.002 * size)
    zone = sledenv.Zone(2.0 * size, 3.0 * size, 0.25, 0.01 * size)
    slope = Slope(0.2, 12.0 * size, 9.81 * size / time**2, (zone,), tuple((size * x, size * y) for x, y in profile))
    launch = State(0.0, 1.5 * size, 0.1, 3.0 * speed, -0.5 * speed, 0.7 / time)
    rows = simulate(body, law, slope, launch, solver=solver, max_time=30.0 * time).rebounds
    units = {"t": time, "x": size, "phi": 1.0, "u_after": speed, "omega_after": 1.0 / time, "peak_force": force}
    return np.stack([rows[name] / unit for name, unit in units.items()], axis=-1)


@pytest.mark.parametrize(
    ("solver", "profile"),
    [("compliant", []), ("rigid", []), ("compliant", [(1.0, 0.0), (2.5, 0.25), (4.0, 0.0), (5.5, 0.25), (7.0, -0.25)])],
)
def test_no_length_time_or_mass_is_large_or_small_in_itself(solver: str, profile: list[tuple[float, float]]) -> None:
    """Oracle: similarity, from bodies of micrometres to those of megametres.

    As reported in https://github.com/avianphysics/avian/issues/990, of tolerances in metres.
    """
    rebounds = similar(1.0, 1.0, 1.0, solver, profile)
    assert len(rebounds) > 5
    for units in ((2.0**-20, 2.0**-10, 2.0**-40), (2.0**20, 2.0**5, 2.0**30), (1.0, 2.0**-6, 1.0)):
        assert similar(*units, solver, profile) == pytest.approx(rebounds, rel=1e-9, abs=1e-9), units


def depths(given: Given, ends: np.void) -> tuple[float, float]:
    """How deep the outline and the mass centre are in the ground at the end of a descent, in sizes of the body."""
    body, slope, found = given.body, given.slope, np.zeros((1, 3))
    ground, pose = (
        audit_geometry.ground_of(slope.profile, slope.rounding or None),
        [ends[name] for name in ("x", "y", "phi")],
    )
    audit_geometry.measure_all(*audit_geometry.outline_of(body), *ground, body.size, np.array([pose]), found)
    return found[0, audit_geometry.OUTLINE] / body.size, found[0, audit_geometry.CENTRE] / body.size


@pytest.mark.parametrize("count", [30, pytest.param(10_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", scenario_names())
def test_launches_of_a_scenario_end_properly_and_close_their_books(name: str, count: int) -> None:
    """Oracle: status, ledger and second law of every descent in contexts that the scenario draws, however launched.

    Steps leave out a tenth of the tolerance each. Few boulders spin so fast that their ground is too soft: they are as
    deep in it as those that are buried must be.
    """
    scenario, rng = load_scenario(name), np.random.default_rng(1)
    errors = np.column_stack([rng.uniform(-math.pi, math.pi, count), rng.uniform(-5.0, 5.0, count)])
    scenes, settings = (
        scenario.scenes(scenario.contexts(rng.random((count, scenario.draws))), errors),
        scenario.settings(),
    )
    logs = new_logs(count, settings.max_rebounds)
    simulator = Simulator(scenes, False, limits_of(scenario.all_bodies(), settings), logs)
    simulator.run()
    ends, jam = simulator.flights, simulator.jam()
    proper = {Status.FINISH, Status.JAMMED, Status.TUMBLED, Status.TIMEOUT, Status.LOG_FULL}
    status = np.array([STATUS_OF_CODE[code] for code in ends["status"]])
    buried = np.flatnonzero(status == Status.BURIED)
    assert len(buried) <= (0.01 * count if name == "boulder_benches" else 0.0)
    for lane in buried:
        outline, centre = depths(
            scenario.given_in(scenario.scenes(*np.split(scenes.drawn[[lane]], [-2], axis=1))), ends[lane]
        )
        assert outline > 0.25 or centre > 0.0
    assert {*status} <= proper | {Status.BURIED}
    assert np.isfinite([ends[field] for field in State._fields]).all()
    losses = ends["hysteresis"] + ends["sliding"] + ends["rolling"] + ends["drag"]
    residual = ends["kinetic"] + ends["potential"] + ends["stored"] + losses - ends["initial"]
    scale = np.abs(ends["initial"]) + np.abs(ends["potential"]) + losses
    assert (np.abs(residual) <= np.maximum(1e-10, 0.1 * settings.tolerance * ends["steps"]) * scale).all()
    for loss in ("hysteresis", "sliding", "rolling"):
        assert (ends[loss] >= 0.0).all()
        assert (logs[f"loss_{loss}"] >= -1e-14 * scale[:, None]).all()
    assert (ends["stored"] >= 0.0).all()
    assert ((jam.reward >= 0.0) & (jam.reward <= 1.0)).all()
    assert (losses <= scale * (1.0 + 1e-10)).all()


# --- batches ----------------------------------------------------------------------------------------------------------


def mixed_lanes(count: int = 24) -> tuple[list[ContactLaw], list[Slope], np.ndarray]:
    """Laws, slopes and launches that end in different ways."""
    rng = np.random.default_rng(3)
    laws = [ContactLaw(1e6, rng.uniform(0.1, 0.9), rng.uniform(0.0, 1.0), rng.uniform(0.0, 0.02)) for _ in range(count)]
    slopes = [Slope(rng.uniform(0.0, 0.4), rng.choice([3.0, 30.0])) for _ in range(count)]
    states = np.array([launched(SEGMENT, (rng.uniform(0, 1), *rng.normal(0, 2, 4))) for _ in range(count)])
    return laws, slopes, states


def assert_same_batch(one: DescentBatch, other: DescentBatch) -> None:
    assert np.array_equal(one.outcomes, other.outcomes)
    assert np.array_equal(one.rebounds, other.rebounds)
    assert np.array_equal(one.jam, other.jam)


@pytest.mark.parametrize("block", [1, 7, 24, 1000])
def test_blocks_put_together_are_the_batch(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: simulate_batch in one block; laws and slopes differ from lane to lane."""
    laws, slopes, states = mixed_lanes()
    options: dict[str, Any] = {"max_time": 5.0, "max_rebounds": 40}
    whole = simulate_batch(SEGMENT, laws, slopes, states, Settings(**options), keep_rebounds=True)
    parts = list(simulate_blocks(SEGMENT, laws, slopes, states, Settings(**options), block=block))
    assert [len(part.outcomes) for part in parts] == [min(block, 24 - i) for i in range(0, 24, block)]
    outcomes, rebounds = (np.concatenate([getattr(p, name) for p in parts]) for name in ("outcomes", "rebounds"))
    assert_same_batch(whole, DescentBatch(outcomes, rebounds, DescentJam(*np.hstack([p.jam for p in parts]))))
    monkeypatch.setattr(simulate_module, "_BLOCK", block)
    assert_same_batch(whole, simulate_batch(SEGMENT, laws, slopes, states, Settings(**options), keep_rebounds=True))


def test_progress_shows_a_bar_or_says_what_is_missing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: what tqdm writes; without it nothing is simulated."""
    _, _, states = mixed_lanes()
    monkeypatch.setattr(simulate_module, "_BLOCK", 10)
    quiet = simulate_batch(SEGMENT, LAW, INCLINE, states, Settings(max_rebounds=10))
    assert capsys.readouterr().err == ""
    assert_same_batch(quiet, simulate_batch(SEGMENT, LAW, INCLINE, states, Settings(max_rebounds=10), progress=True))
    assert "24.0/24.0" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "tqdm", None)
    monkeypatch.setattr(simulator_module, "follow_all", None)
    with pytest.raises(ImportError, match="the bar needs tqdm: pip install tqdm"):
        simulate_batch(SEGMENT, LAW, INCLINE, states, progress=True)


# --- trajectories -----------------------------------------------------------------------------------------------------


def traced(body: Segment = SEGMENT, law: ContactLaw = LAW, **options: Any) -> Descent:
    """A descent with arc and corner contacts, and its trajectory."""
    launch = State(0.0, 1.5, 1.7, 1.0, 0.0, 3.0)
    return simulate(body, law, Slope(0.2, 10.0), launch, **{"max_time": 4.0, "record": "trajectory"} | options)


@pytest.mark.parametrize("body", [SEGMENT, DISC, ROD])
def test_a_trajectory_is_whole_and_its_forces_obey_the_law(body: Segment) -> None:
    """Oracle: launch and end; N = c (1 +- Delta) x, |F| <= f N, |M| <= delta N, equal where it slips or turns."""
    law = ContactLaw(1e6, 0.5, 0.1, 0.001, 0.0005)
    descent = traced(body, law)
    rows = descent.trajectory
    assert (rows["t"][0], tuple(rows[list(State._fields)][0])) == (0.0, descent.launch)
    assert (rows["t"][-1], tuple(rows[list(State._fields)][-1])) == (descent.time, descent.state)
    steps = np.diff(rows["t"])
    assert 0.0 <= steps.min() <= steps.max() <= 0.01 * (1.0 + 1e-12)
    gaps = rows["y"] - np.array([support_height(body, phi) for phi in rows["phi"]])
    flying = rows["feature"] == Feature.NONE
    for name in ("normal", "tangential", "rolling", "slip", "spin"):
        assert (rows[name][flying] == 0.0).all()
    assert gaps[:-1][flying[:-1]].min() > -1e-13  # it may end in contact
    held = rows[~flying]
    assert len(held) > 100
    arm = np.where(held["feature"] == Feature.ARC, law.rolling_arm, law.corner_rolling_arm)
    rounding = 1e-9 * held["normal"].max()
    assert (held["normal"] >= -rounding).all()
    assert (np.abs(held["tangential"]) <= law.friction * held["normal"] + rounding).all()
    assert (np.abs(held["rolling"]) <= arm * held["normal"] + rounding).all()
    slipping, turning = held["slip"] != 0, held["spin"] != 0
    expected = -held["slip"] * law.friction * held["normal"]
    assert held["tangential"][slipping] == pytest.approx(expected[slipping], abs=rounding)
    assert held["rolling"][turning] == pytest.approx((-held["spin"] * arm * held["normal"])[turning], abs=rounding)
    alone = ~flying[:-1] & (rows["feature"][:-1] != Feature.CHORD)  # there two springs share the load
    depth, normal = -gaps[:-1][alone], rows["normal"][:-1][alone]
    assert (normal >= 1e6 * (1.0 - law.asymmetry) * depth - 1e-6).all()
    assert (normal <= 1e6 * (1.0 + law.asymmetry) * depth + 1e-6).all()


def test_a_rebound_is_the_integral_of_its_forces_and_their_powers() -> None:
    """Oracle: quadrature of the recorded forces, f N |v_t| and delta N |omega|; momentum; central differences."""
    launch, (g, beta) = launched(DISC, (0.0, 1.7, 1.0, -2.0, 3.0)), (9.81, 0.2)
    options: dict[str, Any] = {"max_rebounds": 1, "record": "trajectory", "sample_interval": 3e-7}
    descent = simulate(DISC, LAW, Slope(beta), launch, **options)
    rows, (row,), t = descent.trajectory, descent.rebounds, descent.trajectory["t"]
    for name in ("normal", "tangential", "rolling"):
        assert row[f"{name}_impulse"] == pytest.approx(np.trapezoid(rows[name], t), rel=1e-3)
    along, across = g * math.sin(beta) * row["duration"], g * math.cos(beta) * row["duration"]
    assert row["u_after"] - row["u_before"] == pytest.approx(row["tangential_impulse"] + along, abs=1e-12)
    assert row["v_after"] - row["v_before"] == pytest.approx(row["normal_impulse"] - across, abs=1e-12)
    slip_speed = rows["u"] + (0.1 - 0.05 * np.cos(rows["phi"])) * rows["omega"]
    assert descent.energy.sliding == pytest.approx(np.trapezoid(-rows["tangential"] * slip_speed, t), rel=2e-4)
    assert descent.energy.rolling == pytest.approx(np.trapezoid(-rows["rolling"] * rows["omega"], t), rel=2e-4)
    rows = traced(DISC, max_rebounds=2, sample_interval=2e-5).trajectory
    t = rows["t"]
    inner = np.flatnonzero((np.diff(t)[1:] > 1e-7) & (np.diff(t)[:-1] > 1e-7)) + 1
    for place, rate in (("x", "u"), ("y", "v"), ("phi", "omega")):
        difference = (rows[place][inner + 1] - rows[place][inner - 1]) / (t[inner + 1] - t[inner - 1])
        mean = 0.25 * (rows[rate][inner - 1] + 2.0 * rows[rate][inner] + rows[rate][inner + 1])
        assert np.abs(difference - mean).max() < 2e-3


def test_a_long_trajectory_is_complete_and_changes_nothing_else() -> None:
    """Oracle: the rows of a coarser recording lie on it, though it outgrows the first buffer; one without rows."""
    fine, coarse, none = traced(sample_interval=1e-4), traced(), traced(record="rebounds")
    assert len(fine.trajectory) > simulate_module.FIRST_TRAJECTORY > len(coarse.trajectory) > len(none.trajectory)
    for one in (fine, coarse):
        assert (one.state, one.energy) == (none.state, none.energy)
        assert np.array_equal(one.rebounds, none.rebounds)
    assert (fine.trajectory["t"][1:] > 0.0).all()  # every row was written
    heights = np.interp(coarse.trajectory["t"], fine.trajectory["t"], fine.trajectory["y"])
    assert np.abs(coarse.trajectory["y"] - heights).max() < 1e-5


# --- records ----------------------------------------------------------------------------------------------------------


def test_a_nearly_stuck_rebound_is_marked() -> None:
    """Oracle: u and r omega below 5 % of the entry speed: a fall without spin or speed along the slope."""
    wheel = segment(1.0, 0.1, 0.0, 5e-3)
    floor = Slope(0.0, math.inf, 0.0)
    codes = [
        simulate(wheel, LAW, floor, State(0.0, 0.2, 0.0, u, -1.0), max_rebounds=1).rebounds[0]["stuck"]
        for u in (0.0, 0.03, 2.0)
    ]
    assert codes == [2, 1, 0]


# --- results as text --------------------------------------------------------------------------------------------------


def test_descents_batches_and_bodies_are_shown_in_a_line() -> None:
    """Oracle: what they are made of; on a slope without end there is no reward to show."""
    descent = simulate(DISC, LAW, INCLINE, LAUNCH, record="trajectory")
    end, jam, rows = descent.state, float(descent.jam.reward), len(descent.trajectory)
    assert repr(descent) == (
        f"Descent(finish at t = {descent.time:.4g} s, x = {end.x:.4g} m; {len(descent.rebounds)} rebounds, "
        f"{rows} rows of trajectory; reward {jam:.3f})"
    )
    assert repr(simulate(DISC, LAW, Slope(0.1), LAUNCH, max_time=0.01)).startswith(
        "Descent(timeout at t = 0.01 s, x = "
    )
    assert "reward" not in repr(simulate(DISC, LAW, Slope(0.1), LAUNCH, max_time=0.01))
    assert repr(descent.as_batch()) == f"DescentBatch(1 descent: 100.0% finish; mean reward {jam:.3f})"
    assert repr(simulate_batch(DISC, LAW, INCLINE, np.empty((0, 6)))) == "DescentBatch(0 descents: none)"
    assert repr(segment(2.0, 0.5, 0.1, 0.3)) == (
        "Segment(mass 2, radius 0.5, eccentricity 0.1, inertia 0.3, half_angle 3.14159; parts: arc, nose, tail, chord)"
    )
    assert str(sledenv.load_scenario("sled_rollers")) == "Scenario('sled_rollers', 'Rollers')"
    assert repr(sledenv.sensitivity(descent.body, LAW, INCLINE, LAUNCH, parameters=("u", "friction"))) == (
        f"Sensitivity(of {min(len(descent.rebounds), 10)} rebounds and the end, finish; by u, friction)"
    )
    assert repr(sledenv.rod(2.0, 1.5)) == "Body(mass 2, inertia 0.375; parts: nose, tail, bottom, top)"
