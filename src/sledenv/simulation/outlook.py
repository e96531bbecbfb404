"""The ground under lanes and around them, and where their flights land, as far as they are told."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.entries import run_outlook
from sledenv.kernel.outlook import AHEAD, BEHIND, LANDING, PLACES, VERTEX
from sledenv.simulation.scenes import Scenes

__all__ = ["AHEAD", "BEHIND", "LANDING", "PLACES", "VERTEX", "Outlook", "look_out"]

Floats = NDArray[np.float64]

_LANDING: Final = len(LANDING) + 2 * len(PLACES)


class Outlook(NamedTuple):
    """Ground and landings of n lanes, in SI units; 0 of a lane whose numbers have overflowed."""

    sine: Floats  # of the orientation, (n,)
    cosine: Floats
    under: Floats  # [m] height of the ground under each mass centre, (n,)
    around: Floats  # of two vertices behind and eight ahead ``VERTEX``, less the ground there, (n, 10, 4)
    landings: Floats  # ``LANDING``, then heights and angles of the ground at ``PLACES``, (n, 47); (0, 47) if not asked


def look_out(scenes: Scenes, flights: np.ndarray, *, ahead: bool = True) -> Outlook:
    """Look around lanes where their flights, an array of OUTCOME of shape (n,), begin; and ahead, if asked for.

    What is foreseen of a landing is told by :func:`sledenv.kernel.outlook.foresee`.
    """
    lanes, vertices = len(flights), BEHIND + AHEAD
    landings = np.zeros((lanes if ahead else 0, _LANDING))
    around = np.zeros((lanes, 3 + vertices * len(VERTEX)))
    run_outlook(*scenes.given, flights, around, landings)
    sine, cosine, under = around[:, :3].T
    return Outlook(sine, cosine, under, around[:, 3:].reshape(lanes, vertices, len(VERTEX)), landings)
