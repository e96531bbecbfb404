"""How the body touches the slope, for Python: the kernel's own geometry, so that both agree to the last bit."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sledenv.compiler.entries import entry
from sledenv.kernel import geometry
from sledenv.kernel.params import Body, body_of

arms = entry(geometry.arms)
feature_at = entry(geometry.feature_at)
feature_geometry = entry(geometry.feature_geometry)
has_corners = entry(geometry.has_corners)
lowest_support = entry(geometry.lowest_support)
support_height = entry(geometry.support_height)
whole_turns = entry(geometry.whole_turns)


def support_heights(bodies: Body | NDArray[np.float64], phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Support height [m] at each of many orientations [rad], shape (N,), of one body or of one a row."""
    return _support_heights(np.atleast_2d(bodies), phi)


@entry
def _support_heights(bodies: np.ndarray, phi: np.ndarray) -> np.ndarray:
    heights = np.empty(phi.shape[0])
    for i in range(phi.shape[0]):
        heights[i] = geometry.support_height(body_of(bodies, i), phi[i])
    return heights


@entry
def directions(phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cosine and sine of many angles [rad], shapes (N,): the same whatever N is, NaN where an angle is infinite."""
    cosine, sine = np.empty(phi.shape[0]), np.empty(phi.shape[0])
    for i in range(phi.shape[0]):
        cosine[i], sine[i] = math.cos(phi[i]), math.sin(phi[i])
    return cosine, sine


def within_a_turn(phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles less their whole turns, in [-pi, pi], odd as a mirror is; within that they are left as they are.

    Nothing is rounded, but a turn is the double 2 pi, 4e-17 of itself off. Over all turns this adds up to 0.6 of the
    distance of ``phi`` to the next double at most: hardly more than ``phi`` itself was rounded.
    """
    rest = np.fmod(phi, geometry.TURN)
    return np.where(np.abs(rest) > np.pi, rest - np.copysign(geometry.TURN, rest), rest)
