"""The impact of a wheel in closed form, the paper's Table 1 corrected and completed: docs/physics.md, section 3.

The mass centre of a wheel is its centre, so the normal motion does not feel the tangential one: the normal impulse is
``P = m |v| (1 + e)`` whatever happens at the contact. It plays the part of time. With the slip ``v_t = u + r omega``,

    m du = F dp,    J domega = (r F + M) dp,    d(J omega - m r u) = M dp,    I = J + m r^2,

and slip and spin decay at constant rates until the first of them stops, after the impulse

    p1 = |v_t| / [f (1/m + r^2/J) + c r delta/J]    or    p2 = |omega| J / (delta + c r f),    c = sgn(v_t) sgn(omega)

(never, if the denominator is not positive; a velocity that is zero at entry has c = -1, and the impulse 0 if it stays
zero). What stops first can stay zero or come back with the other sign:

- Slip stays zero, the wheel rolls, iff ``f >= f_r = m r delta/I``: rolling needs the friction ``f_r`` per normal force.
- Spin stays zero iff ``r f <= delta``: rolling resistance holds against the moment of sliding friction.

As ``f_r < delta/r``, never both come back: once slip has, ``r f < delta`` stops the spin for good; once spin has,
``f > f_r`` stops the slip for good. A wheel has no double reversal. Every impact is one of the paths below, cut where
``P`` is used up; the velocities at the cut follow from two of: ``F`` known, ``M`` known, ``u + r omega = 0``,
``omega = 0``.

    slide-roll -> stop-roll -> stuck                        p1 < p2, f >= f_r
    slide-roll -> slip-reversal -> slide -> stuck           p1 < p2, f < f_r
    slide-roll -> slide -> stuck                            p2 < p1, r f <= delta
    slide-roll -> spin-reversal -> stop-roll -> stuck       p2 < p1, r f > delta
    slide-roll -> stuck                                     p1 = p2
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sledenv.simulation.rules import CLOSED_FRACTION, FINITE, NOT_NEGATIVE, POSITIVE, Rule, checked_array

# Of each argument what it may be, by its name.
_ALLOWED: Final[dict[str, Rule]] = {
    **dict.fromkeys(("mass", "inertia", "radius"), POSITIVE),
    **dict.fromkeys(("friction", "rolling_arm"), NOT_NEGATIVE),
    "restitution": CLOSED_FRACTION,
    **dict.fromkeys(("u", "v", "omega"), FINITE),
}
FloatArray = npt.NDArray[np.float64]
Values = float | FloatArray


@dataclass(frozen=True)
class WheelImpact:
    """Result of a wheel's impact; floats, or arrays of the broadcast shape of the arguments.

    Attributes
    ----------
    u, v : float or ndarray
        Velocity of the centre after the impact [m/s].
    omega : float or ndarray
        Spin after it [rad/s].
    tangential_impulse, normal_impulse : float or ndarray
        SF and P = SN of the paper [N s], those of the slope on the wheel.
    arm : float or ndarray
        d of Table 1 [m]: moment impulse of the rolling resistance over normal impulse, ``|d| <= delta``.
        Counter-clockwise is positive, as for a normal impulse that acts at d downhill of the contact point; positive
        throughout Table 1, where u0 > 0 and omega0 = 0. 0 without normal impulse.
    scenario : str or ndarray of str
        How the impact ended: in the words of ``sledenv.simulation.Mode``, or "none".
    """

    u: Values
    v: Values
    omega: Values
    tangential_impulse: Values
    normal_impulse: Values
    arm: Values
    scenario: Any


def _checked(given: Mapping[str, npt.ArrayLike]) -> list[FloatArray]:
    """Return arguments as arrays of one shape, each checked by the rule of its name."""
    arrays = {name: checked_array(name, value, _ALLOWED[name]) for name, value in given.items()}
    try:
        return list(np.broadcast_arrays(*arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items() if array.ndim)
        raise ValueError(f"arguments do not broadcast together: {shapes}") from None


def _impulse_to_stop(speed: FloatArray, rate: FloatArray) -> FloatArray:
    """Normal impulse [N s] after which ``speed``, falling at ``rate`` per impulse, is zero; inf if it does not fall."""
    impulse: FloatArray = np.divide(speed, rate, out=np.full(speed.shape, np.inf), where=rate > 0.0)
    return impulse


def collide_wheel(
    mass: npt.ArrayLike,
    inertia: npt.ArrayLike,
    radius: npt.ArrayLike,
    friction: npt.ArrayLike,
    rolling_arm: npt.ArrayLike,
    restitution: npt.ArrayLike,
    u: npt.ArrayLike,
    v: npt.ArrayLike,
    omega: npt.ArrayLike = 0.0,
) -> WheelImpact:
    """Solve one impact of a wheel in closed form, for any entry: docs/physics.md, section 3 (the paper's Table 1).

    All arguments broadcast against each other. Exactly one scenario holds for every input; where two meet, their
    velocities are the same.

    Parameters
    ----------
    mass : array_like
        m [kg], > 0.
    inertia : array_like
        J about the centre [kg m^2], > 0.
    radius : array_like
        r [m], > 0.
    friction : array_like
        Coulomb coefficient f [-], >= 0.
    rolling_arm : array_like
        delta [m], >= 0: rolling resistance is at most delta times the normal force.
    restitution : array_like
        e [-] in [0, 1], the paper's R; for a wheel Newton's, Poisson's and Stronge's are the same.
    u, v : array_like
        Velocity of the centre at touch [m/s], along the slope and along the outward normal. v < 0 approaches, v > 0 is
        no impact, and v = 0 is one without impulse.
    omega : array_like
        Spin at touch [rad/s], counter-clockwise positive: rolling in the direction of u > 0 is omega < 0.

    Returns
    -------
    WheelImpact

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range.
    OverflowError
        If a velocity or an impulse after it is too large for a number.

    Examples
    --------
    >>> impact = collide_wheel(1.0, 0.005, 0.1, 0.1, 0.001, 0.5, u=2.0, v=-1.0)
    >>> impact.scenario, round(impact.u, 3), round(impact.omega, 3)
    ('slide-roll', 1.85, -2.7)
    """
    given = dict(zip(_ALLOWED, (mass, inertia, radius, friction, rolling_arm, restitution, u, v, omega), strict=True))
    with np.errstate(all="ignore"):  # of every input all scenarios are evaluated, and one is chosen
        fields = _solve(_checked(given))
    if not all(np.isfinite(field).all() for field in fields[:-1]):
        raise OverflowError("collide_wheel: velocities and impulses of this impact are too large for a number")
    if fields[0].ndim == 0:
        return WheelImpact(*(field.item() for field in fields))
    return WheelImpact(*fields)


def _solve(given: Sequence[FloatArray]) -> tuple[Any, ...]:
    """Return the fields of WheelImpact, as arrays, of checked arguments of one shape."""
    m, inertia, r, f, delta, e, u0, v0, w0 = given
    about_contact = inertia + m * r * r  # I
    impulse = np.where(v0 > 0.0, 0.0, m * np.abs(v0) * (1.0 + e))
    slip = u0 + r * w0
    grips = f * about_contact >= m * r * delta  # f >= f_r: slip stays zero
    holds = (r * f <= delta) | ~grips  # spin stays zero; the second follows from the first but for rounding
    # A velocity that is zero at entry and does not stay so departs against the other one.
    s = np.where(slip == 0.0, -np.sign(w0), np.sign(slip))
    sigma = np.where(w0 == 0.0, -s, np.sign(w0))
    p1 = _impulse_to_stop(np.abs(slip), (f * about_contact + s * sigma * m * r * delta) / (m * inertia))
    p2 = _impulse_to_stop(np.abs(w0), (delta + s * sigma * r * f) / inertia)
    p1 = np.where((slip == 0.0) & grips, 0.0, p1)
    p2 = np.where((w0 == 0.0) & holds, 0.0, p2)

    # Impulses of friction (F) and of rolling resistance (M), and the velocities that follow from them: while slip and
    # spin go on, while the wheel rolls, and while it slides without spin.
    slip_first, spin_first = (p1 < p2) & (p1 <= impulse), (p2 < p1) & (p2 <= impulse)
    slip_back, spin_back = slip_first & ~grips, spin_first & ~holds
    force = np.where(slip_back, s * f * (impulse - 2.0 * p1), -s * f * impulse)
    moment = np.where(spin_back, s * delta * (impulse - 2.0 * p2), -sigma * delta * impulse)
    turning = (r * force + moment) / inertia
    w_free, slip_free = w0 + turning, slip + force / m + r * turning
    w_rolls = (inertia * w0 - m * r * u0 + moment) / about_contact  # J omega - m r u is changed by M alone
    u_slides = u0 + force / m
    scenario = np.select(
        [
            v0 > 0.0,
            (impulse < p1) & (impulse < p2),
            slip_back & (sigma * w_free > 0.0),
            spin_back & (s * slip_free > 0.0),
            (spin_back & (s * w_rolls < 0.0)) | (slip_first & grips & (sigma * w_rolls > 0.0)),
            (slip_back & (s * u_slides < 0.0)) | (spin_first & holds & (s * u_slides > 0.0)),
        ],
        ["none", "slide-roll", "slip-reversal", "spin-reversal", "stop-roll", "slide"],
        "stuck",
    )
    none, rolls, slides = scenario == "none", scenario == "stop-roll", scenario == "slide"
    free = np.isin(scenario, ["slide-roll", "slip-reversal", "spin-reversal"])  # slips and spins
    w1 = np.select([none, rolls, free], [w0, w_rolls, w_free], 0.0)
    u1 = np.select([none, free | slides], [u0, u_slides], 0.0 - r * w1)
    tangential = np.select([none, free | slides], [0.0, force], m * (u1 - u0))
    moment = np.select([none, rolls | free], [0.0, moment], -inertia * w0 - r * tangential)
    arm = np.divide(moment, impulse, out=np.zeros(impulse.shape), where=impulse > 0.0)
    v1 = np.where(v0 > 0.0, v0, e * np.abs(v0))
    return u1, v1, w1, tangential, impulse, np.clip(arm, -delta, delta), scenario.astype(object)
