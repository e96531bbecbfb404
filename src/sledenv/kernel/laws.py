"""The one place where a descent tells its contact laws apart: by the type of the law, when it is compiled."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import config
from numba.extending import overload

from sledenv.kernel.chord import chord_contact
from sledenv.kernel.contact import follow
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, ContactLaw, Incline, Limits, RigidLaw
from sledenv.kernel.records import BOTH_CORNERS, ONE_CORNER, TUMBLED
from sledenv.kernel.rigid import strike

Law = ContactLaw | RigidLaw
_Law = TypeVar("_Law", ContactLaw, RigidLaw, Law)

# Between two corners that hand a body over to each other so often, each time within a share of the time that a contact
# takes, it lies on its chord: hand-overs accumulate at the moment from which on both touch.
MOST_IDLE = 30
BRIEF = 1e-9


@kernel
def _meet(
    body: Body,
    law: ContactLaw,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    space: np.void,
    trajectory: np.ndarray,
) -> int:
    """Follow a touch of compliant surfaces, with one point or with both corners, until the body leaves or rests."""
    contact = space["contact"]
    contact["k_closing"] = law.stiffness * (1.0 + law.asymmetry)
    contact["k_opening"] = law.stiffness * (1.0 - law.asymmetry)
    contact["friction"] = law.friction
    contact["arc_arm"], contact["corner_arm"] = law.rolling_arm, law.corner_rolling_arm
    contact["most_normal"] = math.inf
    brief = BRIEF * math.sqrt(body.mass / contact["k_closing"])
    idle = 0
    while True:
        start = contact["time"]
        status = follow(body, slope, limits, flight, contact, space["step"], trajectory)
        if status != BOTH_CORNERS:
            return status
        contact["on_chord"] = 1.0
        status = chord_contact(body, slope, limits, flight, contact, space["chord"], trajectory)
        if status != ONE_CORNER:
            return status
        idle = 0 if contact["time"] - start > brief else idle + 1
        if idle > MOST_IDLE:
            return TUMBLED


def by_law(compliant: Callable[..., Any], rigid: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function whose second argument is a law, the type of which chooses the kernel when it is compiled.

    Both kernels have the same names of arguments.
    """

    def choice(*given: Any) -> Any:
        return (rigid if isinstance(given[1], RigidLaw) else compliant)(*given)

    if not config.DISABLE_JIT:  # type: ignore[attr-defined]

        @overload(choice, strict=False)
        def chosen(*given: Any) -> Callable[..., Any]:
            return rigid if given[1].instance_class is RigidLaw else compliant

    return choice


# Follow a touch until the body leaves, or its descent ends; return SEPARATED or the status of the descent.
touch = by_law(_meet, strike)


def law_of_row(like: _Law, row: np.ndarray) -> _Law:
    """Return a law of the same kind as ``like`` with the fields of an array of shape (5,)."""
    return type(like)(row[0], row[1], row[2], row[3], row[4])


@overload(law_of_row)
def _law_of_row(like: Any, row: Any) -> Callable[..., Any]:
    kind = like.instance_class

    def build(like: Any, row: Any) -> Any:
        return kind(row[0], row[1], row[2], row[3], row[4])

    return build
