"""How the body touches the slope, for Python: the kernel's own geometry, so that both agree to the last bit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel import geometry
from sledenv.kernel.entries import (
    run_arms,
    run_directions,
    run_feature_geometry,
    run_lowest_support,
    run_support_heights,
)
from sledenv.kernel.geometry import feature_at, has_corners, whole_turns
from sledenv.kernel.params import Body

__all__ = [
    "arms",
    "directions",
    "feature_at",
    "feature_geometry",
    "has_corners",
    "lowest_support",
    "support_height",
    "support_heights",
    "whole_turns",
    "within_a_turn",
]


_MANY_TURNS = 1e5  # [rad]


def arms(body: Body, feature: int, phi: float) -> tuple[float, float]:
    """Arms ``a``, ``b`` [m] of a feature: the contact point lies at (-a, -b) from the mass centre."""
    found = np.empty(2)
    run_arms(body, feature, phi, found)
    a, b = found.tolist()
    return a, b


def feature_geometry(body: Body, feature: int) -> tuple[float, float, float]:
    """Return ``h`` [m], ``r`` [m] and ``shift`` [rad] of a feature: docs/physics.md (8.2)."""
    found = np.empty(3)
    run_feature_geometry(body, feature, found)
    h, r, shift = found.tolist()
    return h, r, shift


def lowest_support(body: Body) -> float:
    """Smallest support height [m] over all orientations, from which the supplied energy is counted."""
    found = np.empty(1)
    run_lowest_support(body, found)
    return float(found[0])


def support_height(body: Body, phi: float) -> float:
    """Height [m] of the mass centre above the slope when the lowest point of the body touches it."""
    height = np.empty(1)
    run_support_heights(body, (phi,), height)
    return float(height[0])


def support_heights(bodies: Body | NDArray[np.float64], phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Support height [m] at each of many orientations [rad], shape (N,), of one body or of one a row."""
    phi = np.ascontiguousarray(phi, float)
    heights = np.empty(len(phi))
    run_support_heights(np.ascontiguousarray(np.atleast_2d(bodies), float), phi, heights)
    return heights


def directions(phi: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosine and sine of many angles [rad], shapes (N,): the same whatever N is, NaN where an angle is infinite."""
    cosine, sine = np.empty(len(phi)), np.empty(len(phi))
    with np.errstate(invalid="ignore"):
        run_directions(np.where(np.abs(phi) < _MANY_TURNS, phi, within_a_turn(phi)), cosine, sine)
    return cosine, sine


def within_a_turn(phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles less their whole turns, in [-pi, pi], odd as a mirror is; within that they are left as they are.

    Nothing is rounded, but a turn is the double 2 pi, 4e-17 of itself off. Over all turns this adds up to 0.6 of the
    distance of ``phi`` to the next double at most: hardly more than ``phi`` itself was rounded.
    """
    rest = np.fmod(phi, geometry.TURN)
    return np.where(np.abs(rest) > np.pi, rest - np.copysign(geometry.TURN, rest), rest)
