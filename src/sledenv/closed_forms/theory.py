"""Where a sled jams, in closed form: rest on the slope, on its chord too, the Painlevé region and the stuck wheel."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sledenv.kernel.records import ARC, NOSE, TAIL
from sledenv.simulation.bodies import Body
from sledenv.simulation.rules import made
from sledenv.simulation.scene import ContactLaw, Slope
from sledenv.simulation.support import feature_geometry, has_corners

Floats = NDArray[np.float64]

_TURN = 2.0 * math.pi
_GRID = 4001  # orientations from which the minima of the Painlevé threshold are refined
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
_REFINEMENTS = 80  # 0.618^80 = 2e-17 of a cell of the grid


class _Piece(NamedTuple):
    """The orientations at which one feature touches, and its geometry: docs/physics.md (8.2)."""

    low: float  # [rad]
    high: float  # [rad]
    h: float  # [m]
    r: float  # [m]
    shift: float  # [rad]
    arm: float  # [m] delta


def static_jam(body: Body, law: ContactLaw, slope: Slope, phi: ArrayLike) -> NDArray[np.bool_]:
    """Whether the body, laid on the slope at rest, stays: docs/physics.md (6.1).

    At rest N = m g cos(beta) and F = -m g sin(beta), so the moment to be borne by rolling resistance is
    M = a N - b F. It rests if and only if ``|F| <= f N`` and ``|M| <= delta N``, that is ``tan|beta| <= f`` and
    ``|a + b tan(beta)| <= delta`` with the arms a, b and the rolling arm delta of the feature that touches.

    Parameters
    ----------
    body, law, slope
        What rests, how it touches and where. Stiffness, asymmetry and the length of the slope do not matter, nor does
        gravity as long as there is some.
    phi : array_like
        Orientation [rad].

    Returns
    -------
    ndarray of bool
        The shape of ``phi``. Lying on its chord (phi = pi) a body touches with two corners, of which one is taken alone
        here; see :func:`chord_rests`.

    Raises
    ------
    TypeError, ValueError
        If ``phi`` is not finite or gravity is 0, where nothing holds the body down.
    """
    body, law, slope = _checked(body, law, slope)
    a, b, arm = _arms(body, law, _numbers("static_jam", "phi", phi, np.isfinite, "finite"))
    steepness = math.tan(slope.angle)
    return np.asarray((abs(steepness) <= law.friction) & (np.abs(a + b * steepness) <= arm))


def static_jam_angles(body: Body, law: ContactLaw, slope: Slope) -> list[tuple[float, float]]:
    """Orientations at which the body rests on the slope, the solution set of :func:`static_jam` in closed form.

    On each feature (6.1) reads ``|h sin(theta - beta) + r sin(beta)| <= delta cos(beta)`` with
    theta = phi + shift, so its bounds are inverse sines.

    Parameters
    ----------
    body, law, slope
        As for :func:`static_jam`.

    Returns
    -------
    list of (float, float)
        Disjoint closed intervals [rad] in (-pi, pi], in order; one that contains pi is split there. Where delta = 0
        the body can only balance, and an interval is one point. An interval of a corner that ends where the arc
        begins does not contain that end if the arc does not rest there.

    Raises
    ------
    TypeError, ValueError
        If gravity is 0.
    """
    body, law, slope = _checked(body, law, slope)
    if math.tan(abs(slope.angle)) > law.friction:
        return []
    found: list[tuple[float, float]] = []
    for piece in _pieces(body, law):
        for low, high in _balanced(piece, slope.angle):
            for turn in (-_TURN, 0.0, _TURN):
                clipped = max(low + turn, piece.low), min(high + turn, piece.high)
                if clipped[0] <= clipped[1] and clipped[1] > -math.pi:
                    found.append(clipped)
    merged: list[tuple[float, float]] = []
    for low, high in sorted(found):
        if merged and low <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(high, merged[-1][1])
        else:
            merged.append((low, high))
    return merged


def steepest_jam(body: Body, law: ContactLaw, phi: ArrayLike) -> Floats:
    """Largest inclination [rad] of a slope on which the body rests at ``phi``: (6.1) solved for beta.

    Parameters
    ----------
    body, law
        As for :func:`static_jam`.
    phi : array_like
        Orientation [rad].

    Returns
    -------
    ndarray
        The shape of ``phi``; negative where only a slope that rises downhill of the body can hold it, NaN where none
        can. The smallest inclination is ``-steepest_jam(body, law, -phi)``, and every one in between holds it too.

    Raises
    ------
    TypeError, ValueError
        If ``phi`` is not finite.
    """
    body, law = made("body", Body, body), made("law", ContactLaw, law)
    a, b, arm = _arms(body, law, _numbers("steepest_jam", "phi", phi, np.isfinite, "finite"))
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (-arm - a) / b, (arm - a) / b
    low = np.where(b == 0.0, np.where(np.abs(a) <= arm, -np.inf, np.inf), np.minimum(one, other))
    high = np.where(b == 0.0, np.where(np.abs(a) <= arm, np.inf, -np.inf), np.maximum(one, other))
    steepness = np.minimum(high, law.friction)
    return np.where(steepness >= np.maximum(low, -law.friction), np.arctan(steepness), np.nan)


def chord_loads(body: Body, law: ContactLaw, slope: Slope, slip: ArrayLike) -> tuple[Floats, Floats]:
    """Loads [N] of the two corners of a body that lies flat on its chord: docs/physics.md (8.6).

    They carry the weight together, and their moment balances that of friction, which acts H below the mass centre:
    ``L (N_tail - N_nose) = -H F``, with F = -s_t f m g cos(beta) sliding and F = -m g sin(beta) at rest.

    Parameters
    ----------
    body : Body
        With corners.
    law, slope
        As for :func:`static_jam`.
    slip : array_like
        Velocity along the slope [m/s], or just its sign s_t; 0 at rest.

    Returns
    -------
    tuple of ndarray
        Of the tail, which lies downhill, and of the nose; the shape of ``slip``. Rolling resistance is taken to be
        without moment: it may shift ``delta m g cos(beta) / (2 L)`` from either corner to the other. A negative load
        that it cannot make up for means that the body tips, see :func:`chord_tipping_friction`.

    Raises
    ------
    TypeError, ValueError
        If the body has no corners, ``slip`` is NaN or gravity is 0.
    """
    body, law, slope = _checked(body, law, slope)
    along, across = _chord(body)
    sign = np.sign(_numbers("chord_loads", "slip", slip, _is_number, "a number"))
    weight = body.mass * slope.gravity * math.cos(slope.angle)
    ratio = np.where(sign == 0.0, -math.tan(slope.angle), -sign * law.friction)  # F / N
    return 0.5 * weight * (1.0 - ratio * along / across), 0.5 * weight * (1.0 + ratio * along / across)


def chord_tipping_friction(body: Body, law: ContactLaw) -> float:
    """Ratio ``|F| / N`` [-] above which friction tips a body that lies on its chord over the corner ahead: (8.7).

    It is ``(L + delta) / |H|`` with the rolling arm delta of the corners: sliding flat needs a smaller friction
    coefficient, and lying at rest a smaller slope.

    Returns
    -------
    float
        inf if the mass centre lies in the chord, H = 0.

    Raises
    ------
    ValueError
        If the body has no corners.
    """
    body, law = made("body", Body, body), made("law", ContactLaw, law)
    along, across = _chord(body)
    return math.inf if along == 0.0 else (across + law.corner_rolling_arm) / abs(along)


def chord_rests(body: Body, law: ContactLaw, slope: Slope) -> bool:
    """Whether a body that lies flat on its chord at rest stays: ``tan|beta| <= f`` and it does not tip, (8.7).

    Parameters
    ----------
    body : Body
        With corners.
    law, slope
        As for :func:`static_jam`.

    Raises
    ------
    ValueError
        If the body has no corners or gravity is 0.
    """
    body, law, slope = _checked(body, law, slope)
    return math.tan(abs(slope.angle)) <= min(law.friction, chord_tipping_friction(body, law))


def chord_slide(law: ContactLaw, slope: Slope, speed: ArrayLike, time: ArrayLike) -> tuple[Floats, Floats]:
    """Distance [m] and velocity [m/s] of a body that slides flat on its chord, after a time: (8.8).

    It slides like a block, ``du/dt = g sin(beta) - s_t f g cos(beta)``. Where it comes to a stop it stays if
    ``tan|beta| <= f``, and slides down otherwise.

    Parameters
    ----------
    law, slope
        As for :func:`static_jam`; the length of the slope does not matter.
    speed : array_like
        Velocity along the slope at the start [m/s].
    time : array_like
        Time since then [s], >= 0.

    Returns
    -------
    tuple of ndarray
        The arguments are broadcast.

    Raises
    ------
    TypeError, ValueError
        If ``speed`` or ``time`` is not finite or ``time`` is negative, or gravity is 0.
    """
    law, slope = ContactLaw(*law), _pressed(slope)
    start = _numbers("chord_slide", "speed", speed, np.isfinite, "finite")
    after = _numbers("chord_slide", "time", time, lambda v: (v >= 0.0) & (v < np.inf), "in [0, inf) s")
    direction = np.where(start == 0.0, np.sign(slope.angle), np.sign(start))
    rate = _sliding_rate(law, slope, direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        stop = np.where(start == 0.0, 0.0, np.where(rate * start < 0.0, -start / rate, np.inf))
    first = np.minimum(after, stop)
    rest = after - first
    again = _starting_rate(law, slope)
    distance = first * (start + 0.5 * rate * first) + 0.5 * again * rest * rest
    return np.asarray(distance), np.where(after < stop, start + rate * first, again * rest)


def chord_finish_time(law: ContactLaw, slope: Slope, speed: float) -> float:
    """Time [s] after which a body that slides flat on its chord has gone the length of the slope; inf if never.

    Parameters
    ----------
    law, slope
        As for :func:`chord_slide`.
    speed : float
        Velocity along the slope at the start [m/s].

    Raises
    ------
    TypeError, ValueError
        If ``speed`` is not finite or gravity is 0.
    """
    law, slope = ContactLaw(*law), _pressed(slope)
    start = float(_numbers("chord_finish_time", "speed", speed, np.isfinite, "finite"))
    distance, turned, rate = slope.length, 0.0, float(_sliding_rate(law, slope, 1.0))
    if start <= 0.0:
        slowing = float(_sliding_rate(law, slope, -1.0))
        if start < 0.0 and not slowing > 0.0:
            return math.inf
        turned = -start / slowing if start < 0.0 else 0.0
        distance -= 0.5 * start * turned
        start, rate = 0.0, _starting_rate(law, slope)
    squared = start * start + 2.0 * rate * distance  # speed at the end
    return turned + 2.0 * distance / (start + math.sqrt(squared)) if 0.0 < squared < math.inf else math.inf


def painleve(body: Body, law: ContactLaw, phi: ArrayLike, slip: ArrayLike, spin: ArrayLike) -> Floats:
    """Return ``J/m + a^2 + a (b f s_t + delta s_w)`` [m^2]; negative in the Painlevé region: docs/physics.md (4.4).

    There the contact jams in motion: pressing harder makes the contact point approach faster.

    Parameters
    ----------
    body, law
        As for :func:`static_jam`.
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
    body, law = made("body", Body, body), made("law", ContactLaw, law)
    angle = _numbers("painleve", "phi", phi, np.isfinite, "finite")
    s_t = np.sign(_numbers("painleve", "slip", slip, _is_number, "a number"))
    s_w = np.sign(_numbers("painleve", "spin", spin, _is_number, "a number"))
    a, b, arm = _arms(body, law, angle)
    return np.asarray(body.inertia / body.mass + a * a + a * (b * law.friction * s_t + arm * s_w))


def painleve_threshold(body: Body, law: ContactLaw) -> float:
    """Smallest friction f [-] above which the Painlevé region exists at some orientation; ``law.friction`` is not used.

    It is the minimum over the orientations of ``(J/m + a^2 - |a| delta) / |a b|``, on the arc and on a corner.

    Returns
    -------
    float
        0 if rolling resistance alone suffices, inf if no friction does (a wheel).
    """
    body, law = made("body", Body, body), made("law", ContactLaw, law)
    return min(_piece_threshold(body, piece) for piece in _pieces(body, law) if piece.high > 0.0)


def wheel_stuck_ratio(restitution: ArrayLike, friction: ArrayLike, rolling_arm: ArrayLike, radius: ArrayLike) -> Floats:
    """Largest ``|u0 / v0|`` [-] at which a wheel without spin gets stuck, ``(1 + e) min(f, delta/r)``.

    Row 4 of Table 1, docs/physics.md, section 3: ``m u0 <= f P`` and ``m r u0 <= delta P`` with ``P = m |v0| (1 + e)``.

    Parameters
    ----------
    restitution : array_like
        e [-] in [0, 1].
    friction : array_like
        f [-], >= 0.
    rolling_arm : array_like
        delta [m], >= 0.
    radius : array_like
        r [m], > 0.

    Returns
    -------
    ndarray
        The arguments are broadcast.

    Raises
    ------
    TypeError, ValueError
        Naming the argument and the allowed range.
    """
    owner = "wheel_stuck_ratio"
    e = _numbers(owner, "restitution", restitution, lambda v: (v >= 0.0) & (v <= 1.0), "in [0, 1]")
    f = _numbers(owner, "friction", friction, lambda v: (v >= 0.0) & (v < np.inf), "in [0, inf)")
    arm = _numbers(owner, "rolling_arm", rolling_arm, lambda v: (v >= 0.0) & (v < np.inf), "in [0, inf) m")
    r = _numbers(owner, "radius", radius, lambda v: (v > 0.0) & (v < np.inf), "in (0, inf) m")
    return np.asarray((1.0 + e) * np.minimum(f, arm / r))


def _is_number(values: Floats) -> NDArray[np.bool_]:
    return ~np.isnan(values)


def _numbers(
    owner: str, name: str, values: ArrayLike, accepts: Callable[[Floats], NDArray[np.bool_]], allowed: str
) -> Floats:
    try:
        numbers = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise TypeError(f"{owner}: {name} = {values!r}: must be numbers") from None
    wrong = numbers[~accepts(numbers)]
    if wrong.size > 0:
        raise ValueError(f"{owner}: {name} = {wrong.flat[0]}: must be {allowed}")
    return numbers


def _checked(body: Body, law: ContactLaw, slope: Slope) -> tuple[Body, ContactLaw, Slope]:
    return made("body", Body, body), made("law", ContactLaw, law), _pressed(slope)


def _pressed(slope: Slope) -> Slope:
    slope = made("slope", Slope, slope)
    if slope.gravity == 0.0:
        raise ValueError("Slope.gravity = 0.0: must be > 0, nothing else holds a body at rest on the slope")
    return slope


def _chord(body: Body) -> tuple[float, float]:
    """H and L [m] of docs/physics.md (8.2)."""
    if not has_corners(body):
        raise ValueError(
            f"Body.half_angle = {body.half_angle}, radius = {body.radius}: the body has no chord to lie on"
        )
    return body.eccentricity - body.radius * math.cos(body.half_angle), body.radius * math.sin(body.half_angle)


def _sliding_rate(law: ContactLaw, slope: Slope, direction: ArrayLike) -> Floats:
    """Acceleration [m/s^2] of a block that slides in a direction, 1 or -1."""
    inward = slope.gravity * math.cos(slope.angle)
    return np.asarray(slope.gravity * math.sin(slope.angle) - np.asarray(direction) * law.friction * inward)


def _starting_rate(law: ContactLaw, slope: Slope) -> float:
    """Acceleration [m/s^2] of a block that stands still: 0 if friction holds it."""
    direction = math.copysign(1.0, slope.angle)
    rate = float(_sliding_rate(law, slope, direction))
    return rate if rate * direction > 0.0 else 0.0


def _pieces(body: Body, law: ContactLaw) -> list[_Piece]:
    """Split (-pi, pi] by the feature that touches."""
    alpha = body.half_angle
    if not has_corners(body):
        return [_Piece(-math.pi, math.pi, *feature_geometry(body, ARC), law.rolling_arm)]
    return [
        _Piece(-math.pi, -alpha, *feature_geometry(body, NOSE), law.corner_rolling_arm),
        _Piece(-alpha, alpha, *feature_geometry(body, ARC), law.rolling_arm),
        _Piece(alpha, math.pi, *feature_geometry(body, TAIL), law.corner_rolling_arm),
    ]


def _arms(body: Body, law: ContactLaw, phi: Floats) -> tuple[Floats, Floats, Floats]:
    """Arms a, b and rolling arm [m] of the feature that touches at each orientation, edges to the arc."""
    local = phi - _TURN * np.floor(phi / _TURN + 0.5)
    pieces = _pieces(body, law)
    index = np.zeros(local.shape, dtype=int)
    if len(pieces) > 1:
        index = np.where(np.abs(local) <= body.half_angle, 1, np.where(local > 0.0, 2, 0))
    h, r, shift, arm = (np.array([piece[i] for piece in pieces])[index] for i in range(2, 6))
    return h * np.sin(local + shift), r - h * np.cos(local + shift), arm


def _balanced(piece: _Piece, beta: float) -> list[tuple[float, float]]:
    """Solve ``|h sin(phi + shift - beta) + r sin(beta)| <= delta cos(beta)`` for phi [rad], on one turn or so."""
    offset = beta - piece.shift
    middle, half_width = -piece.r * math.sin(beta), piece.arm * math.cos(beta)
    below, above = middle - half_width, middle + half_width
    if below > piece.h or above < -piece.h:
        return []
    if below <= -piece.h and above >= piece.h:
        return [(offset - math.pi, offset + math.pi)]
    if above >= piece.h:
        first = math.asin(below / piece.h)
        return [(offset + first, offset + math.pi - first)]
    last = math.asin(above / piece.h)
    if below <= -piece.h:
        return [(offset - math.pi - last, offset + last)]
    first = math.asin(below / piece.h)
    return [(offset + first, offset + last), (offset + math.pi - last, offset + math.pi - first)]


def _piece_threshold(body: Body, piece: _Piece) -> float:
    """Painlevé threshold over the orientations phi >= 0 of one feature; the others mirror them."""
    gyration = body.inertia / body.mass  # J/m, [m^2]

    def needed(theta: Floats) -> Floats:
        a = np.abs(piece.h * np.sin(theta))
        b = np.abs(piece.r - piece.h * np.cos(theta))
        borne = gyration + a * (a - piece.arm)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(borne < 0.0, 0.0, np.where(a * b > 0.0, borne / (a * b), np.inf))

    theta = np.linspace(max(piece.low, 0.0), piece.high, _GRID) + piece.shift
    # Rolling resistance counts for most at |a| = delta/2; the grid need not contain that orientation.
    if 0.5 * piece.arm <= piece.h > 0.0:
        best = math.asin(0.5 * piece.arm / piece.h)
        candidates = np.array([best, math.pi - best, best - math.pi, -best, best + math.pi, _TURN - best])
        theta = np.union1d(theta, candidates[(candidates >= theta[0]) & (candidates <= theta[-1])])
    values = needed(theta)
    padded = np.concatenate([[np.inf], values, [np.inf]])
    lowest = np.flatnonzero((values <= padded[:-2]) & (values <= padded[2:]) & np.isfinite(values))
    if lowest.size == 0:
        return math.inf
    left, right = theta[np.maximum(lowest - 1, 0)], theta[np.minimum(lowest + 1, len(theta) - 1)]
    for _ in range(_REFINEMENTS):
        inner, outer = right - _GOLDEN * (right - left), left + _GOLDEN * (right - left)
        keep_left = needed(inner) <= needed(outer)
        left, right = np.where(keep_left, left, inner), np.where(keep_left, outer, right)
    return float(min(values.min(), needed(0.5 * (left + right)).min()))
