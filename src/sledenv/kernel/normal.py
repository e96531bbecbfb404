"""The normal force of compliant surfaces: all that a contact knows of their law, docs/physics.md, section 5.

In a branch the force is minus the stiffness times the *load*, a length that is negative while the surfaces push. Here
the load is the gap. It is linear in gap and gap rate, so these may be numbers or coefficients of series.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import scalar
from sledenv.compiler.values import equal, larger, less, where
from sledenv.kernel.params import ContactLaw

ROUNDING: Final = 2e-15  # of the size: a smaller gap, or difference of gaps, is rounding
NO_DEPTH: Final = 1e-12  # of the size: the branch of a shallower contact is that of this depth, as the force vanishes

# What a contact holds of its law.
FIELDS: Final = (
    ("rigid", "f8"),  # 1 if the surfaces are: any force may act while the gap stays closed, none while it opens
    ("k_closing", "f8"),  # [N/m] while the gap closes
    ("k_opening", "f8"),  # [N/m] while it opens
    ("most_normal", "f8"),  # [N] above which rigid surfaces count as having no finite normal force
)


def load(contact: Any, gap: Any, rate: Any) -> Any:
    """Load [m] at a gap [m] and a gap rate [m/s], which in a program are numbers or vectors of coefficients."""
    return gap


def ease(contact: Any, point: Any, step: Any, separates: Any) -> Any:
    """In a program: move the gap of a point to the end of a step, where it may separate; return the loss [J]."""
    before = point.gap
    point.gap = where(separates, 0.0, step.gap_end)
    eased = 0.5 * (contact.k_closing - contact.k_opening) * (before * before - point.gap * point.gap)
    return where(less(0.0, point.gap_rate), eased, 0.0)


@kernel
def write_law(law: ContactLaw, contact: np.void) -> None:
    """Write what a law says of the normal force."""
    contact["rigid"], contact["most_normal"] = 0.0, math.inf
    contact["k_closing"] = law.stiffness * (1.0 + law.asymmetry)
    contact["k_opening"] = law.stiffness * (1.0 - law.asymmetry)


@kernel
def write_rigid(most_normal: float, contact: np.void) -> None:
    """Write that surfaces are rigid, up to some normal force [N]."""
    contact["rigid"], contact["most_normal"] = 1.0, most_normal
    contact["k_closing"] = contact["k_opening"] = 0.0


def bounds_of(contact: Any, point: Any, shallow: Any) -> tuple[Any, Any]:
    """In a program: force [N] at a point while its gap closes and while it opens, from a depth ``shallow`` [m] on."""
    depth = larger(-load(contact, point.gap, point.v_n), shallow)
    return where(equal(contact.rigid, 0.0), contact.k_closing * depth, math.inf), contact.k_opening * depth


bounds = scalar(bounds_of)  # in kernels


def force(contact: Any, point: Any, gap: Any, rate: Any) -> Any:
    """In a program: normal force [N] in the branch of a point, of a gap [m] and a gap rate [m/s]."""
    return -(point.stiffness * load(contact, gap, rate))


def keep_peaks(contact: Any, point: Any) -> None:
    """In a program, at the end of a step: keep the largest normal force [N] and penetration [m] so far.

    Both are largest at an end of the step, because the gap closes or opens all the way.
    """
    contact.peak_force = larger(contact.peak_force, force(contact, point, point.gap, point.v_n))
    contact.peak_penetration = larger(contact.peak_penetration, -point.gap)


@kernel
def load_series(contact: np.void, step: np.void) -> np.ndarray:
    """Series of the load [m]: the surfaces separate where it becomes zero. It may lie in ``step["scratch"]``."""
    series: np.ndarray = step["gap"]
    return series


def stiffness(contact: Any, closing: Any) -> Any:
    """In a program: stiffness [N/m] of a contact while its gap closes, or opens."""
    return where(closing, contact.k_closing, contact.k_opening)


@kernel
def stored(contact: np.void, point: np.void) -> float:
    """Energy [J] in the compressed surfaces at a point."""
    return float(0.5 * contact["k_closing"] * point["gap"] * min(point["gap"], 0.0))
