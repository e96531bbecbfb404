"""How much a rebound or a descent jams: gradual loss, of which being stuck is the extreme; docs/environments.md."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sledenv.kernel.entries import run_judge
from sledenv.kernel.jam import SHARE_OF_PROGRESS, SHOWN, DescentJam, Shown

__all__ = ["SHARE_OF_PROGRESS", "SHOWN", "DescentJam", "ReboundJam", "Shown", "descent_jam", "rebound_jam"]


class ReboundJam(NamedTuple):
    """Jam metrics of each rebound, arrays of shape (n,)."""

    grip: np.ndarray  # [-] |tangential impulse| / (friction * normal impulse), 1 where the contact slid throughout
    tangential_loss: np.ndarray  # [-] clip(1 - u_after / u_before, 0, 1)
    stuck: np.ndarray  # bool: neither velocity along the slope nor spin is left
    nearly_stuck: np.ndarray  # bool: both are below 5 % of the entry speed


@np.errstate(over="ignore", under="ignore")  # a speed may be a subnormal number
def rebound_jam(rebounds: np.ndarray, friction: np.ndarray) -> ReboundJam:
    """Return the jam metrics of each row of ``rebounds`` (a REBOUND array) at its Coulomb coefficient of ``friction``.

    The one where it began counts: a contact that slides on into another zone may have a grip below 1 nevertheless.
    """
    available = friction * rebounds["normal_impulse"]
    grip = np.divide(
        np.abs(rebounds["tangential_impulse"]), available, out=np.zeros(rebounds.shape), where=available > 0.0
    )
    before = rebounds["u_before"]
    grip = np.minimum(grip, 1.0)  # rounding, of a subnormal friction too
    kept = np.divide(rebounds["u_after"], before, out=np.ones(rebounds.shape), where=before != 0.0)
    return ReboundJam(grip, np.clip(1.0 - kept, 0.0, 1.0), rebounds["stuck"] == 2, rebounds["stuck"] >= 1)


@np.errstate(over="ignore", under="ignore")  # as plain Python: a speed may be too small to be squared
def descent_jam(outcomes: np.ndarray | np.void, mass: np.ndarray | float, length: np.ndarray | float) -> DescentJam:
    """Return the jam metrics of ``outcomes`` (an OUTCOME array or record) for bodies of ``mass`` [kg].

    The retention compares the kinetic energy of the motion along the ground at the finish with *all* energy supplied up
    to there: launch translation, launch spin, drop height and slope. A descent that spins, hops high or hovers until
    the time is over gains nothing by it. One that falls in the run-out keeps nothing.
    """
    flights, masses, lengths = np.asarray(outcomes), np.asarray(mass, float), np.asarray(length, float)
    shape = np.broadcast(flights, masses, lengths).shape
    metrics = np.empty((math.prod(shape), len(DescentJam._fields)))
    run_judge(_each(flights, shape), _each(masses, shape), _each(lengths, shape), metrics)
    return DescentJam(*np.ascontiguousarray(metrics.T).reshape(len(DescentJam._fields), *shape))


def _each(table: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return a table as the kernel takes it: one entry for all, or one for each."""
    return (table if table.size == 1 or table.shape == shape else np.broadcast_to(table, shape)).ravel()
