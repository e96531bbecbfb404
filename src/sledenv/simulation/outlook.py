"""What lanes are told of the ground under them and around them, and of where their flights land."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.entries import run_lay_each, run_outlook
from sledenv.kernel.geometry import PIECE
from sledenv.kernel.outlook import AHEAD, BEHIND, LANDING, PLACES, VERTEX

__all__ = ["AHEAD", "BEHIND", "LANDING", "PLACES", "VERTEX", "Outlook", "ground_of", "look_out"]

Floats = NDArray[np.float64]
Ground = tuple[Floats, np.ndarray]  # which pieces a lane has, (1 or n, 2), and kernel.geometry.PIECE of all tracks

_LANDING: Final = len(LANDING) + 2 * len(PLACES)


class Outlook(NamedTuple):
    """What is told of n lanes, in SI units."""

    under: Floats  # [m] height of the ground under each mass centre, (n,)
    around: Floats  # of two vertices behind and eight ahead ``VERTEX``, less the ground there, (n, 10, 3)
    landings: Floats  # ``LANDING``, then heights and angles of the ground at ``PLACES``, (n, 47); (0, 47) if not asked


def ground_of(vertices: Floats) -> Ground:
    """Return what the kernel reads of grounds with such vertices, shape (N, M, 3), inf behind the last one of each."""
    there = np.isfinite(vertices[..., 0])
    ends = np.cumsum(there.sum(axis=1) + 1)
    tracks = np.stack([np.r_[0, ends[:-1]], ends], axis=-1).astype(float)
    pieces = np.zeros(ends[-1], PIECE)
    run_lay_each(vertices[there], tracks, pieces)
    return tracks, pieces


def look_out(
    ground: Ground,
    flights: np.ndarray,
    angles: Floats | None = None,
    gravity: float = 0.0,
    lying: Floats | None = None,
) -> Outlook:
    """Look around lanes, and ahead where angles are given.

    Parameters
    ----------
    ground : pair of ndarray
        See :func:`ground_of`.
    flights : ndarray of OUTCOME, shape (n,)
        Where the lanes are.
    angles : ndarray, shape (n,), optional
        Of the slopes [rad]: then landings are foreseen, see :func:`sledenv.kernel.outlook.foresee`.
    gravity : float
        [m/s^2]
    lying : ndarray, shape (n,), optional
        Support heights [m] of the bodies as they lie.
    """
    tracks, pieces = ground
    lanes = len(flights)
    none = np.empty(0)
    landings = np.zeros((0 if angles is None else lanes, _LANDING))
    under, around = np.zeros(lanes), np.zeros((lanes, (BEHIND + AHEAD) * len(VERTEX)))
    of_landing = (none if angles is None else np.ascontiguousarray(angles), gravity, none if lying is None else lying)
    run_outlook(pieces, tracks, *of_landing, flights, under, around, landings)
    return Outlook(under, around.reshape(lanes, BEHIND + AHEAD, len(VERTEX)), landings)
