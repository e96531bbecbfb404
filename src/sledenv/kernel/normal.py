"""The normal force of compliant surfaces: all that a contact knows of their law, docs/physics.md, section 5.

In a branch the force is minus a stiffness, that of the branch, times the *load*, a length that is negative while the
surfaces push. Here the load is the gap. It is linear in gap and gap rate, so what holds of both holds of it, for a
number, a coefficient of a series and a row of them.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from sledenv.kernel.friction import Bounds
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import ContactLaw
from sledenv.kernel.values import less, where

# What a contact holds of its law.
FIELDS: Final = (
    ("k_closing", "f8"),  # [N/m] while the gap closes; inf if rigid
    ("k_opening", "f8"),  # [N/m] while it opens; 0 if rigid
    ("pace_closing", "f8"),  # [s] unit of time of a step, as long as the spin is slow
    ("pace_opening", "f8"),
)


# Told once in a contact, or for each feature.


@kernel
def tell_law(law: ContactLaw, contact: np.void) -> None:
    """Write what a law says of the normal force."""
    contact["k_closing"] = law.stiffness * (1.0 + law.asymmetry)
    contact["k_opening"] = law.stiffness * (1.0 - law.asymmetry)


@kernel
def tell_rigid(contact: np.void) -> None:
    """Write that any force may act while the gap stays closed, and none when it opens."""
    contact["k_closing"], contact["k_opening"] = math.inf, 0.0


@kernel
def pace(closing: bool, angle: float, yielding: float, contact: np.void) -> float:
    """Time [s] in which a contact that moves by ``yielding`` [1/kg] under a force goes on by an angle."""
    stiffness = contact["k_closing"] if closing else contact["k_opening"]
    return angle / math.sqrt(stiffness * yielding) if stiffness > 0.0 else math.inf


# The branch.


@kernel
def stiffness(closing: bool, contact: np.void) -> float:
    """Stiffness [N/m] while the gap closes, or opens."""
    return float(contact["k_closing"] if closing else contact["k_opening"])


@kernel
def bounds(shallow: float, contact: np.void) -> Bounds:
    """Force of a contact while its gap closes and while it opens, taken to be at least ``shallow`` [m] deep."""
    depth = max(-load_at(contact["gap"], contact["v_n"], contact), shallow)
    closing = contact["k_closing"]
    return Bounds(closing * depth if closing < math.inf else math.inf, contact["k_opening"] * depth)


# The load: in programs, of numbers and of rows of coefficients, and in kernels.


def load(contact: Any, gap: Any, rate: Any) -> Any:
    """In a program: load [m] at a gap [m] and a gap rate [m/s]."""
    return gap


def loads(contact: Any, gaps: list[Any], rates: list[Any]) -> list[Any]:
    """In a program: row of the loads of rows of gaps and gap rates."""
    return gaps


def unloaded(contact: Any, rate: Any) -> Any:
    """In a program: gap [m] at which there is no load."""
    return 0.0


@kernel
def load_at(gap: float, rate: float, contact: np.void) -> float:
    """Load [m] at a gap [m] and a gap rate [m/s]."""
    return gap


@kernel
def load_series(contact: np.void, step: np.void) -> np.ndarray:
    """Load [m] during a step: the surfaces separate where it becomes zero. It may be written in ``step["scratch"]``."""
    series: np.ndarray = step["gap"]
    return series


# Energy. The loss of a step is a factor times a sum over all points that touch.


@kernel
def per_square(contact: np.void) -> float:
    """Stored energy over the square of the penetration [N/m]."""
    return float(0.5 * contact["k_closing"])


def lost(contact: Any, step: Any, before: Any) -> Any:
    """In a program: loss [J] of a step that began with the gap ``before`` and has moved the contact to its end."""
    eased = 0.5 * (contact.k_closing - contact.k_opening) * (before * before - contact.gap * contact.gap)
    return where(less(0.0, contact.gap_rate), eased, 0.0)


@kernel
def loss_factor(contact: np.void) -> float:
    """Loss over what :func:`eased` gives [N/m]."""
    return float(0.5 * (contact["k_closing"] - contact["k_opening"]))


@kernel
def eased(before: float, side: np.void) -> float:
    """What a side of the chord that had the gap ``before`` [m] adds up in a step."""
    return before * before - side["gap"] * side["gap"] if side["gap_rate"] > 0.0 else 0.0
