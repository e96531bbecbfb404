"""The contacts of a trajectory: what touches what, where, and with which forces."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sledenv.kernel.records import MOST_CONTACTS
from sledenv.plot.trajectories import by_label, touches_in
from sledenv.simulation.bodies import segment
from sledenv.simulation.outcomes import Descent, ground_name
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Solver
from sledenv.simulation.shapes import polygon
from sledenv.simulation.simulate import simulate
from sledenv.simulation.sleds import sled

BOAT = segment(1.0, 0.15, 0.08, 0.012, 1.2)
LAW = ContactLaw(1e5, 0.6, 0.1, 0.001)
SLOPE = Slope(0.2, 8.0)
OVERTURNED, DROPPED = State(0.0, 0.3, 2.6, 2.0, 0.0, 3.0), State(0.0, 1.0, 0.2, 6.0, 0.0, 1.0)


def descents() -> list[Descent]:
    """Bodies that touch with one point and with two, some at a time, on any surface."""
    solvers: tuple[Solver, ...] = ("compliant", "rigid")
    found = []
    for solver in solvers:
        for body, launch in ((BOAT, OVERTURNED), (sled(), DROPPED)):
            found.append(simulate(body, LAW, SLOPE, launch, solver=solver, record="trajectory", max_time=4.0))
    return found


def test_the_contacts_of_a_row_add_up_to_its_forces() -> None:
    """Oracle: the sums in the row; the contacts that there are come first, and the others are zero."""
    counts = set()
    for descent in descents():
        rows, contacts = descent.trajectory, descent.contacts
        assert contacts.shape == (rows["touching"].sum(),)
        assert np.array_equal(np.bincount(contacts["row"], minlength=len(rows)), rows["touching"])
        assert np.array_equal(contacts["t"], rows["t"][contacts["row"]])
        assert ((rows["touching"] > 0) == (rows["feature"] > 0)).all()
        for name in ("normal", "tangential"):
            assert np.bincount(contacts["row"], contacts[name], len(rows)) == pytest.approx(rows[name], rel=1e-12)
        for k in range(MOST_CONTACTS):
            unused = rows["contacts"][rows["touching"] <= k, k]
            assert not np.frombuffer(unused.tobytes(), np.uint8).any()
        counts |= set(rows["touching"].tolist())
    assert counts == {0, 1, 2}


def test_a_contact_lies_where_the_body_is_lowest_and_the_forces_turn_it_from_there() -> None:
    """Oracle: Euler's equation, integrated over the descent, with arms from the places of the contacts."""
    for descent in descents()[:2]:
        rows, contacts = descent.trajectory, descent.contacts
        assert (contacts["y"] == 0.0).all()
        assert (contacts["normal_x"] == 0.0).all()
        assert (contacts["normal_y"] == 1.0).all()
        assert (contacts["ground"] == 0).all()
        touches = touches_in(descent.body, rows)
        moment = np.bincount(contacts["row"], touches.moment, len(rows)) + rows["rolling"]
        turned = np.append(0.0, np.cumsum(0.5 * (moment[1:] + moment[:-1]) * np.diff(rows["t"]))) / descent.body.inertia
        assert turned == pytest.approx(rows["omega"] - rows["omega"][0], abs=0.01 * np.ptp(rows["omega"]))


def test_curves_of_contacts_bear_the_names_of_what_touches() -> None:
    """Oracle: the parts of the body; made-up ground, and two contacts of one part."""
    descent = descents()[0]
    rows = descent.trajectory
    for name, values in by_label(descent, descent.contacts, descent.contacts["normal"], len(rows)).items():
        code = BOAT.parts.index(name) + 1
        mine = (rows["contacts"]["part"] == code) & (rows["contacts"]["normal_y"] > 0.0)
        assert np.array_equal(~np.isnan(values), mine.any(axis=1))
        assert np.nansum(values) == pytest.approx(rows["contacts"]["normal"][mine].sum())
    assert [ground_name(code) for code in range(4)] == ["piece 0", "vertex 0", "piece 1", "vertex 1"]
    assert [ground_name(code, (0.0, 0.5)) for code in range(4)] == ["piece 0", "vertex 0", "piece 1", "bend 1"]
    descent.contacts["ground"][-2:] = 3
    pair = descent.contacts[-2:]
    assert set(by_label(descent, pair, pair["normal"], len(rows))) == {"nose on vertex 1", "tail on vertex 1"}
    pair["part"] = pair["part"][0]
    assert set(by_label(descent, pair, pair["normal"], len(rows))) in (
        {"nose on vertex 1", "nose on vertex 1, 2"},
        {"tail on vertex 1", "tail on vertex 1, 2"},
    )


@pytest.mark.parametrize("kind", range(12))
def test_a_body_that_rests_in_a_dip_is_held_by_the_forces_at_its_contacts(kind: int) -> None:
    """Oracle: equilibrium: the forces balance the weight, and their moments with the rolling resistance are zero."""
    rng = np.random.default_rng(kind)
    one, other = rng.uniform(0.3, 0.9, 2)  # slopes of the faces
    ground = Slope(rng.uniform(-0.1, 0.1), profile=[(0.0, 0.0), (2.0, -2.0 * one), (4.0, 2.0 * (other - one))])
    corners = [(0.0, 0.0), (rng.uniform(0.4, 0.8), 0.0), (0.5, rng.uniform(0.2, 0.5)), (0.0, 0.3)]
    body = polygon(20.0, corners, rounding=0.02)
    law = ContactLaw.from_restitution(0.2, stiffness=1e9, friction=1.0, rolling_arm=rng.choice([0.0, 0.002]))
    launch = State(rng.uniform(1.5, 2.5), 1.0, rng.uniform(-3.0, 3.0))
    descent = simulate(body, law, ground, launch, record="trajectory", max_time=60.0)
    assert descent.status == "jammed"
    row, contacts = descent.trajectory[-1], descent.contacts[descent.contacts["row"] == len(descent.trajectory) - 1]
    nx, ny, normal, tangential = (contacts[name] for name in ("normal_x", "normal_y", "normal", "tangential"))
    fx, fy = normal * nx + tangential * ny, normal * ny - tangential * nx
    weight = body.mass * ground.gravity
    moment = ((contacts["x"] - row["x"]) * fy - (contacts["y"] - row["y"]) * fx).sum() + row["rolling"]
    assert fx.sum() == pytest.approx(-weight * math.sin(ground.angle), abs=1e-6 * weight)
    assert fy.sum() == pytest.approx(weight * math.cos(ground.angle), abs=1e-6 * weight)
    depth = normal / (law.stiffness * (1.0 - law.asymmetry))  # at most; friction acts so far below the ground
    assert moment == pytest.approx(0.0, abs=(np.abs(tangential) * depth).sum() + 1e-9 * weight * body.size)
    assert (np.abs(tangential) <= (1.0 + 1e-9) * normal).all()
