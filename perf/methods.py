"""General integrators on the same contact law: explicit Euler, RK4, scipy's DOP853 with events, heyoka with events.

Each answers with the velocities (u, v, omega) after the first ``rebounds`` rebounds of the reference descent.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from scipy.integrate import solve_ivp

from perf import contact_model as model
from perf.contact_model import CLOSING, OPENING, SEPARATED, START, V_N, Mode
from perf.harness import Floats
from perf.reference import DISC, DOWNHILL, INWARD, LAW

_LONGEST = 10.0  # [s] of one flight or one mode; none comes near
_UNDECIDED: Mode = (0, 0, 0)
# heyoka overlooks the next root of an event that is exactly zero at the start: start beside it, by one rounding error.
_NUDGE = 1e-17
_LIGHTNESS, _READINESS = 1.0 / DISC.mass, 1.0 / DISC.inertia
# A centre higher than this is out of reach whatever the angle: no cosine needed.
_CLEAR = DISC.radius + DISC.eccentricity

_fast = numba.njit(error_model="numpy", fastmath=True)


@_fast
def _pushed(lower: float, gap: float, phi: float, u: float, v: float, omega: float) -> tuple[float, float, float]:
    """Rates of (u, v, omega) in contact, with sign functions and a penalty force."""
    a = DISC.eccentricity * math.sin(phi)
    b = DISC.radius - lower
    normal = -(CLOSING if v - a * omega < 0.0 else OPENING) * gap
    force = -LAW.friction * normal * np.sign(u + b * omega)
    turn = _READINESS * (b * force - (a + LAW.rolling_arm * np.sign(omega)) * normal)
    return DOWNHILL + _LIGHTNESS * force, _LIGHTNESS * normal - INWARD, turn


@_fast
def euler(start: Floats, rebounds: int, dt: float) -> Floats:
    """Explicit Euler with a fixed step, the paper's method, without the ledger and the records of sledenv's own.

    The distance x acts on nothing and is not asked for.
    """
    y, phi, u, v, omega = start[1], start[2], start[3], start[4], start[5]
    out = np.zeros((rebounds, 3))
    for count in range(rebounds):
        while y > _CLEAR or y + DISC.eccentricity * math.cos(phi) >= DISC.radius:
            y += dt * v
            phi += dt * omega
            u += dt * DOWNHILL
            v -= dt * INWARD
        lower = DISC.eccentricity * math.cos(phi)
        gap = y + lower - DISC.radius
        while gap < 0.0:
            du, dv, turn = _pushed(lower, gap, phi, u, v, omega)
            y += dt * v
            phi += dt * omega
            u += dt * du
            v += dt * dv
            omega += dt * turn
            lower = DISC.eccentricity * math.cos(phi)
            gap = y + lower - DISC.radius
        out[count, 0], out[count, 1], out[count, 2] = u, v, omega
    return out


@_fast
def _accelerations(y: float, phi: float, u: float, v: float, omega: float) -> tuple[float, float, float]:
    """Rates of (u, v, omega), in flight too."""
    if y > _CLEAR:
        return DOWNHILL, -INWARD, 0.0
    lower = DISC.eccentricity * math.cos(phi)
    gap = y + lower - DISC.radius
    if gap >= 0.0:
        return DOWNHILL, -INWARD, 0.0
    return _pushed(lower, gap, phi, u, v, omega)


@_fast
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
        inside = y <= _CLEAR and y + DISC.eccentricity * math.cos(phi) < DISC.radius
        if was_inside and not inside:
            out[count, 0], out[count, 1], out[count, 2] = u, v, omega
            count += 1
    return out


def _falling(value: Any) -> Any:
    """Mark a function as a terminal event of scipy, at which it falls through zero."""
    value.terminal, value.direction = True, -1.0
    return value


def _event(kind: int) -> Any:
    """Return one guard as scipy wants it."""
    return _falling(numba.njit(error_model="numpy")(lambda t, z, mode: model.guard(kind, z, mode)))


@functools.cache
def _events() -> tuple[Any, ...]:
    return tuple(_event(kind) for kind in range(SEPARATED + 1))


def dop853(rebounds: int, tolerance: float) -> Floats:
    """DOP853 of scipy's ``solve_ivp``: order 8, terminal events for every guard, compiled right-hand side and guards.

    ``tolerance`` is relative; the absolute one is 1e-3 of it.
    """
    events = _events()
    landing = _falling(model.flight_gap)
    settings: dict[str, Any] = {"method": "DOP853", "rtol": max(tolerance, 2.3e-14), "atol": 1e-3 * tolerance}
    span = (0.0, _LONGEST)

    # scipy looks for events between the ends of a step only: a step that is too long jumps over a short contact.
    def fly(y: Floats) -> Floats:
        found: Floats = solve_ivp(model.flight_rates, span, y, events=landing, max_step=0.01, **settings).y[:, -1]
        return found

    def follow(z: Floats, mode: Mode) -> tuple[Floats, int]:
        kinds = model.guards_of(mode)
        active = [events[kind] for kind in kinds]
        part = solve_ivp(model.rates, span, z, events=active, args=(mode,), max_step=1e-3, **settings)
        kind = next(kind for kind, times in zip(kinds, part.t_events, strict=True) if len(times))
        return part.y[:, -1].copy(), kind

    return _joined(rebounds, fly, follow)


def _joined(rebounds: int, fly: Callable[..., Floats], follow: Callable[..., tuple[Floats, int]]) -> Floats:
    """Join pieces: flights up to the touchdown, and modes up to the guard that ends them."""
    y = START
    out = np.zeros((rebounds, 3))
    for count in range(rebounds):
        z = model.touch_down(fly(y))
        mode = model.choose(z, _UNDECIDED)
        while True:
            z, kind = follow(z, mode)
            if kind == SEPARATED:
                break
            mode = model.next_mode(kind, z)
        y = model.lift_off(z)
        out[count] = y[3:]
    return out


@numba.njit(error_model="numpy")
def _beside(z: Floats, mode: Mode) -> Floats:
    """State off its zeros by a rounding error."""
    y = z.copy()
    for i in range(3):
        y[V_N + i] += _NUDGE * mode[i]
    return y


class _Piece:
    """An integrator up to its first event; its state and parameters are views that are fetched once."""

    def __init__(self, equations: list[Any], guards: list[Any], **options: Any) -> None:
        import heyoka as hy

        events = [hy.t_event(value, direction=hy.event_direction.negative) for value in guards]
        self._integrator = hy.taylor_adaptive(equations, [0.0] * 6, t_events=events, **options)
        self._events = len(events)
        self.state: Floats = self._integrator.state
        self.pars: Floats = self._integrator.pars

    def run(self, start: Floats) -> int:
        """Go from a state to the first event; return its index."""
        self._integrator.time = 0.0
        self._integrator.reset_cooldowns()
        self.state[:] = start
        outcome = int(self._integrator.propagate_until(_LONGEST)[0])
        if not -self._events <= outcome < 0:
            raise RuntimeError(f"heyoka met no event: outcome {outcome}")
        return -outcome - 1


class Heyoka:
    """heyoka's Taylor integrators, one for each kind of mode, with terminal events; Python joins the pieces.

    The integrators are compiled when they are first needed and kept, the way its manual advises.
    """

    def __init__(self, tolerance: float = 2.220446049250313e-16) -> None:
        import heyoka as hy

        self._tolerance = tolerance
        self._contacts: dict[tuple[int, bool, bool], tuple[_Piece, list[int]]] = {}
        x, y, phi, u, v, omega = hy.make_vars("x", "y", "phi", "u", "v", "omega")
        rates = map(hy.expression, (u, v, omega, DOWNHILL, -INWARD, 0.0))
        gap = y + DISC.eccentricity * hy.cos(phi) - DISC.radius
        self._flight = _Piece(list(zip((x, y, phi, u, v, omega), rates, strict=True)), [gap], tol=tolerance)

    def _contact(self, mode: Mode) -> tuple[_Piece, list[int]]:
        """Integrator of a mode and its guards."""
        import heyoka as hy

        z = hy.make_vars("x", "phi", "gap", "v_n", "v_t", "omega")
        _, phi, gap, v_n, v_t, omega = z
        slip, spin = hy.par[0], hy.par[1]
        b, rates, loads = model.contact(hy.sin(phi), hy.cos(phi), gap, omega, mode, slip, spin)
        held = [hy.expression(0.0) if sign == 0 else rate for sign, rate in zip(mode, rates, strict=True)]
        values = model.guards(z, mode, slip, spin, loads)
        kinds = model.guards_of(mode)
        equations = list(zip(z, (v_t - b * omega, omega, v_n, *held), strict=True))
        return _Piece(equations, [values[kind] for kind in kinds], tol=self._tolerance, pars=[0.0, 0.0]), kinds

    def _fly(self, y: Floats) -> Floats:
        self._flight.run(y)
        return self._flight.state

    def _follow(self, z: Floats, mode: Mode) -> tuple[Floats, int]:
        key = (mode[0], mode[1] == 0, mode[2] == 0)  # modes that differ in the signs of slip and spin only share one
        if key not in self._contacts:
            self._contacts[key] = self._contact(mode)
        piece, kinds = self._contacts[key]
        piece.pars[0], piece.pars[1] = mode[1], mode[2]
        kind = kinds[piece.run(_beside(z, mode))]
        return piece.state.copy(), kind

    def __call__(self, rebounds: int) -> Floats:
        return _joined(rebounds, self._fly, self._follow)
