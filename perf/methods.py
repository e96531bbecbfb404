"""General integrators on the same contact law: explicit Euler, RK4, scipy's DOP853 with events, heyoka with events.

Each answers with the velocities (u, v, omega) after the first ``rebounds`` rebounds of the reference descent.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numba
import numpy as np
from scipy.integrate import solve_ivp

import sledenv
from perf.contact_model import (
    GAP,
    OMEGA,
    PHI,
    RATE_CLOSES,
    RATE_OPENS,
    RATE_ZERO,
    SEPARATED,
    SLIP_FALLS,
    SLIP_RISES,
    SLIP_ZERO,
    SPIN_FALLS,
    SPIN_RISES,
    SPIN_ZERO,
    START,
    V_N,
    V_T,
    Mode,
    P,
    X,
    choose,
    flight_gap,
    flight_rates,
    forces,
    guard,
    guards_of,
    lift_off,
    next_mode,
    rates,
    touch_down,
)
from perf.reference import BODY, LAUNCH, LAW, SLOPE, Floats

_LONGEST = 10.0  # [s] of one flight or one mode; none comes near
_UNDECIDED: Mode = (0, 0, 0)
# heyoka overlooks the next root of an event that is exactly zero at the start: start beside it, by one rounding error.
_NUDGE = 1e-17


def velocities(descent: sledenv.Descent) -> Floats:
    """Velocities after each rebound, shape (n, 3)."""
    return np.stack([descent.rebounds[name] for name in ("u_after", "v_after", "omega_after")], axis=-1)


def sled(rebounds: int, **options: Any) -> sledenv.Descent:
    """Simulate the reference descent with sledenv."""
    return sledenv.simulate(BODY, LAW, SLOPE, LAUNCH, max_rebounds=rebounds, **options)


_DOWNHILL, _INWARD, _CLOSING, _OPENING, _FRICTION, _ARM = P.downhill, P.inward, P.closing, P.opening, P.friction, P.arm
_RADIUS, _ECCENTRICITY, _LIGHTNESS, _READINESS = P.radius, P.eccentricity, 1.0 / P.mass, 1.0 / P.inertia
_CLEAR = P.radius + P.eccentricity  # a centre higher than this is out of reach whatever the angle: no cosine needed


@numba.njit(error_model="numpy", fastmath=True)
def euler(start: Floats, rebounds: int, dt: float) -> Floats:
    """Explicit Euler with a fixed step, the paper's method, without the ledger and the records of sledenv's own.

    Sign functions and a penalty force. The distance x acts on nothing and is not asked for.
    """
    y, phi, u, v, omega = start[1], start[2], start[3], start[4], start[5]
    out = np.zeros((rebounds, 3))
    for count in range(rebounds):
        while y > _CLEAR or y + _ECCENTRICITY * math.cos(phi) >= _RADIUS:
            y += dt * v
            phi += dt * omega
            u += dt * _DOWNHILL
            v -= dt * _INWARD
        lower = _ECCENTRICITY * math.cos(phi)
        gap = y + lower - _RADIUS
        while gap < 0.0:
            a = _ECCENTRICITY * math.sin(phi)
            b = _RADIUS - lower
            normal = -(_CLOSING if v - a * omega < 0.0 else _OPENING) * gap
            force = -_FRICTION * normal * np.sign(u + b * omega)
            turn = _READINESS * (b * force - (a + _ARM * np.sign(omega)) * normal)
            y += dt * v
            phi += dt * omega
            u += dt * (_DOWNHILL + _LIGHTNESS * force)
            v += dt * (_LIGHTNESS * normal - _INWARD)
            omega += dt * turn
            lower = _ECCENTRICITY * math.cos(phi)
            gap = y + lower - _RADIUS
        out[count, 0], out[count, 1], out[count, 2] = u, v, omega
    return out


@numba.njit(error_model="numpy", fastmath=True)
def _accelerations(y: float, phi: float, u: float, v: float, omega: float) -> tuple[float, float, float]:
    """Rates of (u, v, omega) with sign functions and a penalty force."""
    if y > _CLEAR:
        return _DOWNHILL, -_INWARD, 0.0
    lower = _ECCENTRICITY * math.cos(phi)
    gap = y + lower - _RADIUS
    if gap >= 0.0:
        return _DOWNHILL, -_INWARD, 0.0
    a = _ECCENTRICITY * math.sin(phi)
    b = _RADIUS - lower
    normal = -(_CLOSING if v - a * omega < 0.0 else _OPENING) * gap
    force = -_FRICTION * normal * np.sign(u + b * omega)
    turn = _READINESS * (b * force - (a + _ARM * np.sign(omega)) * normal)
    return _DOWNHILL + _LIGHTNESS * force, _LIGHTNESS * normal - _INWARD, turn


@numba.njit(error_model="numpy", fastmath=True)
def rk4(start: Floats, rebounds: int, dt: float) -> Floats:
    """Classical Runge-Kutta with a fixed step and no events, the whole descent in one compiled loop."""
    y, phi, u, v, omega = start[1], start[2], start[3], start[4], start[5]
    out = np.zeros((rebounds, 3))
    half, sixth = 0.5 * dt, dt / 6.0
    count = 0
    inside = False
    while count < rebounds:
        du1, dv1, do1 = _accelerations(y, phi, u, v, omega)
        v2, o2 = v + half * dv1, omega + half * do1
        du2, dv2, do2 = _accelerations(y + half * v, phi + half * omega, u + half * du1, v2, o2)
        v3, o3 = v + half * dv2, omega + half * do2
        du3, dv3, do3 = _accelerations(y + half * v2, phi + half * o2, u + half * du2, v3, o3)
        v4, o4 = v + dt * dv3, omega + dt * do3
        du4, dv4, do4 = _accelerations(y + dt * v3, phi + dt * o3, u + dt * du3, v4, o4)
        y += sixth * (v + 2.0 * (v2 + v3) + v4)
        phi += sixth * (omega + 2.0 * (o2 + o3) + o4)
        u += sixth * (du1 + 2.0 * (du2 + du3) + du4)
        v += sixth * (dv1 + 2.0 * (dv2 + dv3) + dv4)
        omega += sixth * (do1 + 2.0 * (do2 + do3) + do4)
        was_inside = inside
        inside = y <= _CLEAR and y + _ECCENTRICITY * math.cos(phi) < _RADIUS
        if was_inside and not inside:
            out[count, 0], out[count, 1], out[count, 2] = u, v, omega
            count += 1
    return out


def _falling(value: Any) -> Callable[..., float]:
    """Mark a function as a terminal event of scipy, at which it falls through zero."""
    value.terminal = True
    value.direction = -1.0
    return cast(Callable[..., float], value)


def _event(kind: int) -> Callable[..., float]:
    """Return one guard as scipy wants it."""

    @numba.njit(error_model="numpy")
    def value(t: float, z: Floats, mode: Mode) -> float:
        return guard(kind, z, mode)

    return _falling(value)


@functools.cache
def _events() -> tuple[Callable[..., float], ...]:
    return tuple(_event(kind) for kind in range(SEPARATED + 1))


def dop853(rebounds: int, tolerance: float) -> Floats:
    """DOP853 of scipy's ``solve_ivp``: order 8, terminal events for every guard, compiled right-hand side and guards.

    ``tolerance`` is relative; the absolute one is 1e-3 of it.
    """
    events = _events()
    landing = _falling(flight_gap)
    settings: dict[str, Any] = {"method": "DOP853", "rtol": max(tolerance, 2.3e-14), "atol": 1e-3 * tolerance}
    span = (0.0, _LONGEST)
    # scipy looks for events between the ends of a step only: a step that is too long jumps over a short contact.
    y = START
    out = np.zeros((rebounds, 3))
    for count in range(rebounds):
        flight = solve_ivp(flight_rates, span, y, events=landing, max_step=0.01, **settings)
        z = touch_down(flight.y[:, -1])
        mode = choose(z, _UNDECIDED)
        while True:
            kinds = guards_of(mode)
            active = [events[kind] for kind in kinds]
            part = solve_ivp(rates, span, z, events=active, args=(mode,), max_step=1e-3, **settings)
            z = part.y[:, -1].copy()
            kind = next(kind for kind, times in zip(kinds, part.t_events, strict=True) if len(times))
            if kind == SEPARATED:
                break
            mode = next_mode(kind, z)
        y = lift_off(z)
        out[count] = y[3:]
    return out


@numba.njit(error_model="numpy")
def _beside(z: Floats, mode: Mode) -> Floats:
    """State off its zeros by a rounding error."""
    y = z.copy()
    for i in range(3):
        y[V_N + i] += _NUDGE * mode[i]
    return y


class _Piece(NamedTuple):
    """An integrator up to its first event; its state and parameters are views that are fetched once."""

    integrator: Any
    state: Floats
    pars: Floats
    kinds: list[int]  # guards in the order of its events

    def run(self, start: Floats) -> int:
        """Go from a state to the first event; return its index."""
        integrator = self.integrator
        integrator.time = 0.0
        integrator.reset_cooldowns()
        self.state[:] = start
        outcome = int(integrator.propagate_until(_LONGEST)[0])
        if not -max(1, len(self.kinds)) <= outcome < 0:
            raise RuntimeError(f"heyoka met no event: outcome {outcome}")
        return -outcome - 1


class Heyoka:
    """heyoka's Taylor integrators, one for each kind of mode, with terminal events; Python joins the pieces.

    The integrators are compiled when they are first needed and kept, the way its manual advises.
    """

    def __init__(self, tolerance: float = 2.220446049250313e-16) -> None:
        import heyoka

        self._hy = heyoka
        self._tolerance = tolerance
        self._contacts: dict[tuple[int, bool, bool], _Piece] = {}
        x, y, phi, u, v, omega = heyoka.make_vars("x", "y", "phi", "u", "v", "omega")
        rates_of = (u, v, omega, heyoka.expression(P.downhill), heyoka.expression(-P.inward), heyoka.expression(0.0))
        gap = y + P.eccentricity * heyoka.cos(phi) - P.radius
        flight = heyoka.taylor_adaptive(
            list(zip((x, y, phi, u, v, omega), rates_of, strict=True)),
            [0.0] * 6,
            tol=tolerance,
            t_events=[heyoka.t_event(gap, direction=heyoka.event_direction.negative)],
        )
        self._flight = _Piece(flight, flight.state, np.zeros(0), [])

    def _contact(self, mode: Mode) -> _Piece:
        """Integrator of a mode and its guards; modes that differ in the signs of slip and spin only share one."""
        key = (mode[0], mode[1] == 0, mode[2] == 0)
        if key not in self._contacts:
            self._contacts[key] = self._build(mode)
        return self._contacts[key]

    def _build(self, mode: Mode) -> _Piece:
        hy = self._hy
        phi, gap, v_n, v_t, omega, x = hy.make_vars("phi", "gap", "v_n", "v_t", "omega", "x")
        slip, spin = hy.par[0], hy.par[1]
        a = P.eccentricity * hy.sin(phi)
        lower = P.eccentricity * hy.cos(phi)
        b = P.radius - lower
        square = omega * omega
        drive_t = P.downhill + a * square
        drive_n = -P.inward - lower * square
        spring = -(P.closing if mode[0] < 0 else P.opening) * gap
        locked = (mode[0] == 0, mode[1] == 0, mode[2] == 0)
        force, moment, normal = forces(a, b, drive_t, drive_n, spring, locked, slip, spin)
        turn = (moment - a * normal + b * force) / P.inertia
        zero = hy.expression(0.0)
        system = {
            X: (x, v_t - b * omega),
            PHI: (phi, omega),
            GAP: (gap, v_n),
            V_N: (v_n, zero if locked[0] else normal / P.mass + drive_n - a * turn),
            V_T: (v_t, zero if locked[1] else force / P.mass + drive_t + b * turn),
            OMEGA: (omega, zero if locked[2] else turn),
        }
        values = {
            RATE_ZERO: mode[0] * v_n,
            RATE_CLOSES: -P.closing * gap - normal,
            RATE_OPENS: normal + P.opening * gap,
            SLIP_ZERO: slip * v_t,
            SLIP_RISES: P.friction * normal + force,
            SLIP_FALLS: P.friction * normal - force,
            SPIN_ZERO: spin * omega,
            SPIN_RISES: P.arm * normal + moment,
            SPIN_FALLS: P.arm * normal - moment,
            SEPARATED: -gap,
        }
        kinds = guards_of(mode)
        negative = hy.event_direction.negative
        events = [hy.t_event(values[kind], direction=negative) for kind in kinds]
        equations = [system[row] for row in range(6)]
        found = hy.taylor_adaptive(equations, [0.0] * 6, pars=[0.0, 0.0], tol=self._tolerance, t_events=events)
        return _Piece(found, found.state, found.pars, kinds)

    def __call__(self, rebounds: int) -> Floats:
        y = START
        out = np.zeros((rebounds, 3))
        for count in range(rebounds):
            self._flight.run(y)
            z = touch_down(self._flight.state)
            mode = choose(z, _UNDECIDED)
            while True:
                piece = self._contact(mode)
                piece.pars[0], piece.pars[1] = mode[1], mode[2]
                kind = piece.kinds[piece.run(_beside(z, mode))]
                z = piece.state.copy()
                if kind == SEPARATED:
                    break
                mode = next_mode(kind, z)
            y = lift_off(z)
            out[count] = y[3:]
        return out
