"""The one place where a descent depends on its contact law: its type chooses the code, when that is compiled."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sledenv.compiler.jit import by_type, kernel
from sledenv.kernel import normal
from sledenv.kernel.contact import follow
from sledenv.kernel.params import CompliantLaw, Incline, Limits, RigidLaw, reader
from sledenv.kernel.progress import begin_with_approaching, touches
from sledenv.kernel.records import INCONSISTENT, RUNNING, SEPARATED, TUMBLED, TWO_POINTS
from sledenv.kernel.rigid import strike

Law = CompliantLaw | RigidLaw


@kernel
def _meet(body: np.void, law: CompliantLaw, slope: Incline, left: int, space: np.void) -> int:
    """Let compliant surfaces touch: arguments and result are those of :func:`sledenv.kernel.rigid.strike`."""
    contact = space["contact"]
    normal.write_law(law, contact)
    begin_with_approaching(body, contact, space["points"][0], space["touchdown"])
    return RUNNING


_meet_by: Callable[..., int] = by_type(1, {RigidLaw: strike}, _meet)


@kernel
def touch(
    body: np.void, law: Law, slope: Incline, limits: Limits, flight: np.void, space: np.void, trajectory: np.ndarray
) -> int:
    """Follow a touch until the body leaves, or its descent ends.

    Arguments and result are those of :func:`sledenv.kernel.contact.follow`; ``space`` holds the state at touchdown
    in its contact and first point, and the body is written in ``space["hop"]``.
    """
    status = _meet_by(body, law, slope, RUNNING, space)
    while status == RUNNING:
        status = follow(body, slope, limits, flight, space, trajectory)
        if status in (INCONSISTENT, TWO_POINTS):  # rigid surfaces then need an impact
            status = _meet_by(body, law, slope, status, space)
    if status == SEPARATED and touches(body, limits.end_part, space["contact"], space["points"]):
        return TUMBLED
    return status


# law_of_row(like, laws, lane): a law of the same kind as ``like``, with the fields of a lane in a table of laws.
_rigid_of_row, _compliant_of_row = reader(RigidLaw), reader(CompliantLaw)
law_of_row = by_type(
    0,
    {RigidLaw: lambda like, laws, lane: _rigid_of_row(laws, lane)},
    lambda like, laws, lane: _compliant_of_row(laws, lane),
)
