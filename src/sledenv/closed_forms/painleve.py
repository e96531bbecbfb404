"""Where rigid contact has no unique answer: the Painlevé region, and the friction from which on there is one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sledenv.closed_forms.features import IS_NUMBER, Floats, Sector, arms_at, sectors
from sledenv.simulation.bodies import Body, made_body
from sledenv.simulation.rules import FINITE, checked_array, made
from sledenv.simulation.scene import ContactLaw

_GRID = 4001  # orientations among which the least threshold is sought,
_REFINEMENTS = 4  # and again between the neighbours of the best one


def painleve(body: Body, law: ContactLaw, phi: ArrayLike, slip: ArrayLike, spin: ArrayLike) -> Floats:
    """Return ``J/m + a^2 + a (b f s_t + delta s_w)`` [m^2]; negative in the Painlevé region: docs/physics.md (4.4).

    There the contact jams in motion: pressing harder makes the contact point approach faster.

    Parameters
    ----------
    body, law
        As for :func:`sledenv.closed_forms.equilibrium.static_jam`.
    phi : array_like
        Orientation [rad].
    slip, spin : array_like
        Slip velocity [m/s] and angular velocity [rad/s], or just their signs s_t and s_w; a zero leaves its term out.

    Returns
    -------
    ndarray
        The arguments are broadcast.

    Raises
    ------
    TypeError, ValueError
        If ``phi`` is not finite or a velocity is NaN.
    """
    body, law = made_body(body), made("law", ContactLaw, law)
    angle = checked_array("painleve: phi", phi, FINITE)
    s_t = np.sign(checked_array("painleve: slip", slip, IS_NUMBER))
    s_w = np.sign(checked_array("painleve: spin", spin, IS_NUMBER))
    a, b, arm = arms_at(body, law, angle)
    return np.asarray(body.inertia / body.mass + a * a + a * (b * law.friction * s_t + arm * s_w))


def painleve_threshold(body: Body, law: ContactLaw) -> float:
    """Smallest friction f [-] above which the Painlevé region exists at some orientation; ``law.friction`` is not used.

    It is the minimum over the orientations of ``(J/m + a^2 - |a| delta) / |a b|``, on each arc.

    Returns
    -------
    float
        0 if rolling resistance alone suffices, inf if no friction does (a wheel).
    """
    body, law = made_body(body), made("law", ContactLaw, law)
    return min(_threshold_in(body, sector) for sector in sectors(body, law))


def _threshold_in(body: Body, sector: Sector) -> float:
    """Painlevé threshold over the orientations at which one arc touches."""
    gyration = body.inertia / body.mass  # J/m, [m^2]

    def needed(theta: Floats) -> Floats:
        a = np.abs(sector.h * np.sin(theta))
        b = np.abs(sector.r - sector.h * np.cos(theta))
        borne = gyration + a * (a - sector.arm)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(a * b > 0.0, borne / (a * b), np.copysign(np.inf, borne))

    theta = np.linspace(sector.low, sector.high, _GRID) + sector.shift
    for _ in range(_REFINEMENTS):
        least = int(np.argmin(needed(theta)))
        theta = np.linspace(theta[max(least - 1, 0)], theta[min(least + 1, _GRID - 1)], _GRID)
    return max(0.0, float(needed(theta).min()))
