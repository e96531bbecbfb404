"""The impact in the stiff limit, exact in the normal impulse: docs/physics.md, section 4.

The configuration is frozen. Between events the velocities are linear in the normal impulse: so the impact is a short
list of phases, each in closed form. An event is that slip, spin or gap rate becomes zero, or that the impact ends.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import sign_of
from sledenv.kernel.books import followed_by

ENERGETIC, POISSON, NEWTON = range(3)  # hypotheses of what ends an impact
OVER, GOES_ON, ENDLESS = range(3)  # what comes after a phase
MOST_PHASES: Final = 32
SIMULTANEOUS: Final = 4e-16  # of a velocity: what is left of it after a phase and is less is rounding, and it stops
TIE: Final = 1e-12  # of the normal force: a locked force may be beyond its bound by this


@kernel
def _held_moment(slip_force: float, spin: int, hit: np.void) -> tuple[int, float]:
    """Sign of a spin that is zero, and the rolling moment over the normal force: it is held, or at its bound."""
    if spin != 0:
        return spin, -spin * hit["rolling_arm"]
    held = hit["a"] - hit["b"] * slip_force
    if abs(held) - hit["rolling_arm"] <= TIE * hit["size"]:
        return 0, held
    return (-1, hit["rolling_arm"]) if held > 0.0 else (1, -hit["rolling_arm"])


@kernel
def _held_force(rho: float, hit: np.void) -> tuple[int, float]:
    """Sign of a slip that is zero while the body spins, and the friction over the normal force, as for the moment."""
    mass, b = 1.0 / hit["per_mass"], hit["b"]
    held = -mass * b * ((rho - hit["a"]) * hit["per_inertia"] / (1.0 + mass * b * b * hit["per_inertia"]))
    if abs(held) - hit["friction"] <= TIE:
        return 0, held
    return (-1, hit["friction"]) if held > 0.0 else (1, -hit["friction"])


@kernel
def _choose_forces(hit: np.void) -> None:
    """Write the signs of slip and spin in the next phase, and its tangential force and moment over the normal force.

    A velocity that is zero stays locked, or leaves with either sign: the box rule, docs/physics.md (4.2). Without any
    slip no friction acts unless the body spins: then only the moment holds it.
    """
    slip, spin = sign_of(hit["v_t"]), sign_of(hit["omega"])
    if slip != 0:
        mu = -slip * hit["friction"]
        spin, rho = _held_moment(mu, spin, hit)
    else:
        mu = 0.0
        spin, rho = _held_moment(mu, spin, hit)
        if spin != 0:
            slip, mu = _held_force(rho, hit)
    hit["slip"], hit["spin"], hit["mu"], hit["rho"] = slip, spin, mu, rho


@kernel
def _rates(hit: np.void) -> tuple[float, float, float]:
    """Rates of slip, spin and gap rate under a unit normal force."""
    spin_rate = (hit["rho"] - hit["a"] + hit["b"] * hit["mu"]) * hit["per_inertia"]
    rate_t = hit["mu"] * hit["per_mass"] + hit["b"] * spin_rate
    rate_n = hit["per_mass"] - hit["a"] * spin_rate
    return rate_t if hit["slip"] != 0.0 else 0.0, spin_rate if hit["spin"] != 0.0 else 0.0, rate_n


@kernel
def _until_zero(velocity: float, rate: float) -> float:
    """Normal impulse [N s] after which a velocity is zero; inf if it does not come closer to zero."""
    closer = (velocity > 0.0 and rate < 0.0) or (velocity < 0.0 and rate > 0.0)
    return -velocity / rate if closer else math.inf


@kernel
def _until_end(hypothesis: int, rate_n: float, hit: np.void) -> float:
    """Normal impulse [N s] after which an impact whose gap opens ends, by its hypothesis; inf if it does not end."""
    v_n, restitution = hit["v_n"], hit["restitution"]
    if hypothesis == POISSON:
        return float(max((1.0 + restitution) * hit["compressed"] - hit["normal_impulse"], 0.0))
    if hypothesis == NEWTON:
        target = -restitution * hit["v_n_entry"]
        if v_n >= target:
            return 0.0
        return (target - v_n) / rate_n if rate_n > 0.0 else math.inf
    square = v_n * v_n + 2.0 * rate_n * hit["stored"]
    speed = v_n + math.sqrt(square) if square >= 0.0 else 0.0
    return 2.0 * hit["stored"] / speed if speed > 0.0 else math.inf


@kernel
def _after(velocity: float, rate: float, span: float) -> float:
    """Velocity after a normal impulse [N s]; exactly 0 if it stops there, though rounding leaves a rest of it."""
    then = velocity + rate * span
    return then if abs(then) > SIMULTANEOUS * abs(velocity) else 0.0


@kernel
def _pass_phase(hypothesis: int, hit: np.void) -> int:
    """Follow a phase up to its first event: slip or spin stops, the gap turns, the impact ends. Return what is next."""
    v_t, omega, v_n, mu, rho = hit["v_t"], hit["omega"], hit["v_n"], hit["mu"], hit["rho"]
    rate_t, rate_w, rate_n = _rates(hit)
    hit["span"] = 0.0
    if v_n == 0.0:
        hit["opening"] = 1.0 if rate_n > 0.0 else 0.0
        if rate_n == 0.0 or (rate_n > 0.0 and not hit["stored"] > 0.0):
            return OVER  # the gap does not close, and there is no energy to give back
        if rate_n > 0.0 and hit["compressed"] == 0.0:
            hit["compressed"] = hit["normal_impulse"]
    opens = hit["opening"] > 0.0
    end = _until_end(hypothesis, rate_n, hit) if opens else math.inf
    until_t, until_w, until_n = _until_zero(v_t, rate_t), _until_zero(omega, rate_w), _until_zero(v_n, rate_n)
    stopping = min(until_t, until_w)
    span = min(stopping, min(until_n, end))
    if not span < math.inf:
        return ENDLESS
    # Of events at the same impulse the end comes first, then the stop of slip or spin, then the turn of the gap.
    ends = end <= span
    turns = until_n < stopping and not ends
    stops = not turns and not ends
    slip_then = 0.0 if stops and until_t <= until_w else _after(v_t, rate_t, span)
    spin_then = 0.0 if stops and until_w < until_t else _after(omega, rate_w, span)
    rate_then = 0.0 if turns else v_n + rate_n * span
    work = 0.5 * (v_n + rate_then) * span
    if opens:
        hit["opened"] += work
    else:
        hit["closed"] -= work
    given_back = work if opens else hit["restitution"] * hit["restitution"] * work
    hit["stored"] = 0.0 if ends else max(hit["stored"] - given_back, 0.0)
    hit["sliding"] -= 0.5 * mu * (v_t + slip_then) * span
    hit["rolling"] -= 0.5 * rho * (omega + spin_then) * span
    hit["normal_impulse"] += span
    hit["tangential_impulse"] += mu * span
    hit["rolling_impulse"] += rho * span
    hit["v_t"], hit["omega"], hit["v_n"], hit["span"] = slip_then, spin_then, rate_then, span
    if span > 0.0:
        phase = (hit["slip"] + 1.0) + 3.0 * (hit["spin"] + 1.0) + 9.0 * hit["opening"]
        hit["sequence"] = followed_by(hit["sequence"], phase)
    return OVER if ends else GOES_ON


@kernel
def _begin(hit: np.void) -> None:
    """Write the numbers of an impact before its first phase."""
    hit["normal_impulse"] = hit["tangential_impulse"] = hit["rolling_impulse"] = 0.0
    hit["closed"] = hit["opened"] = hit["stored"] = hit["opening"] = hit["compressed"] = 0.0
    hit["sliding"] = hit["rolling"] = hit["hysteresis"] = 0.0
    hit["v_n_entry"] = hit["v_n"]


@kernel
def _write_phase(start: float, hit: np.void, phase: np.void) -> None:
    phase["start"], phase["impulse"] = start, hit["span"]
    phase["slip"], phase["spin"] = int(hit["slip"]), int(hit["spin"])
    phase["restitution"] = 1 if hit["opening"] > 0.0 else 0


@kernel
def impact(hypothesis: int, hit: np.void, phases: np.ndarray | None) -> int:
    """Follow one impact from touch to separation.

    Parameters
    ----------
    hypothesis : int
        ENERGETIC (Stronge): the normal work of restitution is e^2 times that of compression. POISSON: its impulse is
        e times that of compression. NEWTON: the gap opens e times as fast as it closed.
    hit : record of IMPACT
        Given ``per_mass``, ``per_inertia`` and ``size`` of the body, arms ``a`` and ``b`` of the contact point,
        ``friction``, ``rolling_arm``, ``restitution``, and ``v_t``, ``omega``, ``v_n`` at touch; v_n > 0 is no impact.
        Afterwards it holds these velocities at the end, and the impulses and losses of the impact.
    phases : ndarray of PHASE, optional
        Filled from the front.

    Returns
    -------
    int
        Number of phases; MOST_PHASES + 1 if the impact does not end in MOST_PHASES of them.
    """
    _begin(hit)
    count, then = 0, OVER if hit["v_n"] > 0.0 else GOES_ON
    for _ in range(2 * MOST_PHASES - 1):  # some have no length
        if then != GOES_ON or count == MOST_PHASES:
            break
        _choose_forces(hit)
        start = hit["normal_impulse"]
        then = _pass_phase(hypothesis, hit)
        if hit["span"] > 0.0:
            if phases is not None:  # noqa: SIM102 - numba drops a branch on this alone when it compiles
                if count < phases.shape[0]:
                    _write_phase(start, hit, phases[count])
            count += 1
    if hypothesis == ENERGETIC:  # from one work: the difference of both would cancel
        hit["hysteresis"] = (1.0 - hit["restitution"] * hit["restitution"]) * hit["closed"]
    else:
        hit["hysteresis"] = hit["closed"] - hit["opened"]
    return count if then == OVER else MOST_PHASES + 1


@kernel
def softened(restitution: float, settle_speed: float, v_n: float, pressing: float) -> float:
    """Restitution of a touch; 0 if the touch is slow and the acceleration ``pressing`` is onto the slope."""
    return 0.0 if pressing > 0.0 and -v_n < settle_speed else restitution
