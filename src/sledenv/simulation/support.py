"""How the body touches the slope, for Python, and how high it must be so that no part of it is under the ground.

The geometry is the kernel's own, so that both agree to the last bit.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.arithmetic import TURN
from sledenv.kernel.entries import run_directions, run_lowest, run_resting
from sledenv.simulation.bodies import Body
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.scene import Slope, State

Floats = NDArray[np.float64]

FLAT: Final = 1e-6  # [rad] by which a body may be turned and still lies flat
_MANY_TURNS = 1e5  # [rad]


def lowest_arms(bodies: np.ndarray, phi: Floats, numbers: Floats | None = None) -> tuple[NDArray[np.int64], Floats]:
    """Which arc is lowest at each of many orientations [rad], shape (N,), and its arms a, b [m], shape (N, 2).

    The contact point lies at (-a, -b) from the mass centre. ``bodies`` are records of kernel.outline.BODY, of which
    ``numbers`` say, shape (N,), which is turned; without them it is the only one, or one each.
    """
    phi = np.ascontiguousarray(phi, float)
    arcs, arms = np.empty(len(phi), np.int64), np.empty((len(phi), 2))
    run_lowest(bodies, _numbers(bodies, numbers, len(phi)), phi, arcs, arms)
    return arcs, arms


def _numbers(bodies: np.ndarray, numbers: Floats | None, count: int) -> Floats:
    if numbers is not None:
        return np.ascontiguousarray(numbers, float)
    return np.zeros(count) if len(bodies) == 1 else np.arange(float(count))


def arms_beside(body: Body, phi: float) -> Floats:
    """Arms a, b [m] of the lowest points just to both sides of an orientation [rad], shape (2, 2).

    Where a body lies flat they are those of the ends of its side.
    """
    return lowest_arms(body.record, np.array([phi - FLAT, phi + FLAT]))[1]


def support_height(body: Body, phi: float) -> float:
    """Height [m] of the mass centre above the slope when the lowest point of the body touches it."""
    return float(support_heights(body.record, np.array([phi]))[0])


def support_heights(bodies: Body | np.ndarray, phi: Floats, numbers: Floats | None = None) -> Floats:
    """Support height [m] at each of many orientations [rad], shape (N,); bodies as in :func:`lowest_arms`, or one."""
    return lowest_arms(bodies.record if isinstance(bodies, Body) else bodies, phi, numbers)[1][:, 1]


def directions(phi: Floats) -> tuple[Floats, Floats]:
    """Cosine and sine of many angles [rad], shapes (N,): the same whatever N is, NaN where an angle is infinite."""
    cosine, sine = np.empty(len(phi)), np.empty(len(phi))
    with np.errstate(invalid="ignore"):
        run_directions(np.where(np.abs(phi) < _MANY_TURNS, phi, within_a_turn(phi)), cosine, sine)
    return cosine, sine


def within_a_turn(phi: Floats) -> Floats:
    """Return angles less their whole turns, in [-pi, pi], odd as a mirror is; within that they are left as they are.

    Nothing is rounded, but a turn is the double 2 pi, 4e-17 of itself off. Over all turns this adds up to 0.6 of the
    distance of ``phi`` to the next double at most: hardly more than ``phi`` itself was rounded.
    """
    rest = np.fmod(phi, TURN)
    return np.where(np.abs(rest) > np.pi, rest - np.copysign(TURN, rest), rest)


def resting_heights(
    bodies: np.ndarray, x: Floats, phi: Floats, ground: Grounds, numbers: Floats | None = None
) -> Floats:
    """Heights [m] of mass centres over the plane of the slope at which the bodies touch the ground from above.

    Parameters
    ----------
    bodies : ndarray of kernel.outline.BODY
    x : ndarray, shape (N,)
        Places [m] of the mass centres along the slope.
    phi : ndarray, shape (N,)
        Orientations [rad] in [-pi, pi].
    ground : Grounds
        Of one lane for all, or of N.
    numbers : ndarray, shape (N,), optional
        Which of the bodies each is; without them it is the only one, or one each.

    Returns
    -------
    ndarray, shape (N,)
        A body that is lower by some length is under the ground by as much, along the normal of the slope's plane.
    """
    count, spans = len(x), ground.places
    begins, ends = np.ascontiguousarray((spans if len(spans) == count else np.broadcast_to(spans, (count, 2))).T)
    places, turns, heights = np.ascontiguousarray(x, float), np.ascontiguousarray(phi, float), np.empty(count)
    run_resting(bodies, _numbers(bodies, numbers, count), places, turns, ground.pieces, begins, ends, heights)
    return heights


def clearance(body: Body, slope: Slope, launch: State) -> float:
    """Return how far [m] a body could be lowered until it touches the ground."""
    phi, ground = within_a_turn(np.array([launch.phi])), Grounds.of((slope.vertices,))
    return launch.y - float(resting_heights(body.record, np.array([launch.x]), phi, ground)[0])
