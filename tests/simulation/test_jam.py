"""How jamming is measured: direct formulas, the bounds of the reward, and what does not earn any."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from sledenv.kernel.records import (
    BURIED,
    JAMMED,
    NON_FINITE,
    OUTCOME,
    REBOUND,
    STATUS_OF_CODE,
    TIMEOUT,
    TUMBLED,
    Status,
)
from sledenv.kernel.records import FINISH as FINISHED
from sledenv.simulation.bodies import segment
from sledenv.simulation.jam import descent_jam, rebound_jam
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height

SEGMENT = circular_segment(2.0, 0.5, math.radians(110.0))
WHEEL = segment(1.0, 0.1, 0.0, 5e-3)
energies = st.one_of(st.just(0.0), st.floats(1e-9, 1e6))
UNFINISHED = [code for code in range(len(STATUS_OF_CODE)) if code not in (FINISHED, NON_FINITE)]


def rebounds(**fields: Any) -> np.ndarray:
    """Records with the given columns."""
    rows = np.zeros(len(next(iter(fields.values()))), REBOUND)
    for name, values in fields.items():
        rows[name] = values
    return rows


def outcomes(**fields: Any) -> np.ndarray:
    """Outcomes with the given columns, finished and at x = 10 m unless told otherwise; the finish is where they end."""
    rows = np.zeros(max(np.size(values) for values in fields.values()), OUTCOME)
    rows["status"], rows["x"] = FINISHED, 10.0
    for name, values in fields.items():
        rows[name] = values
    finished = rows["status"] == FINISHED
    rows["t_line"], rows["u_line"] = np.where(finished, 1.0, np.inf), np.where(finished, rows["u"], 0.0)
    return rows


# --- a rebound --------------------------------------------------------------------------------------------------------


def test_grip_is_the_share_of_the_available_friction() -> None:
    """Oracle: |SF|/(f SN) by hand; nothing is gripped without normal impulse."""
    rows = rebounds(normal_impulse=[2.0, 2.0, 4.0, 0.0], tangential_impulse=[-0.6, 0.3, 0.0, 0.0])
    assert rebound_jam(rows, np.full(len(rows), 0.3)).grip == pytest.approx([1.0, 0.5, 0.0, 0.0])
    assert rebound_jam(rows, np.full(len(rows), 0.0)).grip.tolist() == [0.0] * 4


def test_tangential_loss_is_what_a_rebound_takes_of_the_speed() -> None:
    """Oracle: clip(1 - u_after/u_before, 0, 1) by hand; a body without speed loses none; codes of being stuck."""
    rows = rebounds(u_before=[4.0, 4.0, 4.0, -4.0, 4.0, 0.0], u_after=[3.0, -1.0, 5.0, -1.0, 4.0, 2.0])
    assert rebound_jam(rows, np.full(len(rows), 0.3)).tangential_loss.tolist() == [0.25, 1.0, 0.0, 0.75, 0.0, 0.0]
    jam = rebound_jam(rebounds(stuck=[0, 1, 2]), np.full(3, 0.3))
    assert (jam.stuck.tolist(), jam.nearly_stuck.tolist()) == ([False, False, True], [False, True, True])


@pytest.mark.parametrize(("u", "grip"), [(20.0, 1.0), (0.3, None)])
def test_a_wheel_that_slides_throughout_uses_all_friction(u: float, grip: float | None) -> None:
    """Oracle: a fast wheel slides, F = f N; a slow one begins to roll, where m J u0/I is enough to stop the slip."""
    law = ContactLaw(1e6, 0.5, 0.2, 0.0)
    floor = Slope(0.0, math.inf, 0.0)
    descent = simulate(WHEEL, law, floor, State(0.0, 0.2, 0.0, u, -2.0), max_rebounds=1)
    if grip is None:
        normal = 1.0 * 2.0 * (1.0 + law.restitution)
        grip = 5e-3 * u / (5e-3 + 0.1**2) / (0.2 * normal)
    assert descent.rebound_jam.grip[0] == pytest.approx(grip, rel=1e-9)
    row = descent.rebounds[0]
    assert descent.rebound_jam.tangential_loss[0] == pytest.approx(1.0 - row["u_after"] / u, rel=1e-12)


@example(5e-324, 0.0, 0.0, 0.0)
@given(st.floats(0.0, 1.0), st.floats(-math.pi, math.pi), st.floats(-5.0, 5.0), st.floats(-20.0, 20.0))
def test_metrics_of_a_rebound_lie_in_their_ranges(friction: float, phi: float, u: float, omega: float) -> None:
    """Oracle: Coulomb's bound, with the friction of the zone that the contact is in, and the clips."""
    body, slope = SEGMENT, Slope(0.1, zones=[Zone(0.1, 0.3, 0.1 * friction, 0.0)])
    launch = State(0.0, 0.3 + support_height(body, phi), phi, u, -1.0, omega)
    descent = simulate(body, ContactLaw(1e6, 0.5, friction, 0.001), slope, launch, max_time=2.0, max_rebounds=20)
    jam, rows = descent.rebound_jam, descent.rebounds
    assert ((jam.grip >= 0.0) & (jam.grip <= 1.0)).all()
    assert ((jam.tangential_loss >= 0.0) & (jam.tangential_loss <= 1.0)).all()
    assert (jam.nearly_stuck >= jam.stuck).all()
    available = np.where(np.abs(rows["x_contact"] - 0.2) < 0.1, 0.1, 1.0) * friction * rows["normal_impulse"]
    used = np.minimum(np.abs(rows["tangential_impulse"]), available)
    assert jam.grip * available == pytest.approx(used, rel=1e-9, abs=1e-300)


# --- a descent --------------------------------------------------------------------------------------------------------


def test_a_finished_descent_is_judged_by_the_speed_that_is_left() -> None:
    """Oracle: R = progress/2 + sqrt(rho)/2 with rho = m u^2/(2 E_in), by hand; uphill speed counts for nothing."""
    jam = descent_jam(outcomes(u=[6.0, 3.0, -6.0], supplied=36.0), 2.0, 10.0)
    assert jam.progress.tolist() == [1.0, 1.0, 1.0]
    assert jam.retention == pytest.approx([1.0, 0.25, 0.0])
    assert jam.reward == pytest.approx([1.0, 0.75, 0.5])
    assert jam.jam_index == pytest.approx([0.0, 0.25, 0.5])


@pytest.mark.parametrize("status", UNFINISHED)
def test_a_descent_that_does_not_finish_earns_its_progress_alone(status: int) -> None:
    """Oracle: rho = 0 unless finished, however fast the body is; a timeout has not finished."""
    jam = descent_jam(outcomes(status=[status] * 4, x=[9.0, 0.0, -3.0, 12.0], u=50.0, supplied=1.0), 2.0, 10.0)
    assert jam.retention.tolist() == [0.0] * 4
    assert jam.reward == pytest.approx([0.45, 0.0, 0.0, 0.5])


@pytest.mark.parametrize(
    ("status", "reward"), [(JAMMED, 1.0), (TIMEOUT, 1.0), (FINISHED, 1.0), (TUMBLED, 0.5), (BURIED, 0.5)]
)
def test_behind_the_finish_only_a_fall_counts(status: int, reward: float) -> None:
    """Oracle: the speed at the finish; the body may stop in the run-out. After a fall the way to the finish, 1/2."""
    rows = outcomes(status=[status], x=12.0, u=1.0, supplied=36.0)
    rows["t_line"], rows["u_line"] = 3.0, 6.0
    assert descent_jam(rows, 2.0, 10.0).reward.tolist() == [reward]


def test_a_descent_that_overflows_or_has_no_end_earns_nothing() -> None:
    """Oracle: the place of a state that is not a number is no progress, nor is x/inf."""
    wild = outcomes(status=[NON_FINITE] * 3, x=[np.nan, np.inf, 5.0], u=np.nan, supplied=np.inf)
    assert descent_jam(wild, 2.0, 10.0).reward.tolist() == [0.0] * 3
    endless = outcomes(status=[TIMEOUT], x=1e6, u=5.0, supplied=1.0)
    assert descent_jam(endless, 2.0, math.inf).reward.tolist() == [0.0]


@example(FINISHED, 9.0, 1.0, 0.0, 1.0)  # not divided by
@given(st.integers(0, 7), st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), energies, st.floats(1e-3, 1e3))
def test_the_reward_lies_between_0_and_1(status: int, x: float, u: float, supplied: float, length: float) -> None:
    """Oracle: the range that the documentation promises, for any outcome."""
    jam = descent_jam(outcomes(status=[status], x=x, u=u, supplied=supplied), 2.0, length)
    for share in (jam.reward, jam.progress, jam.retention):
        assert 0.0 <= share[0] <= 1.0
    assert jam.jam_index[0] == 1.0 - jam.reward[0]


# --- what must not pay ------------------------------------------------------------------------------------------------


def test_one_giant_hop_over_the_whole_slope_does_not_pay() -> None:
    """Oracle: by hand: a ballistic hop to the end is free of every impact, but its height and speed were supplied.

    The same wheel rolling down keeps more of what it was given, though it loses some in each metre.
    """
    angle, length = 0.15, 8.0
    slope, slick = Slope(angle, length), ContactLaw(1e6, 0.6, 0.05, 0.0005)
    hop = simulate(WHEEL, slick, slope, State(0.0, 0.1, 0.0, 4.0, 12.0))
    roll = simulate(WHEEL, slick, slope, State(0.0, 0.1, 0.0, 4.0))
    assert hop.status == roll.status == Status.FINISH
    assert len(hop.rebounds) == 0
    assert len(roll.rebounds) > 0
    supplied = 0.5 * (4.0**2 + 12.0**2) + 9.81 * length * math.sin(angle)
    left = 0.5 * 4.0**2 + 9.81 * length * math.sin(angle)
    assert hop.jam.retention == pytest.approx(left / supplied, rel=1e-12)
    assert hop.jam.reward < roll.jam.reward - 0.1


@pytest.mark.parametrize("angle", [-0.2, 0.0])
def test_backing_off_does_not_pay(angle: float) -> None:
    """Oracle: progress counts where the body ends, not how far it has been, and nothing behind the start."""
    ahead, slick = State(0.0, 0.1, 0.0, 3.0 if angle else -3.0, 0.0), ContactLaw(1e6, 0.6, 0.02, 0.0)
    end = simulate(WHEEL, slick, Slope(angle, 5.0), ahead, max_time=6.0, record="trajectory")
    assert end.state.x < 0.0
    assert (end.trajectory["x"].max() > 1.0) == (angle < 0.0)  # up the slope and back, or never ahead
    assert end.jam.reward == 0.0
