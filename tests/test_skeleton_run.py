"""The kilometre on ice: what docs/skeleton.md says of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sledenv
from docs import draw
from sledenv.simulation.sensitivity import sensitivity

ROOT = Path(__file__).parents[1]


def given(area: float = 0.08, friction: float = 0.008):
    scenario = sledenv.load_scenario("skeleton_run")
    context = scenario.sample(np.random.default_rng(0))._replace(friction=friction, restitution=0.1, speed=11.0)
    body, law, slope, launch = scenario.given(context)
    return body.replace(drag_area=area), law, slope, launch


@pytest.mark.parametrize(
    ("area", "time", "highest", "mean"),
    [(0.0, 35.44, 146, 102.4), (0.05, 37.74, 126, 96.1), (0.08, 39.17, 117, 92.6), (0.1, 40.14, 111, 90.4)],
)
def test_the_run_takes_what_the_page_says(area, time, highest, mean):
    run = sledenv.simulate(*given(area), record="trajectory", max_time=120.0)
    rows = run.trajectory
    assert run.status == "finish"
    assert run.time == pytest.approx(time, abs=0.006)
    assert 3.6 * np.hypot(rows["u"], rows["v"]).max() == pytest.approx(highest, abs=0.51)
    assert 3.6 * 1008.0 / run.time == pytest.approx(mean, abs=0.06)
    assert abs(run.energy.residual) < 1e-11 * run.energy.turnover


def test_air_takes_what_differs_between_two_runs_along_the_same_way():
    """Oracle: work and energy; both slide in contact, so that heights are the same at the finish."""
    without, with_air = (sledenv.simulate(*given(area), max_time=120.0) for area in (0.0, 0.08))
    lost = with_air.energy.drag + with_air.energy.sliding + with_air.energy.rolling + with_air.energy.hysteresis
    other = without.energy.sliding + without.energy.rolling + without.energy.hysteresis
    assert with_air.energy.kinetic + lost == pytest.approx(without.energy.kinetic + other, rel=1e-4)
    assert with_air.energy.drag > 3.5 * with_air.energy.sliding


def test_the_time_changes_as_the_page_says():
    names = ("drag_area", "friction", "u", "mass", "air_density")
    found = sensitivity(*given(), sledenv.Settings(max_time=120.0), parameters=names)
    changes = [found.of_end("t", name) * step for name, step in zip(names, (0.01, 0.001, 1.0, 1.0, 0.1), strict=True)]
    assert changes == pytest.approx([0.48, 0.16, -0.69, -0.03, 0.32], abs=0.006)


def test_the_staircase_of_zones_on_the_page_takes_what_it_says(capsys):
    names = draw.run(draw.blocks(ROOT / "docs" / "skeleton.md"))
    mean = sledenv.simulate(*given(friction=float(names["friction"].mean())), max_time=120.0)
    assert [names["run"].time, mean.time] == pytest.approx([39.00, 39.15], abs=0.006)
