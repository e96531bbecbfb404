"""What a body meets and how it starts: contact law, slope and launch, with every field checked."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, ClassVar, Self, get_args

import numpy as np

from sledenv.kernel import params
from sledenv.simulation.rules import (
    FINITE,
    NOT_NEGATIVE,
    POSITIVE,
    RESTITUTION,
    STEEPNESS,
    Checked,
    Rule,
    checked,
    checked_fields,
)

_FRACTION: Rule = (lambda v: (v >= 0.0) & (v < 1.0), "in [0, 1)")
_LENGTH: Rule = (lambda v: v > 0.0, "in (0, inf] m")


def restitution_of(asymmetry: Any) -> Any:
    """Energetic coefficient of restitution e [-] of an asymmetry, float or array: docs/physics.md (5.3)."""
    return np.sqrt((1.0 - asymmetry) / (1.0 + asymmetry))


def asymmetry_of(restitution: Any) -> Any:
    """Asymmetry Delta [-] < 1 of a coefficient of restitution, float or array: docs/physics.md (5.3)."""
    squared = restitution * restitution
    return np.minimum((1.0 - squared) / (1.0 + squared), math.nextafter(1.0, 0.0))


class ContactLaw(Checked, params.ContactLaw):
    """How the body touches the slope: docs/physics.md, section 5.

    Parameters
    ----------
    stiffness : float
        Mean normal stiffness c [N/m], > 0: c(1 + asymmetry) while the gap closes, c(1 - asymmetry) while it opens.
    asymmetry : float
        Delta [-] in [0, 1); restitution is sqrt((1 - Delta)/(1 + Delta)).
    friction : float
        Coulomb coefficient f [-], >= 0.
    rolling_arm : float
        Arm delta of the rolling resistance of the arc [m], >= 0.
    corner_rolling_arm : float
        The same for a corner [m], >= 0; 0 by default.

    Raises
    ------
    TypeError, ValueError
        Naming the field, its value and the allowed range.
    """

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (POSITIVE, _FRACTION, NOT_NEGATIVE, NOT_NEGATIVE, NOT_NEGATIVE)

    def __new__(
        cls,
        stiffness: float,
        asymmetry: float,
        friction: float,
        rolling_arm: float,
        corner_rolling_arm: float = 0.0,
    ) -> Self:
        values = checked_fields(cls, stiffness, asymmetry, friction, rolling_arm, corner_rolling_arm)
        return super().__new__(cls, *values)

    @property
    def restitution(self) -> float:
        """Energetic coefficient of restitution e [-] of an impact without gravity: docs/physics.md (5.3)."""
        return float(restitution_of(self.asymmetry))

    @classmethod
    def from_restitution(
        cls,
        restitution: float,
        *,
        stiffness: float,
        friction: float,
        rolling_arm: float,
        corner_rolling_arm: float = 0.0,
    ) -> ContactLaw:
        """Build the law from the coefficient of restitution e [-] in (0, 1] instead of the asymmetry."""
        asymmetry = asymmetry_of(checked("ContactLaw", "restitution", restitution, RESTITUTION))
        return cls(stiffness, asymmetry, friction, rolling_arm, corner_rolling_arm)


AnyLaw = ContactLaw  # every kind of law that a descent may be given: a union, if there are more
LAWS: tuple[type[AnyLaw], ...] = get_args(AnyLaw) or (AnyLaw,)


def kind_of(law: Any) -> type[AnyLaw]:
    """Return the kind of a contact law; that of a tuple without a name is ContactLaw."""
    for kind in LAWS:
        if isinstance(law, kind):
            return kind
    return ContactLaw


class Slope(Checked, params.Slope):
    """A straight incline: docs/physics.md, section 1.

    Parameters
    ----------
    angle : float
        Inclination beta [rad] in (-pi/2, pi/2); x runs downhill where it is positive.
    length : float
        The descent finishes where the mass centre reaches x = length [m], > 0; inf by default.
    gravity : float
        Gravitational acceleration [m/s^2], >= 0.

    Raises
    ------
    TypeError, ValueError
        Naming the field, its value and the allowed range.
    """

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (STEEPNESS, _LENGTH, NOT_NEGATIVE)

    def __new__(cls, angle: float, length: float = math.inf, gravity: float = 9.81) -> Self:
        return super().__new__(cls, *checked_fields(cls, angle, length, gravity))


class State(Checked, params.State):
    """Position, orientation and velocity of the body: docs/physics.md, section 1.

    ``x``, ``y`` [m] locate the mass centre in the slope frame, ``phi`` [rad] is counter-clockwise (a
    simulation takes whole turns off that of a launch, and goes on from there without wrapping),
    ``u``, ``v`` [m/s] and ``omega`` [rad/s] are their rates.

    Raises
    ------
    TypeError, ValueError
        If a field is not a finite number.
    """

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (FINITE,) * 6

    def __new__(cls, x: float, y: float, phi: float, u: float = 0.0, v: float = 0.0, omega: float = 0.0) -> Self:
        return super().__new__(cls, *checked_fields(cls, x, y, phi, u, v, omega))

    @classmethod
    def found(cls, fields: Iterable[float]) -> Self:
        """Return what a simulation has come to: one that is not finite is a result there, not an error."""
        return tuple.__new__(cls, fields)
