"""How much a descent jams: each metric has its name, its mark and its formula here, for Python and for pages."""

from __future__ import annotations

import math
from typing import Annotated, Any, Final, NamedTuple, get_type_hints

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.records import BURIED, NON_FINITE, TUMBLED

SHARE_OF_PROGRESS: Final = 0.5  # of the reward; the rest is that of the retention


class Shown(NamedTuple):
    """Marks a metric that pages which simulate show beside how a descent ended."""

    unit: str = ""  # none of a ratio


class DescentJam(NamedTuple):
    """Jam metrics of a descent, floats or arrays of shape (n,).

    Whatever is a field here is in the info of the environments, in the words about a descent and in the results of a
    benchmark. Pages show what is marked: progress and retention are parts of the reward, which sums them up.
    """

    progress: np.ndarray  # [-] x_end / length, clipped to [0, 1]; 1 once past the finish, 0 on a slope without end
    retention: np.ndarray  # [-] energy of motion along the ground at the finish over all supplied; 0 after a fall
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


@kernel
def judge(flight: np.void, mass: Any, length: Any) -> DescentJam:
    """Jam metrics, each a float, of a descent (an OUTCOME) of a body of some mass [kg] on a slope of some length [m].

    What is not a number stays so in each clip.
    """
    status, passed = flight["status"], flight["t_line"] < math.inf
    finished = passed and status not in (TUMBLED, BURIED, NON_FINITE)
    x = 0.0 if status == NON_FINITE else length if passed else flight["x"]
    u = 0.0 if not finished or flight["u_line"] <= 0.0 else flight["u_line"]
    # Nothing supplied, nothing kept: the quotient is 0, not that of two zeros.
    supplied = flight["supplied"] if finished and flight["supplied"] > 0.0 else math.inf
    share, kept = x / length, 0.5 * mass * (u * u) / supplied
    # Numbers of one descent; the fields are declared as arrays, of many.
    progress: Any = 0.0 if share <= 0.0 else 1.0 if share > 1.0 else share
    retention: Any = 1.0 if kept > 1.0 else kept
    reward: Any = SHARE_OF_PROGRESS * progress + (1.0 - SHARE_OF_PROGRESS) * math.sqrt(retention)
    return DescentJam(progress=progress, retention=retention, reward=reward)
