"""The one place where a descent tells its contact laws apart: by the type of the law, at compile time."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import types
from numba.extending import lower_builtin, overload, type_callable

from sledenv.kernel.chord import ONE_CORNER, chord_contact
from sledenv.kernel.contact import BOTH_CORNERS, Pair, contact
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, ContactLaw, Incline, Limits, RigidLaw
from sledenv.kernel.records import TUMBLED
from sledenv.kernel.rigid import strike
from sledenv.kernel.series import ROWS, Z_ROWS
from sledenv.kernel.state import ON_CHORD, TIME

Law = ContactLaw | RigidLaw
_Law = TypeVar("_Law", ContactLaw, RigidLaw, Law)

# Between two corners that hand a body over to each other so often, each time within a share of the time that a contact
# takes, it lies on its chord: hand-overs accumulate at the moment from which on both touch.
MOST_IDLE = 30
BRIEF = 1e-9


@kernel
def pair_of(law: ContactLaw) -> Pair:
    """How two surfaces meet by a law of two stiffnesses."""
    return Pair(
        law.stiffness * (1.0 + law.asymmetry),
        law.stiffness * (1.0 - law.asymmetry),
        law.friction,
        law.rolling_arm,
        law.corner_rolling_arm,
        np.inf,
    )


@kernel
def _compliant_touch(
    body: Body,
    law: ContactLaw,
    slope: Incline,
    limits: Limits,
    state: np.ndarray,
    c: np.ndarray,
    z: np.ndarray,
    steps: int,
    trajectory: np.ndarray,
    samples: int,
) -> tuple[int, int, int]:
    pair = pair_of(law)
    brief = BRIEF * math.sqrt(body.mass / pair.k_closing)
    idle = 0
    while True:
        start = state[TIME]
        status, steps, samples = contact(body, pair, slope, limits, state, c, z, steps, trajectory, samples)
        if status != BOTH_CORNERS:
            break
        state[ON_CHORD] = 1.0
        status, steps, samples = chord_contact(
            body, pair, slope, limits, state, c[ROWS:], z[Z_ROWS:], steps, trajectory, samples
        )
        if status != ONE_CORNER:
            break
        idle = 0 if state[TIME] - start > brief else idle + 1
        if idle > MOST_IDLE:
            status = TUMBLED
            break
    return status, steps, samples


def by_law(compliant: Callable[..., Any], rigid: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function whose second argument is a law, the type of which chooses the kernel when it is compiled."""

    def choice(*given: Any) -> Any:
        return (rigid if isinstance(given[1], RigidLaw) else compliant)(*given)

    def chosen(law: Any) -> Any:
        return types.Dispatcher(rigid if law.instance_class is RigidLaw else compliant)

    # numba hands the names of the arguments to the implementation, which must repeat them.
    def result_type(context: Any) -> Callable[..., Any]:
        def result(*given: Any) -> Any:
            return chosen(given[1]).get_call_type(context, given, {}).return_type

        result.__signature__ = inspect.signature(compliant)  # type: ignore[attr-defined]
        return result

    def lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        follow = context.get_function(chosen(signature.args[1]), signature)
        context.add_linking_libs(follow.libs)
        return follow(builder, arguments)

    type_callable(choice)(result_type)
    lower_builtin(choice, types.VarArg(types.Any))(lower)  # type: ignore[no-untyped-call]
    return choice


touch = by_law(_compliant_touch, strike)


def law_of_row(like: _Law, row: np.ndarray) -> _Law:
    """Return a law of the same kind as ``like`` with the fields of an array of shape (5,)."""
    return type(like)(row[0], row[1], row[2], row[3], row[4])


@overload(law_of_row)
def _law_of_row(like: Any, row: Any) -> Callable[..., Any]:
    kind = like.instance_class

    def build(like: Any, row: Any) -> Any:
        return kind(row[0], row[1], row[2], row[3], row[4])

    return build
