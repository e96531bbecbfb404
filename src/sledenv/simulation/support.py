"""How the body touches the slope, for Python: the kernel's own geometry, so that both agree to the last bit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.arithmetic import TURN
from sledenv.kernel.entries import run_directions, run_lowest
from sledenv.simulation.bodies import Body

__all__ = ["directions", "lowest_arms", "support_height", "support_heights", "within_a_turn"]


_MANY_TURNS = 1e5  # [rad]


def lowest_arms(bodies: np.ndarray, phi: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Which arc is lowest at each of many orientations [rad], shape (N,), and its arms a, b [m], shape (N, 2).

    The contact point lies at (-a, -b) from the mass centre. ``bodies`` is one record of kernel.outline.BODY, or N.
    """
    phi = np.ascontiguousarray(phi, float)
    arcs, arms = np.empty(len(phi), np.int64), np.empty((len(phi), 2))
    run_lowest(bodies, phi, arcs, arms)
    return arcs, arms


def support_height(body: Body, phi: float) -> float:
    """Height [m] of the mass centre above the slope when the lowest point of the body touches it."""
    return float(support_heights(body.record, np.array([phi]))[0])


def support_heights(bodies: Body | np.ndarray, phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Support height [m] at each of many orientations [rad], shape (N,), of one body or of N records of bodies."""
    return lowest_arms(bodies.record if isinstance(bodies, Body) else bodies, phi)[1][:, 1]


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
    rest = np.fmod(phi, TURN)
    return np.where(np.abs(rest) > np.pi, rest - np.copysign(TURN, rest), rest)
