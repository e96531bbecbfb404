"""The one place where a descent tells its contact laws apart: by the type of the law, at compile time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.extending import lower_builtin, overload, type_callable

from sledenv.kernel.chord import ONE_CORNER, chord_contact
from sledenv.kernel.contact import BOTH_CORNERS, Pair, contact
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, ContactLaw, Limits, RigidLaw, Slope
from sledenv.kernel.records import TUMBLED
from sledenv.kernel.rigid import strike
from sledenv.kernel.series import ROWS, Z_ROWS
from sledenv.kernel.state import ON_CHORD, TIME

Law = ContactLaw | RigidLaw

# Between two corners that hand a body over to each other so often, each time within a share of the time that a contact
# takes, it lies on its chord: hand-overs accumulate at the moment from which on both touch.
MOST_IDLE = 30
BRIEF = 1e-9


@kernel
def _compliant_touch(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    limits: Limits,
    state: np.ndarray,
    c: np.ndarray,
    z: np.ndarray,
    steps: int,
    trajectory: np.ndarray,
    samples: int,
) -> tuple[int, int, int]:
    pair = Pair(
        law.stiffness * (1.0 + law.asymmetry),
        law.stiffness * (1.0 - law.asymmetry),
        law.friction,
        law.rolling_arm,
        law.corner_rolling_arm,
        np.inf,
    )
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


def touch(
    body: Body,
    law: Law,
    slope: Slope,
    limits: Limits,
    state: np.ndarray,
    c: np.ndarray,
    z: np.ndarray,
    steps: int,
    trajectory: np.ndarray,
    samples: int,
) -> tuple[int, int, int]:
    """Follow one contact by the given law: see :func:`sledenv.kernel.contact.contact`."""
    follow = strike if isinstance(law, RigidLaw) else _compliant_touch
    return follow(body, law, slope, limits, state, c, z, steps, trajectory, samples)  # type: ignore[arg-type]


def _contact_of(law: Any) -> Any:
    """Type of the kernel that follows a contact by a law of the given type."""
    return types.Dispatcher(strike if law.instance_class is RigidLaw else _compliant_touch)


@type_callable(touch)
def _type_touch(context: Any) -> Callable[..., Any]:
    # numba hands these names to the implementation, which must repeat them.
    def result(  # type: ignore[no-untyped-def]
        body, law, slope, limits, state, c, z, steps, trajectory, samples
    ) -> Any:
        given = body, law, slope, limits, state, c, z, steps, trajectory, samples
        return _contact_of(law).get_call_type(context, given, {}).return_type

    return result


@lower_builtin(touch, types.VarArg(types.Any))  # type: ignore[no-untyped-call, untyped-decorator]
def _lower_touch(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    follow = context.get_function(_contact_of(signature.args[1]), signature)
    context.add_linking_libs(follow.libs)
    return follow(builder, arguments)


def law_of_row(like: Law, row: np.ndarray) -> Law:
    """Return a law of the same kind as ``like`` with the fields of an array of shape (5,)."""
    return type(like)(row[0], row[1], row[2], row[3], row[4])


@overload(law_of_row)
def _law_of_row(like: Any, row: Any) -> Callable[..., Any]:
    kind = like.instance_class

    def build(like: Any, row: Any) -> Any:
        return kind(row[0], row[1], row[2], row[3], row[4])

    return build
