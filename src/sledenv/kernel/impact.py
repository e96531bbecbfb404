"""The impact in the stiff limit, exact in the normal impulse: docs/physics.md, section 4.

The configuration is frozen. Between events the velocities are linear in the normal impulse: so the impact is a short
list of phases, each in closed form. An event is that slip, spin or gap rate becomes zero, or that the impact ends.
"""

from __future__ import annotations

import math

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.compiler.trace import scalar
from sledenv.kernel.friction import Bounds, Branch, Drive, Mobility, branch_forces, rates, resolve, sign_of
from sledenv.kernel.state import followed_by

ENERGETIC, POISSON, NEWTON = range(3)  # hypotheses of what ends an impact
OVER, GOES_ON, ENDLESS = range(3)  # what comes after a phase
MOST_PHASES = 32
SIMULTANEOUS = 4e-16  # of a velocity: if less than this is left of it after a phase, that is rounding, and it stops too

_followed = scalar(lambda sequence, phase: (followed_by(sequence, phase),))


@kernel
def _mobility(hop: np.void) -> Mobility:
    return Mobility(hop["per_mass"], hop["per_inertia"], hop["a"], hop["b"])


@kernel
def _choose_forces(hop: np.void) -> None:
    """Write the signs of slip and spin in the next phase, and its tangential force and moment over the normal force.

    A velocity that is zero stays locked, or leaves with either sign.
    """
    slip, spin = sign_of(hop["v_t"]), sign_of(hop["omega"])
    mu, rho = -slip * hop["friction"], -spin * hop["arm"]
    if slip == 0 or spin == 0:
        w, drive = _mobility(hop), Drive(0.0, 0.0)
        branch = resolve(w, drive, hop["friction"], hop["arm"], hop["size"], Bounds(1.0, 1.0), Branch(-1, slip, spin))
        slip, spin = branch.slip, branch.spin
        mu, rho, _ = branch_forces(w, drive, hop["friction"], hop["arm"], 1.0, False, slip, spin)
    hop["slip"], hop["spin"], hop["mu"], hop["rho"] = slip, spin, mu, rho


@kernel
def _until_zero(velocity: float, rate: float) -> float:
    """Normal impulse [N s] after which a velocity is zero; inf if it does not come closer to zero."""
    closer = (velocity > 0.0 and rate < 0.0) or (velocity < 0.0 and rate > 0.0)
    return -velocity / rate if closer else math.inf


@kernel
def _until_end(hypothesis: int, rate_n: float, hop: np.void) -> float:
    """Normal impulse [N s] after which an impact whose gap opens ends, by its hypothesis; inf if it does not end."""
    v_n, restitution = hop["v_n"], hop["restitution"]
    if hypothesis == POISSON:
        return float(max((1.0 + restitution) * hop["compressed"] - hop["normal_impulse"], 0.0))
    if hypothesis == NEWTON:
        target = -restitution * hop["v_n_entry"]
        if v_n >= target:
            return 0.0
        return (target - v_n) / rate_n if rate_n > 0.0 else math.inf
    square = v_n * v_n + 2.0 * rate_n * hop["stored"]
    speed = v_n + math.sqrt(square) if square >= 0.0 else 0.0
    return 2.0 * hop["stored"] / speed if speed > 0.0 else math.inf


@kernel
def _after(velocity: float, rate: float, span: float) -> float:
    """Velocity after a normal impulse [N s]; exactly 0 if it stops there, though rounding leaves a rest of it."""
    then = velocity + rate * span
    return then if abs(then) > SIMULTANEOUS * abs(velocity) else 0.0


@kernel
def _pass_phase(hypothesis: int, hop: np.void) -> int:
    """Follow a phase up to its first event: slip or spin stops, the gap turns, the impact ends. Return what is next."""
    v_t, omega, v_n, mu, rho = hop["v_t"], hop["omega"], hop["v_n"], hop["mu"], hop["rho"]
    rate_t, rate_w, rate_n = rates(_mobility(hop), Drive(0.0, 0.0), mu, rho, 1.0)
    rate_t, rate_w = rate_t if hop["slip"] != 0.0 else 0.0, rate_w if hop["spin"] != 0.0 else 0.0
    hop["span"] = 0.0
    if v_n == 0.0:
        hop["opening"] = 1.0 if rate_n > 0.0 else 0.0
        if rate_n == 0.0 or (rate_n > 0.0 and not hop["stored"] > 0.0):
            return OVER  # the gap does not close, and there is no energy to give back
        if rate_n > 0.0 and hop["compressed"] == 0.0:
            hop["compressed"] = hop["normal_impulse"]
    opens = hop["opening"] > 0.0
    end = _until_end(hypothesis, rate_n, hop) if opens else math.inf
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
        hop["opened"] += work
    else:
        hop["closed"] -= work
    given_back = work if opens else hop["restitution"] * hop["restitution"] * work
    hop["stored"] = 0.0 if ends else max(hop["stored"] - given_back, 0.0)
    hop["sliding"] -= 0.5 * mu * (v_t + slip_then) * span
    hop["rolling"] -= 0.5 * rho * (omega + spin_then) * span
    hop["normal_impulse"] += span
    hop["tangential_impulse"] += mu * span
    hop["rolling_impulse"] += rho * span
    hop["v_t"], hop["omega"], hop["v_n"], hop["span"] = slip_then, spin_then, rate_then, span
    if span > 0.0:
        phase = (hop["slip"] + 1.0) + 3.0 * (hop["spin"] + 1.0) + 9.0 * hop["opening"]
        hop["sequence"] = _followed(hop["sequence"], phase)[0]
    return OVER if ends else GOES_ON


@kernel
def _begin(hop: np.void) -> None:
    """Write the numbers of an impact before its first phase."""
    hop["normal_impulse"] = hop["tangential_impulse"] = hop["rolling_impulse"] = 0.0
    hop["closed"] = hop["opened"] = hop["stored"] = hop["opening"] = hop["compressed"] = 0.0
    hop["sliding"] = hop["rolling"] = hop["hysteresis"] = 0.0
    hop["v_n_entry"] = hop["v_n"]


@kernel
def _write_phase(start: float, hop: np.void, phase: np.void) -> None:
    phase["start"], phase["impulse"] = start, hop["span"]
    phase["slip"], phase["spin"] = int(hop["slip"]), int(hop["spin"])
    phase["restitution"] = 1 if hop["opening"] > 0.0 else 0


@kernel
def impact(hypothesis: int, hop: np.void, phases: np.ndarray | None) -> int:
    """Follow one impact from touch to separation.

    Parameters
    ----------
    hypothesis : int
        ENERGETIC (Stronge): the normal work of restitution is e^2 times that of compression. POISSON: its impulse is
        e times that of compression. NEWTON: the gap opens e times as fast as it closed.
    hop : record of HOP
        Given ``per_mass``, ``per_inertia`` and ``size`` of the body, arms ``a`` and ``b`` of the contact point,
        ``friction``, rolling ``arm``, ``restitution``, and ``v_t``, ``omega``, ``v_n`` at touch; v_n > 0 is no impact.
        Afterwards it holds these velocities at the end, and the impulses and losses of the impact.
    phases : ndarray of PHASE, optional
        Filled from the front.

    Returns
    -------
    int
        Number of phases; MOST_PHASES + 1 if the impact does not end in MOST_PHASES of them.
    """
    _begin(hop)
    count, then = 0, OVER if hop["v_n"] > 0.0 else GOES_ON
    for _ in range(2 * MOST_PHASES - 1):  # some have no length
        if then != GOES_ON or count == MOST_PHASES:
            break
        _choose_forces(hop)
        start = hop["normal_impulse"]
        then = _pass_phase(hypothesis, hop)
        if hop["span"] > 0.0:
            if phases is not None:  # noqa: SIM102 - numba drops a branch on this alone when it compiles
                if count < phases.shape[0]:
                    _write_phase(start, hop, phases[count])
            count += 1
    if hypothesis == ENERGETIC:  # from one work: the difference of both would cancel
        hop["hysteresis"] = (1.0 - hop["restitution"] * hop["restitution"]) * hop["closed"]
    else:
        hop["hysteresis"] = hop["closed"] - hop["opened"]
    return count if then == OVER else MOST_PHASES + 1


@kernel
def softened(restitution: float, settle_speed: float, v_n: float, pressing: float) -> float:
    """Restitution of a touch; 0 if the touch is slow and the acceleration ``pressing`` is onto the slope."""
    return 0.0 if pressing > 0.0 and -v_n < settle_speed else restitution
