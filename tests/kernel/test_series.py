"""The series of a step obey the equations of motion, and a step that is completed is what the series say."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from sledenv.compiler.rows import WIDTH
from sledenv.kernel.descend import SPACE
from sledenv.kernel.friction import Drive, Mobility, rates_of
from sledenv.kernel.recurrence import expand
from sledenv.kernel.state import new
from sledenv.kernel.step import complete
from tests.compiled import compiled

BRANCHES = [branch for branch in itertools.product((0, -1, 1), repeat=3) if any(branch)]
MASS, INERTIA, H, R, FRICTION, ARM, STIFFNESS = 1.3, 0.02, 0.07, 0.15, 0.4, 0.01, 2e5
INWARD, DOWNHILL = 9.0, 2.5


@compiled
def _expand(spaces: np.ndarray) -> None:
    expand(spaces[0])


@compiled
def _complete(spaces: np.ndarray) -> None:
    complete(spaces[0]["contact"], spaces[0]["points"][0], spaces[0]["steps"][0])


def expanded(branch: tuple[int, int, int]) -> np.ndarray:
    """Return the space of a contact in a branch, with the series of a step."""
    gap_rate, slip, spin = branch
    spaces = new(SPACE)
    contact, point, step = spaces[0]["contact"], spaces[0]["points"][0], spaces[0]["steps"][0]
    contact["count"] = 1.0
    contact["per_mass"], contact["ratio"] = 1.0 / MASS, MASS / INERTIA
    point["h"], point["r"] = H, R
    point["gap_rate"], point["slip"], contact["spin"] = branch
    point["friction"], point["arm"] = FRICTION, ARM
    point["stiffness"], contact["inward"], contact["downhill"] = STIFFNESS, INWARD, DOWNHILL
    contact["phi"] = step["theta"] = 0.8
    step["sine"], step["cosine"] = math.sin(0.8), math.cos(0.8)
    step["unit"] = 1.5e-3
    point["gap"] = -2e-3
    point["v_n"], point["v_t"], contact["omega"] = 1.1 * gap_rate, 0.7 * slip, 6.0 * spin
    point["other"] = math.inf
    contact["k_closing"] = contact["k_opening"] = STIFFNESS
    _expand(spaces)
    return spaces


def value(coefficients: np.ndarray, s: float) -> float:
    """Value of a series."""
    return float(np.polyval(coefficients[::-1], s))


def rate(coefficients: np.ndarray, s: float) -> float:
    """Rate of a series [1/unit]."""
    return float(np.polyval((coefficients * np.arange(WIDTH))[:0:-1], s))


@pytest.mark.parametrize("branch", BRANCHES)
def test_the_series_obey_the_equations_of_motion(branch: tuple[int, int, int]) -> None:
    """Oracle: friction.rates_of with the forces of the series; locked velocities stay zero."""
    gap_rate, slip, spin = branch
    step = expanded(branch)[0]["steps"][0]
    unit = step["unit"]
    for s in (0.0, 0.3, 0.8):
        theta, omega, normal = (value(step[name], s) for name in ("phi", "omega", "normal"))
        a, b = H * math.sin(theta), R - H * math.cos(theta)
        force = -slip * FRICTION * normal if slip != 0 else value(step["force"], s)
        moment = -spin * ARM * normal if spin != 0 else value(step["moment"], s)
        drive = Drive(DOWNHILL + a * omega**2, -INWARD - H * math.cos(theta) * omega**2)
        w = Mobility(1.0 / MASS, 1.0 / INERTIA, a, b)
        rate_t, rate_w, rate_n = rates_of(w, drive, force, moment, normal)
        size = abs(drive.n) + abs(normal) / MASS + R * abs(rate_w)
        assert rate(step["v_t"], s) / unit == pytest.approx(rate_t, abs=1e-10 * size)
        assert rate(step["omega"], s) / unit == pytest.approx(rate_w, abs=1e-10 * size / R)
        assert rate(step["v_n"], s) / unit == pytest.approx(rate_n, abs=1e-10 * size)
        assert rate(step["gap"], s) / unit == pytest.approx(value(step["v_n"], s), abs=1e-12)
        assert rate(step["phi"], s) / unit == pytest.approx(omega, abs=1e-12)
        assert rate(step["x"], s) / unit == pytest.approx(value(step["v_t"], s) - b * omega, abs=1e-12)
        for velocity, sign in (("v_n", gap_rate), ("v_t", slip), ("omega", spin)):
            assert sign != 0 or not step[velocity].any()
        if gap_rate != 0:
            assert normal == pytest.approx(-STIFFNESS * value(step["gap"], s), rel=1e-12)


@pytest.mark.parametrize("branch", BRANCHES)
def test_a_completed_step_is_that_of_the_series(branch: tuple[int, int, int]) -> None:
    """Oracle: the polynomials, and their integrals by Gauss-Legendre quadrature; bounds hold on a fine grid."""
    spaces = expanded(branch)
    step = spaces[0]["steps"][0]
    length = step["length"] = 0.7
    _complete(spaces)
    unit = step["unit"]
    for name in ("x", "phi", "gap", "v_n", "v_t", "omega"):
        assert step[f"{name}_end"] == pytest.approx(value(step[name], length), rel=1e-13, abs=1e-15)
    nodes, weights = np.polynomial.legendre.leggauss(30)
    at = 0.5 * length * (nodes + 1.0)
    normal = np.array([value(step["normal"], s) for s in at])
    for answer, factor in (
        ("normal_impulse", np.ones(30)),
        ("slip_work", np.array([value(step["v_t"], s) for s in at])),
        ("spin_work", np.array([value(step["omega"], s) for s in at])),
    ):
        exact = 0.5 * length * unit * float(weights @ (normal * factor))
        assert step[answer] == pytest.approx(exact, rel=1e-12, abs=1e-14)
    grid = np.linspace(0.0, length, 400)
    for safe, name in (("safe_v_n", "v_n"), ("safe_v_t", "v_t"), ("safe_omega", "omega")):
        if step[safe] > 0.0:
            assert min(abs(value(step[name], s)) for s in grid) >= 0.999 * step[safe]
    assert max(abs(value(step["phi"], s) - value(step["phi"], 0.0)) for s in grid) <= 1.001 * step["turn"]
