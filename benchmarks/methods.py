"""General integrators on the same contact law: explicit Euler, RK4, scipy's DOP853 with events, heyoka with events.

Each answers with the velocities (u, v, omega) after the first ``rebounds`` rebounds of the reference descent.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, cast

import numpy as np
from scipy.integrate import solve_ivp

import sledenv
from benchmarks.contact_model import (
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
from benchmarks.reference import BODY, LAUNCH, LAW, SLOPE, Floats
from sledenv.kernel.jit import allocating as compiled

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


@compiled
def _sign_rates(s: tuple[float, ...]) -> tuple[float, float, float, float, float, float]:
    """Rates of (x, y, phi, u, v, omega) with sign functions and a penalty force."""
    _, y, phi, u, v, omega = s
    a = P.eccentricity * math.sin(phi)
    b = P.radius - P.eccentricity * math.cos(phi)
    gap = y - b
    if gap >= 0.0:
        return u, v, omega, P.downhill, -P.inward, 0.0
    normal = -(P.closing if v - a * omega < 0.0 else P.opening) * gap
    force = -P.friction * normal * np.sign(u + b * omega)
    moment = -P.arm * normal * np.sign(omega)
    turn = (moment - a * normal + b * force) / P.inertia
    return u, v, omega, P.downhill + force / P.mass, normal / P.mass - P.inward, turn


@compiled
def _moved(s: tuple[float, ...], k: tuple[float, ...], h: float) -> tuple[float, float, float, float, float, float]:
    return s[0] + h * k[0], s[1] + h * k[1], s[2] + h * k[2], s[3] + h * k[3], s[4] + h * k[4], s[5] + h * k[5]


@compiled
def euler(start: Floats, rebounds: int, dt: float) -> Floats:
    """Explicit Euler with a fixed step, the paper's method, without the ledger and the records of sledenv's own."""
    s = (start[0], start[1], start[2], start[3], start[4], start[5])
    out = np.zeros((rebounds, 3))
    count = 0
    inside = False
    while count < rebounds:
        s = _moved(s, _sign_rates(s), dt)
        was_inside = inside
        inside = s[1] + P.eccentricity * math.cos(s[2]) - P.radius < 0.0
        if was_inside and not inside:
            out[count] = s[3:]
            count += 1
    return out


@compiled
def rk4(start: Floats, rebounds: int, dt: float) -> Floats:
    """Classical Runge-Kutta with a fixed step and no events, the whole descent in one compiled loop."""
    s = (start[0], start[1], start[2], start[3], start[4], start[5])
    out = np.zeros((rebounds, 3))
    count = 0
    inside = False
    while count < rebounds:
        k1 = _sign_rates(s)
        k2 = _sign_rates(_moved(s, k1, 0.5 * dt))
        k3 = _sign_rates(_moved(s, k2, 0.5 * dt))
        k4 = _sign_rates(_moved(s, k3, dt))
        s = _moved(_moved(_moved(_moved(s, k1, dt / 6.0), k2, dt / 3.0), k3, dt / 3.0), k4, dt / 6.0)
        was_inside = inside
        inside = s[1] + P.eccentricity * math.cos(s[2]) - P.radius < 0.0
        if was_inside and not inside:
            out[count] = s[3:]
            count += 1
    return out


def _falling(value: Any) -> Callable[..., float]:
    """Mark a function as a terminal event of scipy, at which it falls through zero."""
    value.terminal = True
    value.direction = -1.0
    return cast(Callable[..., float], value)


def _event(kind: int) -> Callable[..., float]:
    """Return one guard as scipy wants it."""

    @compiled
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


class Heyoka:
    """heyoka's Taylor integrators, one for each kind of mode, with terminal events; Python joins the pieces.

    The integrators are compiled when they are first needed and kept, the way its manual advises.
    """

    def __init__(self, tolerance: float = 2.220446049250313e-16) -> None:
        import heyoka

        self._hy = heyoka
        self._tolerance = tolerance
        self._contacts: dict[tuple[int, bool, bool], tuple[Any, list[int]]] = {}
        x, y, phi, u, v, omega = heyoka.make_vars("x", "y", "phi", "u", "v", "omega")
        rates_of = (u, v, omega, heyoka.expression(P.downhill), heyoka.expression(-P.inward), heyoka.expression(0.0))
        gap = y + P.eccentricity * heyoka.cos(phi) - P.radius
        self._flight = heyoka.taylor_adaptive(
            list(zip((x, y, phi, u, v, omega), rates_of, strict=True)),
            [0.0] * 6,
            tol=tolerance,
            t_events=[heyoka.t_event(gap, direction=heyoka.event_direction.negative)],
        )

    def _contact(self, mode: Mode) -> tuple[Any, list[int]]:
        """Integrator of a mode and its guards; modes that differ in the signs of slip and spin only share one."""
        key = (mode[0], mode[1] == 0, mode[2] == 0)
        if key not in self._contacts:
            self._contacts[key] = self._build(mode)
        return self._contacts[key]

    def _build(self, mode: Mode) -> tuple[Any, list[int]]:
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
        return hy.taylor_adaptive(equations, [0.0] * 6, pars=[0.0, 0.0], tol=self._tolerance, t_events=events), kinds

    def __call__(self, rebounds: int) -> Floats:
        y = START
        out = np.zeros((rebounds, 3))
        for count in range(rebounds):
            self._run(self._flight, y)
            z = touch_down(self._flight.state)
            mode = choose(z, _UNDECIDED)
            while True:
                integrator, kinds = self._contact(mode)
                integrator.pars[:] = mode[1:]
                for i in range(3):
                    z[V_N + i] += _NUDGE * mode[i]
                kind = kinds[self._run(integrator, z)]
                z = integrator.state.copy()
                if kind == SEPARATED:
                    break
                mode = next_mode(kind, z)
            y = lift_off(z)
            out[count] = y[3:]
        return out

    @staticmethod
    def _run(integrator: Any, start: Floats) -> int:
        """Go to the first event; return its index."""
        integrator.time = 0.0
        integrator.reset_cooldowns()
        integrator.state[:] = start
        outcome = int(integrator.propagate_until(_LONGEST)[0])
        if not -len(integrator.t_events) <= outcome < 0:
            raise RuntimeError(f"heyoka met no event: outcome {outcome}")
        return -outcome - 1
