"""What nearly every step of a compliant contact consists of, as straight-line programs: docs/physics.md, section 5.

Nearly all steps have all three velocities free, and nothing happens in them but the event that ends this phase of the
contact oscillation, or a slip or spin that stops: such a step is ordinary. :func:`step_abreast` takes one in several
contacts of a body without corners at once. What it cannot prove to be ordinary it leaves as it was, for
:mod:`sledenv.kernel.contact`, which runs the same programs.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sledenv.kernel import rows
from sledenv.kernel.events import NOTHING, RATE_ZERO, SEPARATION, SLIP_ZERO, SPIN_ZERO
from sledenv.kernel.friction import opening_of
from sledenv.kernel.jit import kernel
from sledenv.kernel.records import ARC
from sledenv.kernel.roots import CLOSE, MOST_APPROACHES, approach, certificate
from sledenv.kernel.rows import TERMS, WIDTH
from sledenv.kernel.series import (
    E_FORCE,
    E_GAP,
    E_MOMENT,
    E_NORMAL,
    E_OMEGA,
    E_PHI,
    E_SAFE_GAP,
    E_SAFE_OMEGA,
    E_SAFE_V_N,
    E_SAFE_V_T,
    E_SLIP,
    E_SPIN,
    E_STATE,
    E_TRAVEL,
    E_V_N,
    E_V_T,
    E_X,
    R_COSINE,
    R_SCRATCH,
    R_SINE,
    Z_ABEAM,
    Z_AHEAD,
    Z_BEFORE,
    Z_COSINE,
    Z_EVENT,
    Z_EXPECTED,
    Z_FINE,
    Z_FOUND,
    Z_GAP_RATE,
    Z_GAP_ZEROS,
    Z_GUESS,
    Z_H,
    Z_INWARD,
    Z_K_CLOSING,
    Z_K_OPENING,
    Z_LENGTH,
    Z_MAX_TIME,
    Z_MOST,
    Z_MOST_STEPS,
    Z_MU,
    Z_OMEGA,
    Z_OTHER_SINE,
    Z_PACE,
    Z_PACE_OPENING,
    Z_PER_MASS,
    Z_PER_PULSATION,
    Z_R,
    Z_RATIO,
    Z_RHO,
    Z_ROOT,
    Z_SCALE,
    Z_SEEKING,
    Z_SHIFT,
    Z_SINE,
    Z_SIZE,
    Z_SLIP,
    Z_SLIP_ZEROS,
    Z_SPIN,
    Z_SPIN_ZEROS,
    Z_STATE,
    Z_STEP,
    Z_STEPS,
    Z_STIFFNESS,
    Z_THETA,
    Z_TOLERANCE,
    Z_UNIT,
    Z_V_T,
    completion,
    ends,
    longest,
    spinning,
)
from sledenv.kernel.state import (
    FEATURE,
    GAP,
    HYSTERESIS,
    IMPULSE_N,
    IMPULSE_R,
    IMPULSE_T,
    OMEGA,
    PHI,
    ROLLING,
    SLIDING,
    STORED,
    TIME,
    V_N,
    V_T,
    X,
)
from sledenv.kernel.trace import (
    ABREAST,
    abreast,
    absolute,
    compiled,
    larger,
    less,
    not_more,
    root,
    rough_angle,
    section,
    set_apart,
    sine_cosine,
    where,
    with_sign,
    without,
)

MOST_UNITS = 2.0  # length of a step
SOUGHT = 1.1  # a root is sought if it is expected within so many lengths of the step,
STRETCHED = 1.08  # which may be longer by this factor to end there: its last terms are four times larger then
LEFT_ALONE = -1.0  # event of a step that was not taken
DEEPEST = -1.0  # in place of leading zeros of the gap rate: the gap has just stopped closing, no branch is chosen yet
NO_DEPTH = 1e-12  # share of the size of the body: a contact that is not deeper is resolved as if it carried no load


def _nonzero(a: Any) -> Any:
    return less(a, 0.0) | less(0.0, a)


def orientation(z: Any, state: Any) -> None:
    """Write how the feature lies."""
    z[Z_THETA] = state[PHI] + z[Z_SHIFT]
    z[Z_SINE], z[Z_COSINE] = sine_cosine(z[Z_THETA])


def paced(unit: Any, omega: Any) -> Any:
    """Unit of time in which sine and cosine converge fast."""
    return where(not_more(1.0, absolute(omega) * unit), 1.0 / absolute(omega), unit)


def telling(z: Any, state: Any) -> None:
    """Write where a step starts, its unit of time, and where it is in the contact oscillation with frozen arms."""
    for i in (X, PHI, GAP, V_N, V_T, OMEGA):
        z[Z_STATE + i] = state[i]
    z[Z_UNIT] = paced(z[Z_PACE], state[OMEGA])
    a, b = z[Z_H] * z[Z_SINE], z[Z_R] - z[Z_H] * z[Z_COSINE]
    slipping, spinning = _nonzero(z[Z_SLIP]), _nonzero(z[Z_SPIN])
    lever = z[Z_RHO] - a + where(slipping, z[Z_MU] * b, 0.0)
    share = z[Z_RATIO] / where(slipping, 1.0, 1.0 + z[Z_RATIO] * b * b)
    yielding = where(spinning, larger(1.0 - a * lever * share, 0.05), 1.0)
    z[Z_PER_PULSATION] = per_pulsation = 1.0 / root(z[Z_STIFFNESS] * z[Z_PER_MASS] * yielding)
    turning = z[Z_H] * z[Z_COSINE] * state[OMEGA] * state[OMEGA]
    gap, speed = state[GAP], state[V_N] * per_pulsation
    rest = -(z[Z_INWARD] + turning) * per_pulsation * per_pulsation  # the gap in balance
    # The gap over that in balance, apart cos + speed sin, closes where it is -rest,
    beyond = speed * speed + gap * (gap - 2.0 * rest)
    separating = less(0.0, z[Z_GAP_RATE]) & less(0.0, beyond)
    z[Z_EXPECTED] = where(separating, SEPARATION, RATE_ZERO)
    # and turns back where the tangent is speed / apart.
    z[Z_ABEAM] = where(separating, -gap, speed)
    z[Z_AHEAD] = where(separating, speed + root(beyond), gap - rest)
    # Of the two ends of the arc the one that is further away.
    reach = z[Z_OTHER_SINE]
    z[Z_OTHER_SINE] = where(not_more(state[FEATURE], ARC), with_sign(reach, state[PHI]), reach)


def expectation(z: Any) -> None:
    """Write the event that ends this phase of the contact oscillation, and when to expect it.

    The contact is taken for a harmonic oscillator with frozen arms, and its angles to a thousandth: the event is found
    exactly, only faster if the guess is good. Nothing is expected of a body that turns as fast.
    """
    separating, closing = not_more(z[Z_EXPECTED], SEPARATION), less(z[Z_GAP_RATE], 0.0)
    angle = rough_angle(z[Z_ABEAM], z[Z_AHEAD])
    later = where(closing & less(angle, 0.0), angle + math.pi, angle)
    angle = where(separating, 2.0 * angle, later)
    z[Z_GUESS] = angle * z[Z_PER_PULSATION] / z[Z_UNIT]
    kept = less(absolute(angle), math.inf) & not_more(z[Z_PACE], z[Z_UNIT])
    z[Z_EXPECTED] = where(kept, z[Z_EXPECTED], NOTHING)


def progress(z: Any, state: Any) -> None:
    """Move the state, the impulses and the losses to the end of the step, at which Z_EVENT happens."""
    slipping, spinning = _nonzero(z[Z_SLIP]), _nonzero(z[Z_SPIN])
    separation = not_more(z[Z_EVENT], SEPARATION) & not_more(SEPARATION, z[Z_EVENT])
    before = state[GAP]
    state[TIME] = state[TIME] + z[Z_STEP] * z[Z_UNIT]
    for i in (X, PHI, GAP, V_N, V_T, OMEGA):
        state[i] = z[E_STATE + i]
    state[GAP] = where(separation, 0.0, z[E_GAP])
    normal = z[E_NORMAL]
    state[IMPULSE_N] = state[IMPULSE_N] + normal
    state[IMPULSE_T] = state[IMPULSE_T] + where(slipping, z[Z_MU] * normal, z[E_FORCE])
    state[IMPULSE_R] = state[IMPULSE_R] + where(spinning, z[Z_RHO] * normal, z[E_MOMENT])
    # The powers of friction are never negative; the integral of a vanishing one may be, by rounding.
    slid, rolled = larger(-z[Z_MU] * z[E_SLIP], 0.0), larger(-z[Z_RHO] * z[E_SPIN], 0.0)
    state[SLIDING] = state[SLIDING] + where(slipping, slid, 0.0)
    state[ROLLING] = state[ROLLING] + where(spinning, rolled, 0.0)
    eased = 0.5 * (z[Z_K_CLOSING] - z[Z_K_OPENING]) * (before * before - state[GAP] * state[GAP])
    state[HYSTERESIS] = state[HYSTERESIS] + where(less(0.0, z[Z_GAP_RATE]), eased, 0.0)


# An ordinary step.


def _turning_back(z: Any, state: Any) -> Any:
    """Program of the branch of a contact that has just been at its deepest; whether it opens, if it was.

    It clearly does where the box rule would at once say so, and by more than rounding: see
    :func:`sledenv.kernel.friction.resolve`. What is less clear is left to that.
    """
    pending = less(z[Z_GAP_ZEROS], 0.0)
    a, b, depth = z[Z_H] * z[Z_SINE], z[Z_R] - z[Z_H] * z[Z_COSINE], -state[GAP]
    mobility = (z[Z_PER_MASS], z[Z_RATIO] * z[Z_PER_MASS], a, b)
    drive = -z[Z_INWARD] - z[Z_H] * z[Z_COSINE] * state[OMEGA] * state[OMEGA]
    bounds = (z[Z_K_CLOSING] * depth, z[Z_K_OPENING] * depth)
    rate, clear = opening_of(*mobility, z[Z_MU], z[Z_RHO], drive, *bounds)
    opens = less(2.0 * clear, rate) & less(NO_DEPTH * z[Z_SIZE], depth) & _nonzero(state[V_T]) & _nonzero(state[OMEGA])
    turns = pending & opens
    z[Z_GAP_RATE] = where(turns, 1.0, z[Z_GAP_RATE])
    z[Z_STIFFNESS] = where(turns, z[Z_K_OPENING], z[Z_STIFFNESS])
    z[Z_PACE] = where(turns, z[Z_PACE_OPENING], z[Z_PACE])
    z[Z_GAP_ZEROS] = where(turns, 1.0, z[Z_GAP_ZEROS])
    return opens | ~pending


def _beginning(z: Any, state: Any, c: Any) -> None:
    """Program of an ordinary step up to the search for the root of the event that is expected."""
    orientation(z, state)
    clear = _turning_back(z, state)
    telling(z, state)
    unread = [row * WIDTH + k for row in (PHI, R_SINE, R_COSINE) for k in range(WIDTH)]
    spinning(False, False)(z, without(c, unread))
    expectation(z)
    (most,) = longest(z[Z_SIZE], z[Z_SCALE], z[Z_TOLERANCE], MOST_UNITS, c)
    left = larger(z[Z_MAX_TIME] - state[TIME], 0.0) / z[Z_UNIT]
    fine = clear & less(STRETCHED * most, left) & less(z[Z_STEPS], z[Z_MOST_STEPS])
    z[Z_FINE] = where(fine, 1.0, 0.0)
    separating = not_more(z[Z_EXPECTED], SEPARATION)
    sought = less(NOTHING, z[Z_EXPECTED]) & (separating | not_more(z[Z_GAP_ZEROS], 0.0))
    z[Z_STEP], z[Z_EVENT] = most, NOTHING
    _seek(z, c, fine & sought & less(z[Z_GUESS], SOUGHT * most), STRETCHED * most, separating, GAP, V_N)


def _seek(z: Any, c: Any, sought: Any, most: Any, one: Any, row: int, other: int) -> None:
    """Let the event that is expected be sought up to some time: the root of one row of the table or other."""
    z[Z_SEEKING] = where(sought, 1.0, 0.0)
    z[Z_FOUND] = 0.0
    z[Z_ROOT] = z[Z_GUESS]
    z[Z_MOST] = z[Z_BEFORE] = most
    rows.write(c, R_SCRATCH, rows.of([where(one, c[row * WIDTH + k], c[other * WIDTH + k]) for k in range(TERMS)]))


def _approaching(z: Any, c: Any) -> None:
    """Program of one step of :func:`sledenv.kernel.series.locate`."""
    s, step, error = approach(section(c, R_SCRATCH * WIDTH), z[Z_ROOT], TERMS)
    seeking = less(0.0, z[Z_SEEKING]) & less(absolute(step), z[Z_BEFORE])
    there = not_more(error, CLOSE)
    z[Z_ROOT] = where(seeking, s, z[Z_ROOT])
    z[Z_BEFORE] = 0.25 * absolute(step)
    z[Z_FOUND] = where(seeking & there, 1.0, z[Z_FOUND])
    z[Z_SEEKING] = where(seeking & ~there, 1.0, 0.0)


def _certifying(z: Any, c: Any) -> None:
    """Program of its end."""
    (certainty,) = certificate(section(c, R_SCRATCH * WIDTH), z[Z_ROOT])
    first = less(0.0, z[Z_ROOT]) & not_more(z[Z_ROOT], z[Z_MOST]) & less(0.0, certainty)
    z[Z_FOUND] = where(first, z[Z_FOUND], 0.0)


def _taking(z: Any) -> None:
    """Let the step end with the event that has been found."""
    found = less(0.0, z[Z_FOUND])
    z[Z_STEP] = where(found, z[Z_ROOT], z[Z_STEP])
    z[Z_EVENT] = where(found, z[Z_EXPECTED], z[Z_EVENT])
    z[Z_FOUND] = 0.0


def _foreseeing(z: Any, c: Any) -> None:
    """Program of whether slip or spin changes its sign on the way to what has been found."""
    _taking(z)
    z[E_V_T], z[E_OMEGA] = ends(c, (V_T, OMEGA), z[Z_STEP])
    slip = less(z[Z_V_T] * z[E_V_T], 0.0) & not_more(z[Z_SLIP_ZEROS], 0.0)
    spin = less(z[Z_OMEGA] * z[E_OMEGA], 0.0) & not_more(z[Z_SPIN_ZEROS], 0.0)
    z[Z_EXPECTED] = where(slip, SLIP_ZERO, SPIN_ZERO)
    z[Z_SEEKING] = where((slip | spin) & less(0.0, z[Z_FINE]), 1.0, 0.0)


def _turning(z: Any, c: Any) -> None:
    """Program that lets that be sought."""
    slip = not_more(z[Z_EXPECTED], SLIP_ZERO)
    before, end = where(slip, z[Z_V_T], z[Z_OMEGA]), where(slip, z[E_V_T], z[E_OMEGA])
    z[Z_GUESS] = z[Z_STEP] * before / (before - end)
    _seek(z, c, less(0.0, z[Z_SEEKING]), z[Z_STEP], slip, V_T, OMEGA)


def _completing(z: Any, c: Any) -> None:
    """Program of the step up to what has been found."""
    _taking(z)
    completion(z, c, corners=False)


def _happens(z: Any, event: int) -> Any:
    return not_more(z[Z_EVENT], event) & not_more(event, z[Z_EVENT])


def _proved(z: Any) -> Any:
    """Whether nothing changes its sign on the way but what is zero at the end."""
    separates, turns, sticks, stops = (_happens(z, event) for event in (SEPARATION, RATE_ZERO, SLIP_ZERO, SPIN_ZERO))
    proved = turns | less(0.0, z[E_SAFE_V_N])
    proved = proved & (sticks | less(0.0, z[E_SAFE_V_T]))
    proved = proved & (stops | less(0.0, z[E_SAFE_OMEGA]))
    return proved & (separates | less(z[Z_GAP_RATE], 0.0) | less(0.0, z[E_SAFE_GAP]))


def _ending(z: Any, state: Any) -> None:
    """Program of the end of an ordinary step."""
    turns, sticks, stops = (_happens(z, event) for event in (RATE_ZERO, SLIP_ZERO, SPIN_ZERO))
    fine = less(0.0, z[Z_FINE]) & _proved(z)
    fine = fine & less(z[E_TRAVEL], z[Z_LENGTH] - z[Z_STATE + X])
    fine = fine & less(state[TIME], state[TIME] + z[Z_STEP] * z[Z_UNIT])
    size = absolute(z[E_X] + z[E_PHI] + z[E_GAP] + z[E_V_N] + z[E_V_T] + z[E_OMEGA])
    fine = fine & less(size, math.inf)
    before = {i: state[i] for i in range(STORED)}
    progress(z, state)
    for i, zero in ((V_N, turns), (V_T, sticks), (OMEGA, stops)):
        state[i] = where(zero, 0.0, state[i])
    for i, value in before.items():
        state[i] = where(fine, state[i], value)
    z[Z_EVENT] = where(fine, z[Z_EVENT], LEFT_ALONE)
    z[Z_STEPS] = where(fine, z[Z_STEPS] + 1.0, z[Z_STEPS])
    for row, zeros in ((Z_GAP_ZEROS, where(turns, DEEPEST, 0.0)), (Z_SLIP_ZEROS, 0.0), (Z_SPIN_ZEROS, 0.0)):
        z[row] = where(fine, zeros, z[row])


_orientation, _telling, _expectation, _progress = (
    compiled(program) for program in (orientation, telling, expectation, progress)
)
_begin_all, _approach_all, _certify_all, _foresee_all, _turn_all, _complete_all, _end_all = (
    abreast(program) for program in (_beginning, _approaching, _certifying, _foreseeing, _turning, _completing, _ending)
)


@kernel
def orient(z: np.ndarray, state: np.ndarray) -> None:
    """Write how the feature lies."""
    _orientation(z, state)


@kernel
def tell(z: np.ndarray, state: np.ndarray) -> None:
    """Write where a step starts, its unit of time, and where it is in the contact oscillation with frozen arms."""
    _telling(z, state)


@kernel
def expect(z: np.ndarray) -> None:
    """Write the event that ends this phase of the contact oscillation, and when to expect it."""
    _expectation(z)


@kernel
def advance(z: np.ndarray, state: np.ndarray) -> None:
    """Move the state, the impulses and the losses to the end of the step, at which Z_EVENT happens."""
    _progress(z, state)


@kernel
def _begin_abreast(z: np.ndarray, state: np.ndarray, c: np.ndarray) -> None:
    set_apart()
    _begin_all(z, state, c)


@kernel
def _approach_abreast(z: np.ndarray, c: np.ndarray) -> None:
    _approach_all(z, c)


@kernel
def _certify_abreast(z: np.ndarray, c: np.ndarray) -> None:
    _certify_all(z, c)


@kernel
def _foresee_abreast(z: np.ndarray, c: np.ndarray) -> None:
    set_apart()
    _foresee_all(z, c)


@kernel
def _complete_abreast(z: np.ndarray, c: np.ndarray) -> None:
    set_apart()
    _complete_all(z, c)


@kernel
def _turn_abreast(z: np.ndarray, c: np.ndarray) -> None:
    _turn_all(z, c)


@kernel
def _end_abreast(z: np.ndarray, state: np.ndarray) -> None:
    set_apart()
    _end_all(z, state)


@kernel
def _any(lanes: np.ndarray) -> bool:
    total = 0.0
    for k in range(ABREAST):
        total += lanes[k]
    return total > 0.0


@kernel
def _locate_abreast(z: np.ndarray, c: np.ndarray) -> None:
    """Find the roots that are sought, each as :func:`sledenv.kernel.series.locate` does."""
    for _ in range(MOST_APPROACHES):
        if not _any(z[Z_SEEKING]):
            break
        _approach_abreast(z, c)
    if _any(z[Z_FOUND]):
        _certify_abreast(z, c)


@kernel
def step_abreast(z: np.ndarray, state: np.ndarray, c: np.ndarray) -> None:
    """Take an ordinary step in each of ABREAST contacts; where it is not one, nothing but Z_EVENT, LEFT_ALONE, tells.

    A contact that has stopped closing in the step before opens first, if it clearly does.

    Parameters
    ----------
    z, state, c : ndarray, shapes (Z_ROWS, ABREAST), (STATE_SIZE, ABREAST) and (ROWS * WIDTH, ABREAST)
        As for one contact of a body without corners, with the lanes side by side. The rows of ``z`` below Z_TOLD are
        read, ``c`` is work space.
    """
    _begin_abreast(z, state, c)
    _locate_abreast(z, c)
    _foresee_abreast(z, c)
    if _any(z[Z_SEEKING]):
        _turn_abreast(z, c)
        _locate_abreast(z, c)
    _complete_abreast(z, c)
    _end_abreast(z, state)
