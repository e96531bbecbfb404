"""Descents that once stalled, ended elsewhere or gained energy: tests/data/hard_contacts.json says why each is hard."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sledenv
from sledenv.kernel.records import Feature

CASES = json.loads((Path(__file__).parents[1] / "data" / "hard_contacts.json").read_text())
PROPER = ("finish", "jammed", "timeout", "log_full")
LOOSE = 1e-10  # a tolerance at which steps are longer and events found in other places


def body_of(told: Any) -> sledenv.Body:
    """A segment by its five numbers, or a body by its arcs: x, y, radius, begin, and whether it is a corner."""
    if isinstance(told, list):
        return sledenv.segment(*told)
    arcs = [sledenv.bodies.Arc(*arc[:4], f"arc {k}", f"side {k}", arc[4]) for k, arc in enumerate(told["arcs"])]
    return sledenv.Body(told["mass"], told["inertia"], arcs)


def simulated(
    case: dict[str, Any], side: float = 1.0, *, endless: bool = False, **options: Any
) -> sledenv.simulation.Descent:
    """Simulate a case from one side of the picture or, of side -1, from the other; uphill no slope ends."""
    angle, length, gravity = case["slope"]
    x, y, phi, u, v, omega = case["launch"]
    slope = sledenv.Slope(
        side * angle,
        length if length and not endless else math.inf,
        gravity,
        [sledenv.Zone(*zone) for zone in case.get("zones", [])],
    )
    launch = sledenv.State(side * x, y, side * phi, side * u, v, side * omega)
    given = body_of(case["body"]), sledenv.ContactLaw(*case["law"]), slope, launch
    options = {"max_time": case["max_time"], "max_rebounds": case["max_rebounds"]} | options
    return sledenv.simulate(*given, solver=case.get("solver", "compliant"), **options)


@pytest.mark.jit_only
@pytest.mark.parametrize("case", CASES, ids=lambda case: case["why"])
def test_a_hard_descent_ends_as_it_should(case: dict[str, Any]) -> None:
    """Oracle: conservation, the bound of the rolling moment, few steps; longer steps; the mirror image."""
    descent = simulated(case, record="trajectory")
    rows, path, arm = descent.rebounds, descent.trajectory, max(case["law"][3:])
    assert descent.status in case.get("status", PROPER)
    assert abs(descent.energy.residual) <= case.get("closes", 1e-9) * descent.energy.turnover
    assert descent.outcome["steps"] < case.get("steps", math.inf)
    if "feature" in case:
        assert Feature[case["feature"].upper()] in rows["feature"]
    if "bounded" in case:
        for moment, force in ((rows["rolling_impulse"], rows["normal_impulse"]), (path["rolling"], path["normal"])):
            assert (np.abs(moment) <= arm * force * (1.0 + 1e-12)).all()
    if "leap" in case:
        assert np.abs(np.diff(path["y"])).max() < case["leap"]
    if "loose" in case:
        loose, size = simulated(case, tolerance=LOOSE), descent.body.size
        speed = max(abs(value) for value in case["launch"][3:5])
        assert loose.status == descent.status
        units = [size + speed * descent.time, size, 1.0 + speed * descent.time / size, speed, speed, speed / size]
        apart = np.abs(np.array(loose.state) - descent.state) / units
        assert apart.max() <= 300.0 * LOOSE
    if "mirror" in case:
        one, image = (simulated(case, side, endless=True) for side in (1.0, -1.0))
        assert (image.status, image.outcome["steps"]) == (one.status, one.outcome["steps"])
