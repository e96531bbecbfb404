"""The paper's explicit Euler method: its figures, order, limits, calls, and what its printed friction sign does."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sledenv.kernel.records import Feature, Status
from sledenv.reproduce import euler, euler_descent
from sledenv.simulation.bodies import segment
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.shapes import circular_segment, polygon, rod
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height
from tests.bodies import same_bits

BODY = segment(1.0, 0.1, 0.05, 7.5e-3)
LAW = ContactLaw(9.81e3, 0.5, 0.1, 0.001)
LEVEL = Slope(0.0, math.inf, 0.0)
LAUNCH = State(0.0, 0.07, math.pi / 4, 0.0, -10.0, 0.0)
STEPS = 1e-5 * 0.5 ** np.arange(4)  # few enough to run without compilation
MANY_STEPS = 1e-5 * 0.5 ** np.arange(8)


def example(
    step: float = 2.5e-7, sign: str = "dissipative", law: ContactLaw = LAW, slope: Slope = LEVEL, **options: float
) -> Descent:
    """The paper's worked example up to .04 s by Euler's method."""
    return euler_descent(BODY, law, slope, LAUNCH, step=step, friction_sign=sign, **{"max_time": 0.04} | options)


@pytest.mark.parametrize(("step", "within"), [(1e-5, 0.5), pytest.param(2.5e-7, 0.05, marks=pytest.mark.jit_only)])
def test_the_printed_sign_creates_energy_without_hysteresis(step: float, within: float) -> None:
    """Oracle: 55.2 J of 50 J with Delta = 0, physics.md, section 2; friction and rolling can only lose energy."""
    elastic = LAW._replace(asymmetry=0.0)
    ends = {
        sign: example(step, sign, elastic, max_time=0.1, max_rebounds=1).energy.kinetic
        for sign in ("dissipative", "printed")
    }
    assert ends["printed"] == pytest.approx(55.2, abs=within)
    assert ends["dissipative"] < 50.0


def order(errors: list[float], steps: np.ndarray) -> float:
    """Exponent of the power of the step that the errors follow."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


@pytest.mark.jit_only
@pytest.mark.parametrize("slope", [LEVEL, Slope(0.1, math.inf, 9.81)], ids=["level", "incline"])
def test_euler_converges_to_the_event_driven_contact_at_first_order(slope: Slope) -> None:
    """Oracle: the event-driven solver, which shares no integration, for states and energies at .04 s."""
    exact = simulate(BODY, LAW, slope, LAUNCH, max_time=0.04)
    runs = [example(step, slope=slope) for step in MANY_STEPS]
    for field in ("u", "v", "omega", "phi", "x"):
        errors = [abs(getattr(run.state, field) - getattr(exact.state, field)) for run in runs]
        assert order(errors, MANY_STEPS) == pytest.approx(1.0, abs=0.05), field
        assert errors[-1] < 1e-3
    for field in ("kinetic", "hysteresis", "sliding", "rolling"):
        errors = [abs(getattr(run.energy, field) - getattr(exact.energy, field)) for run in runs]
        assert order(errors, MANY_STEPS) == pytest.approx(1.0, abs=0.05), field


@pytest.mark.parametrize("slope", [LEVEL, Slope(0.1, math.inf, 9.81)], ids=["level", "incline"])
def test_the_ledger_of_euler_closes_at_first_order(slope: Slope) -> None:
    """Oracle: conservation of energy as the step vanishes; the printed sign leaves a gap of 6 J at any step."""
    residuals = [abs(example(step, slope=slope).energy.residual) for step in STEPS]
    assert order(residuals, STEPS) == pytest.approx(1.0, abs=0.02)
    assert residuals[-1] < 0.02
    assert abs(example(STEPS[-1], "printed", slope=slope).energy.residual) > 5.0


def test_the_explicit_step_is_that_of_newtons_laws() -> None:
    """Oracle: one step in contact by hand: position with the old velocity, velocity with the old force."""
    slope, dt = Slope(0.2, math.inf, 9.81), 1e-4
    y = support_height(BODY, 0.5)
    run = euler_descent(
        BODY, LAW, slope, State(0.0, y, 0.5, 1.0, -3.0, 2.0), step=dt, max_time=2e-4,
        record="trajectory", sample_interval=dt,
    )  # fmt: skip
    free, pressed = run.trajectory[:2]
    assert free["normal"] == 0.0
    assert [pressed[name] for name in ("x", "y", "phi")] == pytest.approx([dt, y - 3.0 * dt, 0.5 + 2.0 * dt], abs=1e-16)
    assert pressed["v"] == pytest.approx(-3.0 - 9.81 * math.cos(0.2) * dt, abs=1e-15)
    a, b = 0.05 * math.sin(pressed["phi"]), 0.1 - 0.05 * math.cos(pressed["phi"])
    normal = 9.81e3 * 1.5 * (b - pressed["y"])
    assert pressed["normal"] == pytest.approx(normal, rel=1e-12)
    assert pressed["tangential"] == pytest.approx(-0.1 * normal, rel=1e-12)
    assert pressed["rolling"] == pytest.approx(-0.001 * normal, rel=1e-12)
    spin = 2.0 + dt * (-a * normal - b * 0.1 * normal - 0.001 * normal) / 7.5e-3
    assert run.state.omega == pytest.approx(spin, rel=1e-14)
    assert run.state.u == pytest.approx(pressed["u"] + dt * (-0.1 * normal + 9.81 * math.sin(0.2)), rel=1e-14)


@pytest.mark.parametrize(
    ("options", "launch", "status"),
    [
        ({"max_time": 0.01}, State(0.0, 0.5, 0.0), Status.TIMEOUT),
        ({"max_time": 1.0}, State(0.9, 0.5, 0.0, 10.0), Status.FINISH),
        ({"max_time": 1.0, "max_rebounds": 2}, State(0.0, 0.2, 0.0, 0.0, -10.0), Status.LOG_FULL),
    ],
    ids=str,
)
def test_a_run_ends_for_the_stated_reason(options: dict[str, float], launch: State, status: Status) -> None:
    """Oracle: by construction."""
    law = LAW._replace(asymmetry=0.1, rolling_arm=0.0)
    slope = Slope(0.0, 1.0, 9.81 if status != Status.LOG_FULL else 400.0)
    run = euler_descent(BODY, law, slope, launch, step=2e-5, **options)
    assert run.status == status
    if status == Status.LOG_FULL:
        assert len(run.rebounds) == 2
        assert (np.diff(run.rebounds["t"]) > 0.0).all()
    if status == Status.FINISH:
        assert 1.0 <= run.state.x < 1.0 + 3e-4
        assert run.at_line == (run.time, run.state.u)


def landing(method: Callable[..., Descent], max_time: float = 0.06, **options: Any) -> Descent:
    """A segment comes down on one corner, soon on the other too, and flies again after 31 ms."""
    body, law = circular_segment(1.0, 0.1, 1.9), ContactLaw(1e4, 0.5, 0.3, 0.0, 0.002)
    tilted = math.pi - 0.02
    launch = State(0.0, support_height(body, tilted) + 0.001, tilted, 0.5, -1.0, 0.3)
    return method(body, law, Slope(0.1), launch, max_time=max_time, **options)


@pytest.mark.jit_only
@pytest.mark.parametrize(("max_time", "contacts"), [(0.015, 1), (0.06, 1), (0.2, 3)])
def test_a_landing_on_the_chord_converges_to_two_springs_at_first_order(max_time: float, contacts: int) -> None:
    """Oracle: the event-driven solver, in the middle of the landing, after it and in the second landing."""
    exact = landing(simulate, max_time)
    assert len(exact.rebounds) == contacts
    assert exact.rebounds[0]["feature"] == Feature.CHORD
    runs = [landing(euler_descent, max_time, step=step) for step in MANY_STEPS]
    assert all(np.array_equal(run.rebounds["feature"], exact.rebounds["feature"]) for run in runs)
    for field in ("y", "v", "omega", "u"):
        errors = [abs(getattr(run.state, field) - getattr(exact.state, field)) for run in runs]
        # Where a step lies to an event is chance, so that single errors stray from the line.
        assert errors[-1] < 0.02 * errors[0] + 1e-7, field
    for field in ("kinetic", "hysteresis"):
        errors = [abs(getattr(run.energy, field) - getattr(exact.energy, field)) for run in runs]
        assert order(errors, MANY_STEPS) == pytest.approx(1.0, abs=0.1), field
    assert order([abs(run.energy.residual) for run in runs], MANY_STEPS) == pytest.approx(1.0, abs=0.05)
    assert runs[-1].energy.stored == pytest.approx(exact.energy.stored, abs=3e-5 * exact.energy.supplied)


def test_a_landing_on_the_chord_is_one_contact_of_both_corners() -> None:
    """Oracle: each corner by hand: (8.1) for where it is, (10)-(13) for what the slope does to it there."""
    dt = 1e-5
    run = landing(euler_descent, 0.01, step=dt, record="trajectory", sample_interval=dt)
    body, (rebound,) = run.body, run.rebounds
    assert rebound["feature"] == Feature.CHORD
    rows = run.trajectory[:-1]
    both = rows["feature"] == Feature.CHORD
    assert 100 < both.sum() < (rows["feature"] != 0).sum()
    normal, force, moment, impulse, sliding, deepest, hardest = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    places = {}
    for side in (-1.0, 1.0):  # of the body: the corner lies at h e(-phi) + r e(-phi -+ alpha) from the mass centre
        corner = (
            body.eccentricity - body.radius * math.cos(body.half_angle),
            side * body.radius * math.sin(body.half_angle),
        )
        sine, cosine = np.sin(rows["phi"]), np.cos(rows["phi"])
        right, up = -corner[0] * sine + corner[1] * cosine, corner[0] * cosine + corner[1] * sine
        depth = np.maximum(-(rows["y"] + up), 0.0)
        v_n, v_t = rows["v"] + right * rows["omega"], rows["u"] - up * rows["omega"]
        n = 1e4 * (1.0 - 0.5 * np.sign(v_n)) * depth
        f = -0.3 * n * np.sign(v_t)
        normal, force, moment = normal + n, force + f, moment - 0.002 * n * np.sign(rows["omega"])
        sliding -= (f * v_t).sum() * dt
        impulse += n.sum() * dt
        assert ((depth > 0.0)[both]).all()
        name = "nose" if side > 0.0 else "tail"  # of an upright body the nose lies downhill
        own = rows["contacts"]["part"] == Feature[name.upper()]
        for force_name, by_hand in (("normal", n), ("tangential", f)):
            found = np.where(own, rows["contacts"][force_name], 0.0).sum(axis=1)
            assert found == pytest.approx(by_hand, rel=1e-9, abs=1e-9), force_name
        places[name] = rows["x"] + right
        deepest, hardest = max(deepest, depth.max()), max(hardest, n.max())
    for name, expected in (("normal", normal), ("tangential", force), ("rolling", moment)):
        assert rows[name] == pytest.approx(expected, rel=1e-9, abs=1e-9), name
    loaded = rows["normal"] > 0.0
    assert rows["friction_ratio"][loaded] == pytest.approx(force[loaded] / (0.3 * normal[loaded]), rel=1e-9)
    assert rebound["peak_force"] == pytest.approx(hardest, rel=1e-9)
    assert rebound["peak_penetration"] == pytest.approx(deepest, rel=1e-9)
    touchdown = np.flatnonzero(rows["feature"])[0]
    assert rows["feature"][touchdown] == Feature.TAIL
    assert rebound["t_touchdown"] == rows["t"][touchdown]
    assert rebound["x_contact"] == pytest.approx(places["tail"][touchdown], rel=1e-12)
    assert rebound["normal_impulse"] == pytest.approx(impulse, rel=1e-12)
    assert rebound["loss_sliding"] == pytest.approx(sliding, rel=1e-9)


def test_a_segment_slides_to_the_end_of_the_slope_on_its_chord() -> None:
    """Oracle: u^2 = u_0^2 + 2 s (g sin(beta) - f g cos(beta)); it lies in balance, so that it chatters least."""
    body, slope = circular_segment(1.0, 0.1, 1.9), Slope(0.3, 0.5)
    law, weight = ContactLaw(1e5, 0.3, 0.1, 0.0), 9.81 * math.cos(0.3)
    sunk = support_height(body, math.pi) - 0.5 * weight / 1e5
    launch = State(0.0, support_height(body, math.pi), math.pi, 1.0)
    run = euler_descent(body, law, slope, launch, step=2e-5)
    assert run.status == Status.FINISH
    pull = 9.81 * (math.sin(0.3) - 0.1 * math.cos(0.3))
    assert run.state.u == pytest.approx(math.sqrt(1.0 + 2.0 * 0.5 * pull), rel=1e-3)
    assert run.state.y == pytest.approx(sunk, abs=1e-4)
    assert run.on_chord is None  # nothing settles on the grid of steps


@pytest.mark.jit_only  # numpy warns of the overflow without compilation
def test_an_overflow_ends_a_run() -> None:
    """Oracle: N dt > 1e308 in the first step of the contact."""
    law = ContactLaw(1e10, 0.5, 0.1, 0.0)
    run = euler_descent(BODY, law, LEVEL, State(0.0, 0.2, 0.0, 0.0, -1e306), step=1e-3)
    assert run.status == Status.NON_FINITE


@pytest.mark.parametrize("side", [1, -1])
def test_a_rod_and_a_polygon_tell_which_side_lies_on_the_slope(side: int) -> None:
    """Oracle: the part of the side that is lowest, of two sides with the same ends and of four."""
    law, slope, dt = ContactLaw(1e5, 0.5, 0.2, 0.0), Slope(0.0), 1e-5
    flat = rod(1.0, 0.4, 0.02)
    box = polygon(1.0, [(0.2, -0.1), (0.2, 0.1), (-0.2, 0.1), (-0.2, -0.1)])
    for body in (flat, box):
        upright = math.pi / 2 if support_height(body, 0.0) > 0.15 else 0.0
        phi = upright + 0.01 * side
        launch = State(0.0, support_height(body, phi) + 1e-4, phi, 0.0, -1.0)
        run = euler_descent(body, law, slope, launch, step=dt, max_time=0.05, max_rebounds=1)
        both = simulate(body, law, slope, launch, max_time=0.05, max_rebounds=1)
        assert run.rebounds["feature"].tolist() == both.rebounds["feature"].tolist()


@pytest.mark.parametrize("steps", [1, 13])
def test_a_descent_in_many_calls_is_that_in_one(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the same descent in one call, bit for bit, with a trajectory that grows."""
    options: dict[str, Any] = {"step": 2e-5, "record": "trajectory", "sample_interval": 6e-5}
    whole = landing(euler_descent, **options)
    monkeypatch.setattr(euler, "_STEPS", steps)
    monkeypatch.setattr(euler, "_FIRST_ROWS", 2)
    parts = landing(euler_descent, **options)
    assert len(whole.trajectory) > 1000
    for rows in ("outcome", "rebounds", "trajectory"):
        same_bits(getattr(parts, rows), getattr(whole, rows))


def test_rows_for_which_there_is_no_room_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the message."""
    monkeypatch.setattr("sledenv.simulation.lanes.available", lambda: 1e6)
    with pytest.raises(MemoryError, match=r"sample_interval = 1e-06: the \d+ rows of this trajectory take"):
        example(1e-6, max_time=10.0, record="trajectory", sample_interval=1e-6)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ({"step": 0.0}, ValueError, r"euler_descent.step = 0.0: must be in \(0, inf\)"),
        ({"friction_sign": "up"}, ValueError, "friction_sign = 'up': must be one of 'dissipative', 'printed'"),
        ({"max_time": -1.0}, ValueError, r"max_time = -1.0: must be in \(0, inf\)"),
        ({"max_rebounds": 0}, ValueError, "max_rebounds = 0: must be an integer >= 1"),
        ({"record": "all"}, ValueError, "record = 'all': must be one of 'rebounds', 'trajectory'"),
        ({"law": "soft"}, TypeError, "law = 'soft': must be a ContactLaw"),
        ({"launch": State(0.0, 0.0, 0.0)}, ValueError, "below the surface"),
    ],
    ids=str,
)
def test_bad_input_is_named(given: dict[str, Any], error: type[Exception], message: str) -> None:
    """Oracle: the message: field, value and range."""
    with pytest.raises(error, match=message):
        euler_descent(**{"body": BODY, "law": LAW, "slope": LEVEL, "launch": LAUNCH} | given)
