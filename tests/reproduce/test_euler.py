"""The paper's explicit Euler method: its figures, order, limits, calls, and what its printed friction sign does."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sledenv.kernel.records import Status
from sledenv.reproduce import euler, euler_descent
from sledenv.simulation.bodies import segment
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
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
    """The paper's worked example up to 0.04 s by Euler's method."""
    return euler_descent(BODY, law, slope, LAUNCH, step=step, friction_sign=sign, **{"max_time": 0.04} | options)


@pytest.mark.parametrize(("step", "within"), [(1e-5, 0.5), pytest.param(2.5e-7, 0.05, marks=pytest.mark.jit_only)])
def test_the_printed_sign_creates_energy_without_hysteresis(step: float, within: float) -> None:
    """Oracle: 55.2 J of 50 J with Delta = 0, docs/physics.md, section 2; friction and rolling can only lose energy."""
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
    """Oracle: the event-driven solver, which shares no integration, for states and energies at 0.04 s."""
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


@pytest.mark.parametrize("steps", [1, 13])
def test_a_descent_in_many_calls_is_that_in_one(steps: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Oracle: the same descent in one call, bit for bit, with a trajectory that grows."""
    launch = State(0.0, 0.2, 0.3, 0.5, -1.0)
    options: dict[str, Any] = {"step": 2e-5, "record": "trajectory", "sample_interval": 6e-5, "max_time": 0.2}
    whole = euler_descent(BODY, LAW, Slope(0.1), launch, **options)
    monkeypatch.setattr(euler, "_STEPS", steps)
    monkeypatch.setattr(euler, "_FIRST_ROWS", 2)
    parts = euler_descent(BODY, LAW, Slope(0.1), launch, **options)
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
        ({"slope": Slope(0.0, zones=[Zone(1.0, 2.0, 0.1, 0.0)])}, ValueError, "must be without profile and zones"),
    ],
    ids=str,
)
def test_bad_input_is_named(given: dict[str, Any], error: type[Exception], message: str) -> None:
    """Oracle: the message: field, value and range."""
    with pytest.raises(error, match=message):
        euler_descent(**{"body": BODY, "law": LAW, "slope": LEVEL, "launch": LAUNCH} | given)
