"""Power series of the state over one step of a contact, by recurrence: docs/physics.md, section 5.

The programs below are straight lines of arithmetic, see :mod:`sledenv.kernel.trace`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sledenv.kernel.jit import kernel
from sledenv.kernel.state import GAP, OMEGA, PHI, V_N, V_T, X
from sledenv.kernel.trace import absolute, compiled, fma, sine_cosine, smaller, total, where_less

ORDER = 18
TERMS = ORDER + 1

# Rows of the table of series; those of the state have the numbers that they have in the contact state. Time is counted
# in a unit of the step's own, so a coefficient is what its term adds at the end of one unit.
R_NORMAL, R_FORCE, R_MOMENT, R_SINE, R_COSINE, R_SCRATCH = range(7, 13)
ROWS = 13

# What the programs are told and what they answer.
(
    Z_PER_MASS,  # [1/kg]
    Z_PER_INERTIA,  # [1/(kg m^2)]
    Z_H,  # [m] of the feature
    Z_R,  # [m]
    Z_MU,  # [-] tangential force over normal force
    Z_RHO,  # [m] rolling moment over normal force
    Z_STIFFNESS,  # [N/m] of the branch
    Z_INWARD,  # [m/s^2] gravity along the inward normal
    Z_DOWNHILL,  # [m/s^2] and along the slope
    Z_THETA,  # [rad] orientation of the feature
    Z_UNIT,  # [s] unit of time
    Z_X,  # the state at the start of the step
    Z_PHI,
    Z_GAP,
    Z_V_N,
    Z_V_T,
    Z_OMEGA,
    # Gap of the corner on the other side: that of the feature + Z_OTHER + Z_SINE sin(theta) + Z_COSINE cos(theta).
    Z_OTHER,  # [m]
    Z_SINE,
    Z_COSINE,
    Z_GUESS,  # [units] where a root is expected,
    Z_MOST,  # up to where it is sought,
    Z_ROOT,  # and where it was found:
    Z_CERTAIN,  # > 0 if it is a root, and the first
    Z_STEP,  # [units] length of the step
    E_X,  # the state at its end
    E_PHI,
    E_GAP,
    E_V_N,
    E_V_T,
    E_OMEGA,
    E_NORMAL,  # [N s] impulse
    E_FORCE,  # [N s] of the tangential force where the slip is locked
    E_MOMENT,  # [N m s] of the moment where the spin is locked
    E_SLIP,  # [J] integral of the normal force times the slip velocity,
    E_SPIN,  # [N] and times the spin
    E_TRAVEL,  # [m] most that x changes by on the way
    E_TURN,  # [rad] and phi
    E_SAFE_GAP,  # > 0 if a quantity keeps its sign on the way,
    E_SAFE_V_N,
    E_SAFE_V_T,
    E_SAFE_OMEGA,
    E_SAFE_OTHER,
    E_LEFT_V_N,  # or if it does after it has left zero at the start of the step
    E_LEFT_V_T,
    E_LEFT_OMEGA,
    # For locked velocities: bounds of the forces, and > 0 if these stay within.
    Z_FRICTION,  # [-]
    Z_ARM,  # [m]
    Z_LEAST,  # [N]
    Z_LARGEST,
    E_SAFE_NORMAL,
    E_SAFE_FORCE,
    E_SAFE_MOMENT,
) = range(53)
Z_ROWS = 53
Z_STATE = Z_X - X  # offset of the state, whose order is that of the contact state
E_STATE = E_X - X


def _convolve(p: Sequence[Any], q: Sequence[Any], k: int, first: int = 0) -> Any:
    """Coefficient ``k`` of a product, from ``p[first]`` on.

    The newest coefficients, at the two ends, come last, and the others in two chains: so little waits for them.
    """
    inner = list(range(max(first, 1), k))
    ends = [i for i in ((k, 0) if k > 0 else (0,)) if i >= first]
    chains: list[Any] = []
    for part in (inner[::2], inner[1::2] + ends):
        chain: Any = None
        for i in part:
            chain = p[i] * q[k - i] if chain is None else fma(p[i], q[k - i], chain)
        if chain is not None:
            chains.append(chain)
    return sum(chains[1:], chains[0]) if chains else 0.0


def _expansion(gap_locked: bool, slip_locked: bool, spin_locked: bool) -> Any:
    """Return the program that fills the table in one branch: docs/physics.md (5.5)-(5.9)."""

    def program(z: Any, c: Any) -> None:
        per_mass, per_inertia, h, r = z[Z_PER_MASS], z[Z_PER_INERTIA], z[Z_H], z[Z_R]
        mu, rho, stiffness, unit = z[Z_MU], z[Z_RHO], z[Z_STIFFNESS], z[Z_UNIT]
        inward, downhill = z[Z_INWARD], z[Z_DOWNHILL]
        mass, inertia = 1.0 / per_mass, 1.0 / per_inertia
        none = 0.0 * unit
        sine_0, cosine_0 = sine_cosine(z[Z_THETA])
        sine, cosine = [sine_0], [cosine_0]
        x, phi, gap = [z[Z_X]], [z[Z_PHI]], [z[Z_GAP]]
        v_n, v_t, spins = [none if gap_locked else z[Z_V_N]], [none if slip_locked else z[Z_V_T]], [z[Z_OMEGA]]
        if spin_locked:
            spins = [none]
        a, b, lever = [], [], []  # arms of the contact point; of the normal force, with what follows from it
        normal, force, moment = [], [], []
        speed_n, speed_t = [none], [none]  # of the mass centre; their values at the start play no part
        for k in range(ORDER):
            after = unit * (1.0 / (k + 1))
            per_after = (k + 1) / unit
            a.append(h * sine[k])
            b.append(r - h * cosine[k] if k == 0 else -(h * cosine[k]))
            from_normal = -a[k] if slip_locked else fma(mu, b[k], -a[k])
            lever.append(from_normal + rho if k == 0 else from_normal)
            turned_sine = none if spin_locked else _convolve(sine, spins, k)
            turned_cosine = none if spin_locked else _convolve(cosine, spins, k)
            sine.append(turned_cosine * after)
            cosine.append(-(turned_sine * after))
            # Locked velocities: v = a omega, u = -b omega. What the new coefficient of omega does not enter yet:
            rest_n, rest_t = none, none
            if not spin_locked:
                if gap_locked:
                    rest_n = _convolve([*a, h * sine[k + 1]], [*spins, none], k + 1, 1) * per_after
                if slip_locked:
                    rest_t = _convolve([*b, -(h * cosine[k + 1])], [*spins, none], k + 1, 1) * per_after
            if k == 0:
                rest_n, rest_t = rest_n + inward, rest_t + downhill
            if gap_locked and spin_locked:
                normal.append(mass * rest_n)
            elif not gap_locked:
                normal.append(-(stiffness * gap[k]))
            if spin_locked:
                spin_rate = none
                force.append(-(mass * rest_t) if slip_locked else mu * normal[k])
                moment.append(fma(a[0], normal[k], -(b[0] * force[k])))
            else:
                known = _convolve(lever, [*normal, none] if gap_locked else normal, k, 1 if gap_locked else 0)
                divisor = inertia
                if gap_locked:
                    known = fma(mass * lever[0], rest_n, known)
                    divisor = divisor - mass * a[0] * lever[0]
                if slip_locked:
                    if k > 0:
                        known = known + _convolve(b, [*force, none], k, 1)
                    known = known - mass * b[0] * rest_t
                    divisor = divisor + mass * b[0] * b[0]
                spin_rate = known * per_inertia if not (gap_locked or slip_locked) else known / divisor
                if gap_locked:
                    normal.append(mass * fma(a[0], spin_rate, rest_n))
                force.append(-(mass * fma(b[0], spin_rate, rest_t)) if slip_locked else mu * normal[k])
                moment.append(rho * normal[k])
            spins.append(spin_rate * after)
            pull, push = (inward, downhill) if k == 0 else (none, none)
            speed_n.append((normal[k] * per_mass - pull) * after)
            speed_t.append((force[k] * per_mass + push) * after)
            if k > 0:
                v_n.append(none if gap_locked else fma(-h, turned_sine, speed_n[k]))
                v_t.append(none if slip_locked else fma(r, spins[k], fma(-h, turned_cosine, speed_t[k])))
            gap.append(v_n[k] * after)
            phi.append(spins[k] * after)
            x.append((v_t[k] - fma(r, spins[k], -(h * turned_cosine))) * after)
        last_sine, last_cosine = _convolve(sine, spins, ORDER), _convolve(cosine, spins, ORDER)
        v_n.append(none if gap_locked else fma(-h, last_sine, speed_n[ORDER]))
        v_t.append(none if slip_locked else fma(r, spins[ORDER], fma(-h, last_cosine, speed_t[ORDER])))
        rows = {X: x, GAP: gap, V_N: v_n, V_T: v_t, PHI: phi, OMEGA: spins, R_SINE: sine, R_COSINE: cosine}
        rows[R_NORMAL] = [*normal, none]
        if slip_locked:
            rows[R_FORCE] = [*force, none]
        if spin_locked:
            rows[R_MOMENT] = [*moment, none]
        for row, values in rows.items():
            for k, value in enumerate(values):
                c[row * TERMS + k] = value

    return program


# Branches by which of gap rate, slip and spin is locked.
_free = compiled(_expansion(False, False, False))
_sticking = compiled(_expansion(False, True, False))
_sliding = compiled(_expansion(False, False, True))
_stuck = compiled(_expansion(False, True, True))
_settled = compiled(_expansion(True, False, False))
_rolling = compiled(_expansion(True, True, False))
_gliding = compiled(_expansion(True, False, True))


def _powers(s: Any) -> list[Any]:
    """Powers of ``s`` from 0 to ORDER."""
    powers = [1.0, s]
    for k in range(2, TERMS):
        powers.append(powers[k // 2] * powers[k - k // 2])
    return powers


def _value(coefficients: Sequence[Any], s: Any) -> Any:
    """Value of a polynomial, in four chains that run side by side."""
    square = s * s
    fourth = square * square
    chains = []
    for first in range(4):
        terms = coefficients[first::4]
        chain = terms[-1]
        for term in reversed(terms[:-1]):
            chain = fma(chain, fourth, term)
        chains.append(chain)
    return fma(fma(chains[3], s, chains[2]), square, fma(chains[1], s, chains[0]))


def _keeps_sign(terms: Sequence[Any], first: int = 0) -> Any:
    """Lower bound of ``|p|`` over a step, divided by t^first; terms: those of p at the end of the step."""
    leading, slope = terms[first], terms[first + 1]
    against = where_less(leading, 0.0, -slope, slope)
    rest = total([absolute(term) for term in terms[first + 2 :]])
    return absolute(leading) + smaller(against, 0.0) - rest


def _location(row: int) -> Any:
    """Return the program that finds the first root of a row near Z_GUESS, by Newton's method: docs/physics.md, 10.1."""

    def program(z: Any, c: Any) -> None:
        q = [c[row * TERMS + k] for k in range(TERMS)]
        rate = [float(k) * q[k] for k in range(1, TERMS)]
        s, most = z[Z_GUESS], z[Z_MOST]
        change = s
        for _ in range(4):
            change = _value(q, s) / _value(rate, s)
            s = s - change
        # q = (t - s) B: the root is the first if B has none in [0, s].
        quotient = [q[ORDER]]
        for k in range(ORDER - 1, 0, -1):
            quotient.append(fma(s, quotient[-1], q[k]))
        terms = [b * power for b, power in zip(reversed(quotient), _powers(s), strict=False)]
        certain = _keeps_sign(terms)
        certain = where_less(absolute(change), 1e-8, certain, -1.0)
        certain = where_less(0.0, s, certain, -1.0)
        z[Z_ROOT] = s
        z[Z_CERTAIN] = where_less(most, s, -1.0, certain)

    return program


_SHARE = [1.0 / (k + 1) for k in range(ORDER)]  # of a term in the integral


def _completion(z: Any, c: Any) -> None:
    """State and work at the end of a step of Z_STEP units, and whether anything changes its sign on the way."""
    s, unit = z[Z_STEP], z[Z_UNIT]
    time = s * unit
    powers = _powers(s)
    names = (X, GAP, V_N, V_T, OMEGA, R_NORMAL, R_SINE, R_COSINE)
    x, gap, v_n, v_t, omega, normal, sine, cosine = (
        [c[row * TERMS + k] * powers[k] for k in range(TERMS)] for row in names
    )
    turning = [omega[k] * _SHARE[k] for k in range(ORDER)]
    z[E_X] = total(x)
    z[E_PHI] = fma(time, total(turning), z[Z_PHI])
    z[E_GAP] = total(gap)
    z[E_V_N] = total(v_n)
    z[E_V_T] = total(v_t)
    z[E_OMEGA] = total(omega)
    z[E_NORMAL] = time * total([normal[k] * _SHARE[k] for k in range(ORDER)])
    for answer, velocity in ((E_SLIP, v_t), (E_SPIN, omega)):
        z[answer] = time * total([_convolve(normal, velocity, k) * _SHARE[k] for k in range(ORDER)])
    z[E_TRAVEL] = total([absolute(term) for term in x[1:]])
    z[E_TURN] = time * total([absolute(term) for term in turning])
    z[E_SAFE_GAP] = _keeps_sign(gap)
    for safe, left, velocity in (
        (E_SAFE_V_N, E_LEFT_V_N, v_n),
        (E_SAFE_V_T, E_LEFT_V_T, v_t),
        (E_SAFE_OMEGA, E_LEFT_OMEGA, omega),
    ):
        z[safe] = _keeps_sign(velocity)
        z[left] = _keeps_sign(velocity, 1)
    other = [fma(z[Z_SINE], sine[k], fma(z[Z_COSINE], cosine[k], gap[k])) for k in range(TERMS)]
    other[0] = other[0] + z[Z_OTHER]
    z[E_SAFE_OTHER] = where_less(0.0, other[0], _keeps_sign(other), -1.0)


def _above(terms: Sequence[Any]) -> Any:
    """Lower bound of a series over a step; terms: its own at the end of the step."""
    return terms[0] + smaller(terms[1], 0.0) - total([absolute(term) for term in terms[2:]])


def _slack(z: Any, c: Any) -> None:
    """Impulses of the forces of locked velocities over a step of Z_STEP units, and whether they stay within bounds."""
    powers = _powers(z[Z_STEP])
    time = z[Z_STEP] * z[Z_UNIT]
    normal, force, moment = (
        [c[row * TERMS + k] * powers[k] for k in range(ORDER)] for row in (R_NORMAL, R_FORCE, R_MOMENT)
    )
    for answer, factor, bounded in ((E_SAFE_FORCE, z[Z_FRICTION], force), (E_SAFE_MOMENT, z[Z_ARM], moment)):
        low = _above([fma(factor, n, f) for n, f in zip(normal, bounded, strict=True)])
        high = _above([fma(factor, n, -f) for n, f in zip(normal, bounded, strict=True)])
        z[answer] = smaller(low, high)
    z[E_FORCE] = time * total([force[k] * _SHARE[k] for k in range(ORDER)])
    z[E_MOMENT] = time * total([moment[k] * _SHARE[k] for k in range(ORDER)])
    low = _above([normal[0] - z[Z_LEAST], *normal[1:]])
    high = _above([z[Z_LARGEST] - normal[0], *(-term for term in normal[1:])])
    z[E_SAFE_NORMAL] = smaller(low, high)


_gap_root = compiled(_location(GAP))
_rate_root = compiled(_location(V_N))
_slip_root = compiled(_location(V_T))
_spin_root = compiled(_location(OMEGA))
_complete = compiled(_completion)
_bound = compiled(_slack)


@kernel
def locate_gap(z: np.ndarray, c: np.ndarray) -> None:
    """Find where the gap closes, near Z_GUESS."""
    _gap_root(z, c)


@kernel
def locate_rate(z: np.ndarray, c: np.ndarray) -> None:
    """Find where the gap rate is zero, near Z_GUESS."""
    _rate_root(z, c)


@kernel
def locate_slip(z: np.ndarray, c: np.ndarray) -> None:
    """Find where the slip stops, near Z_GUESS."""
    _slip_root(z, c)


@kernel
def locate_spin(z: np.ndarray, c: np.ndarray) -> None:
    """Find where the spin stops, near Z_GUESS."""
    _spin_root(z, c)


@kernel
def complete(z: np.ndarray, c: np.ndarray) -> None:
    """Answer how a step of Z_STEP units ends, and whether anything changes its sign on the way."""
    _complete(z, c)


@kernel
def complete_locked(z: np.ndarray, c: np.ndarray) -> None:
    """Answer what the forces of locked velocities do up to Z_STEP, and whether they stay within their bounds."""
    _bound(z, c)


@kernel
def expand_free(z: np.ndarray, c: np.ndarray) -> None:
    """Fill the table where gap, slip and spin are free."""
    _free(z, c)


@kernel
def _expand_sticking(z: np.ndarray, c: np.ndarray) -> None:
    _sticking(z, c)


@kernel
def _expand_sliding(z: np.ndarray, c: np.ndarray) -> None:
    _sliding(z, c)


@kernel
def _expand_stuck(z: np.ndarray, c: np.ndarray) -> None:
    _stuck(z, c)


@kernel
def _expand_settled(z: np.ndarray, c: np.ndarray) -> None:
    _settled(z, c)


@kernel
def _expand_rolling(z: np.ndarray, c: np.ndarray) -> None:
    _rolling(z, c)


@kernel
def _expand_gliding(z: np.ndarray, c: np.ndarray) -> None:
    _gliding(z, c)


@kernel
def expand(gap_rate: int, slip: int, spin: int, z: np.ndarray, c: np.ndarray) -> None:
    """Fill the table ``c`` with the series of one step in the given branch: docs/physics.md (5.5)-(5.9).

    Parameters
    ----------
    gap_rate, slip, spin : int
        The branch: signs of v_n, v_t and omega, 0 where locked, at least one of them free.
    z : ndarray, shape (Z_ROWS,)
        See the names above.
    c : ndarray, shape (ROWS, TERMS)
        Overwritten.
    """
    if spin != 0:
        if gap_rate != 0:
            if slip != 0:
                expand_free(z, c)
            else:
                _expand_sticking(z, c)
        elif slip != 0:
            _expand_settled(z, c)
        else:
            _expand_rolling(z, c)
    elif gap_rate == 0:
        _expand_gliding(z, c)
    elif slip != 0:
        _expand_sliding(z, c)
    else:
        _expand_stuck(z, c)
