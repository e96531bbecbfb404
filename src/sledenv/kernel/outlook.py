"""The ground around a place, and where a flight lands: closed forms that agents are told."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.air import pulled
from sledenv.kernel.arithmetic import angle_of, sine_cosine, wrap
from sledenv.kernel.geometry import first_piece, height_at, tangent_at
from sledenv.kernel.outline import support_height
from sledenv.kernel.params import Scenes, incline_of

BEHIND: Final = 2  # vertices that are told of the ground behind a place
AHEAD: Final = 8  # and ahead of it
VERTEX: Final = ("x", "y", "radius", "there")  # [m, m, m, -] what is told of each
# [m] along the slope from where the mass centre lands: there the ground is told too.
PLACES: Final = (
    *(-1.6, -1.2, -0.8, -0.5, -0.25, 0.25, 0.5, 0.8, 1.2, 1.6),
    *(2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0),
)
LANDING: Final = ("time", "distance", "pitch", "approach", "speed", "pose", "spin")  # what is told of a landing itself
_PLACES: Final = np.array(PLACES)
_STEP: Final = 0.02  # [s] between two looks at a flight
_LOOKS: Final = 150  # after which it counts as landing: boulders fly for seconds
_HALVINGS: Final = 30  # of a step: the time of a landing is as exact as doubles of its place


@kernel
def _ground_at(pieces: np.ndarray, last: int, x: float) -> tuple[float, float, float]:
    """Height [m] and tangent of the ground at a place as far as it is told: behind the vertex ``last`` it is level.

    That vertex is sharp: how it is rounded depends on what is behind it.
    """
    if last < pieces.shape[0] and x > pieces[last]["bx"]:
        vertex, before = pieces[last], pieces[last - 1]
        if x >= vertex["x"]:
            return vertex["y"], 1.0, 0.0
        tx, ty = before["tx"], before["ty"]
        return vertex["y"] + (x - vertex["x"]) * (ty / tx), tx, ty
    along, up = tangent_at(pieces, x)
    return height_at(pieces, x), along, up


@kernel
def _clearance(pieces: np.ndarray, last: int, x: float, y: float, lying: float) -> tuple[float, float, float]:
    """How far [m] a body that lies is over the ground, and the tangent there."""
    height, along, up = _ground_at(pieces, last, x)
    return (y - height) * along - lying, along, up


@kernel
def look_around(pieces: np.ndarray, x: float, around: np.ndarray) -> tuple[float, int]:
    """Write the vertices next to a place [m]; return the height [m] of the ground there, and the last vertex told.

    Parameters
    ----------
    pieces : ndarray of PIECE
    x : float
        A vertex at the place itself is behind it.
    around : ndarray, shape ((BEHIND + AHEAD) * 4,)
        Zeros. Of each vertex x and y less those of the ground at the place, the radius of its bend, and 1 if there is
        such a vertex. Of the last one no radius is told: how it is rounded depends on what is behind it.
    """
    reached, under = first_piece(pieces, x), height_at(pieces, x)
    for i in range(BEHIND + AHEAD):
        j, k = reached - BEHIND + 1 + i, 4 * i
        if 0 < j < pieces.shape[0]:
            around[k], around[k + 1], around[k + 3] = pieces[j]["x"] - x, pieces[j]["y"] - under, 1.0
            if i < BEHIND + AHEAD - 1:
                around[k + 2] = pieces[j]["radius"]
    return under, reached + AHEAD


@kernel
def foresee(
    pieces: np.ndarray,
    last: int,
    downhill: float,
    inward: float,
    lying: float,
    flight: np.void,
    landing: np.ndarray,
) -> None:
    """Write where a flight lands if its rider lends no spin: the mass centre flies a parabola.

    With air that is true to first order: drag counts as that at the begin of the flight throughout.

    It lands where a body that lies on the ground would touch it. The ground behind the last vertex that is told counts
    as level.

    Parameters
    ----------
    pieces : ndarray of PIECE
    last : int
        Number of the last vertex that is told, see :func:`look_around`.
    downhill, inward : float
        Acceleration [m/s^2] along the slope, and along its inward normal.
    lying : float
        Support height [m] of the body as it lies.
    flight : record of OUTCOME
        Where it begins.
    landing : ndarray, shape (len(LANDING) + 2 * len(PLACES),)
        Time [s], distance along the slope [m], angle of the ground [rad], velocities [m/s] into and along the ground,
        pose less that angle [rad], spin [rad/s]; then heights [m] of the ground at ``PLACES`` less that of the landing,
        and its angles [rad] there.
    """
    x0, y0, u0, v0 = flight["x"], flight["y"], flight["u"], flight["v"]
    spin, time = flight["omega"] - flight["trim_spin"], _STEP * _LOOKS
    for k in range(1, _LOOKS + 1):
        t = _STEP * k
        x, y = x0 + (u0 + 0.5 * downhill * t) * t, y0 + (v0 - 0.5 * inward * t) * t
        clear, along, up = _clearance(pieces, last, x, y, lying)
        if clear <= 0.0 and along * (v0 - inward * t) < up * (u0 + downhill * t):
            early, late = t - _STEP, t
            for _ in range(_HALVINGS):
                middle = 0.5 * (early + late)
                x, y = x0 + (u0 + 0.5 * downhill * middle) * middle, y0 + (v0 - 0.5 * inward * middle) * middle
                if _clearance(pieces, last, x, y, lying)[0] > 0.0:
                    early = middle
                else:
                    late = middle
            time = late
            break
    x = x0 + (u0 + 0.5 * downhill * time) * time
    u, v = u0 + downhill * time, v0 - inward * time
    height, along, up = _ground_at(pieces, last, x)
    pitch = angle_of(up, along)
    landing[0], landing[1], landing[2] = time, x - x0, pitch
    landing[3], landing[4] = up * u - along * v, along * u + up * v
    landing[5], landing[6] = wrap(wrap(flight["phi"]) + spin * time - pitch), spin
    most = len(LANDING)
    for k in range(_PLACES.shape[0]):
        there, along, up = _ground_at(pieces, last, x + _PLACES[k])
        landing[most + k], landing[most + _PLACES.shape[0] + k] = there - height, angle_of(up, along)


def look_out(scenes: Scenes, flights: np.ndarray, around: np.ndarray, landings: np.ndarray) -> None:
    """Write what lanes are told of their pose, of the ground around them and of their landings, in place of zeros.

    Parameters
    ----------
    scenes : Scenes
        Of n lanes.
    flights : ndarray of OUTCOME, shape (n,)
    around : ndarray, shape (n, 3 + (BEHIND + AHEAD) * len(VERTEX))
        Sine and cosine of the orientation, height [m] of the ground under the mass centre; then :func:`look_around`.
    landings : ndarray, shape (n, len(LANDING) + 2 * len(PLACES)) or (0, ...)
        Of :func:`foresee`, of a body that flies; without rows they are left out.
    """
    for i in range(flights.shape[0]):
        scene, flight = scenes.rows[i], flights[i]
        ground, body = scenes.pieces[int(scene["ground"]) : int(scene["ground_end"])], scenes.bodies[int(scene["body"])]
        if not math.isfinite(flight["x"] + flight["y"] + flight["phi"] + flight["u"] + flight["v"]):
            continue  # it has overflowed, and ended
        around[i, 0], around[i, 1] = sine_cosine(wrap(flight["phi"]))
        around[i, 2], last = look_around(ground, flight["x"], around[i, 3:])
        if landings.shape[0] > 0:
            incline, lying = pulled(incline_of(scene, body), flight), support_height(body, 0.0)
            foresee(ground, last, incline.downhill, incline.inward, lying, flight, landings[i])
