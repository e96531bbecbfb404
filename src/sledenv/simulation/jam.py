"""How much a rebound or a descent jams: gradual loss, of which being stuck is the extreme; docs/environments.md."""

from __future__ import annotations

from typing import Annotated, Final, NamedTuple, get_type_hints

import numpy as np

from sledenv.kernel.records import BURIED, NON_FINITE, TUMBLED

_CRASHED: Final = (TUMBLED, BURIED, NON_FINITE)


class ReboundJam(NamedTuple):
    """Jam metrics of each rebound, arrays of shape (n,)."""

    grip: np.ndarray  # [-] |tangential impulse| / (friction * normal impulse), 1 where the contact slid throughout
    tangential_loss: np.ndarray  # [-] clip(1 - u_after / u_before, 0, 1)
    stuck: np.ndarray  # bool: neither velocity along the slope nor spin is left
    nearly_stuck: np.ndarray  # bool: both are below 5 % of the entry speed


class Shown(NamedTuple):
    """Marks a metric that pages for a reader show, the replay and the report of a benchmark."""

    unit: str = ""  # none of a ratio


class DescentJam(NamedTuple):
    """Jam metrics of a descent, floats or arrays of shape (n,).

    Whatever is a field here is in the info of the environments, in the words about a descent and in the results of a
    benchmark. Pages show what is marked: progress and retention are parts of the reward, which sums them up.
    """

    progress: np.ndarray  # [-] x_end / length, clipped to [0, 1]; 1 once past the line, 0 on a slope without end
    retention: np.ndarray  # [-] energy of motion along the ground at the line over all supplied; 0 of a crash
    reward: Annotated[np.ndarray, Shown()]  # [-] progress / 2 + sqrt(retention) / 2, in [0, 1]

    @property
    def jam_index(self) -> np.ndarray:
        """1 - reward: 0 for a descent that lost nothing, 1 for one that never moved."""
        return 1.0 - self.reward


SHOWN: Final[dict[str, Shown]] = {
    name: mark
    for name, kind in get_type_hints(DescentJam, include_extras=True).items()
    for mark in getattr(kind, "__metadata__", ())
}


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


@np.errstate(over="ignore", under="ignore")  # a speed may be too small to be squared
def descent_jam(outcomes: np.ndarray | np.void, mass: np.ndarray | float, length: np.ndarray | float) -> DescentJam:
    """Return the jam metrics of ``outcomes`` (an OUTCOME array or record) for bodies of ``mass`` [kg].

    The retention compares the kinetic energy of the motion along the ground at the line with *all* energy supplied up
    to there: launch translation, launch spin, drop height and slope. A descent that spins, hops high or hovers until
    the time is over gains nothing by it. One that crashes in the run-out behind the line keeps nothing.
    """
    status = outcomes["status"]
    passed = outcomes["t_line"] < np.inf
    finished = passed & ~np.isin(status, _CRASHED)
    x = np.where(status == NON_FINITE, 0.0, np.where(passed, length, outcomes["x"]))
    u = np.where(finished, np.maximum(outcomes["u_line"], 0.0), 0.0)
    supplied = np.where(finished, outcomes["supplied"], 1.0)
    # Nothing supplied, nothing kept: the quotient is 0, not that of two zeros. (np.clip takes five times as long.)
    retention = np.minimum(0.5 * mass * np.square(u) / np.where(supplied > 0.0, supplied, np.inf), 1.0)
    progress = np.minimum(np.maximum(x / length, 0.0), 1.0)
    return DescentJam(progress, retention, 0.5 * progress + 0.5 * np.sqrt(retention))
