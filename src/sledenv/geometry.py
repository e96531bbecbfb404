"""How the body touches the slope, for Python: the kernel's own geometry, so that both agree to the last bit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sledenv.entries import entry
from sledenv.kernel import geometry

arms = entry(geometry.arms)
directions = entry(geometry.directions)
feature_at = entry(geometry.feature_at)
feature_geometry = entry(geometry.feature_geometry)
has_corners = entry(geometry.has_corners)
lowest_support = entry(geometry.lowest_support)
support_height = entry(geometry.support_height)
support_heights = entry(geometry.support_heights)
whole_turns = entry(geometry.whole_turns)


def within_a_turn(phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return angles less their whole turns, in [-pi, pi], odd as a mirror is; within that they are left as they are.

    Nothing is rounded, but a turn is the double 2 pi, 4e-17 of itself off. Over all turns this adds up to 0.6 of the
    distance of ``phi`` to the next double at most: hardly more than ``phi`` itself was rounded.
    """
    rest = np.fmod(phi, geometry.TURN)
    return np.where(np.abs(rest) > np.pi, rest - np.copysign(geometry.TURN, rest), rest)
