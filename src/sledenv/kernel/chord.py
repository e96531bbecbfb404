"""Compliant contact of the chord: both of its ends touch, each like a spring of its own; docs/physics.md, section 8.2.

The body has two sides, that of the tail and that of the nose. Each side touches with one point, and there a normal
force acts by the two-stiffness law, with the gap and the gap rate of that side. The two normal forces know nothing of
each other. Tangentially the body slips as one, at the mean of the two points: their heights differ by no more than
their penetrations do.

The orientation ``phi`` counts from the one in which the chord lies flat. The lowest point of a side then lies at
(-a, -b) from the mass centre, with the arms::

    a = -along sin(phi) - across cos(phi)
    b = radius + along cos(phi) - across sin(phi)

While a corner touches, ``along`` is the distance of the mass centre from the chord, ``across`` half the chord, negative
on the side of the nose, and ``radius`` zero. Where a body is pressed in so deep that it turns past the end of its arc,
the arc takes over on that side: ``along`` is then the eccentricity, ``across`` zero and ``radius`` that of the arc.

As in :mod:`sledenv.kernel.contact` the motion between two events is a power series of the time, here in seconds, and an
event the first root of a series. Signs of velocities are kept as a branch, in which a locked velocity has none.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.kernel.contact import MOST_STALLED, NO_DEPTH, leading_zeros, sign_of
from sledenv.kernel.events import before_separation, both_signs, bound_root, level_root, series_root, slope_end
from sledenv.kernel.friction import Bounds, Branch, Drive, Mobility, resolve
from sledenv.kernel.geometry import corner_lengths
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, Incline, Limits
from sledenv.kernel.records import (
    ARC,
    BURIED,
    FINISH,
    NON_FINITE,
    NOSE,
    ONE_CORNER,
    RUNNING,
    SEPARATED,
    STEP_BUDGET,
    TAIL,
    TIMEOUT,
    TUMBLED,
)
from sledenv.kernel.records import CHORD as CHORD_CODE
from sledenv.kernel.roots import first_root, horner
from sledenv.kernel.series import ORDER, longest_step
from sledenv.kernel.state import WIDTH, record
from sledenv.kernel.step import (
    FEATURE_ENDS,
    MIDDLE_PASSED,
    NOTHING,
    RATE_ZERO,
    SEPARATION,
    SLIP_RELEASED,
    SLIP_ZERO,
    SLOPE_ENDS,
    SPIN_RELEASED,
    SPIN_ZERO,
)
from sledenv.kernel.trajectory import CONTACT_ROWS, next_row, write_forces, write_motion

TIME_ENDS = -1  # event, beside those of a single contact: the time of the descent is over

SAME_RATE = 1e-12  # of the speed scale: gap rates of the two sides that are equal but for rounding
TOUCHING = 1e-9  # of the size: gap of the second side where it starts to touch
UNIT_ANGLE = 1.4  # of the fastest contact oscillation in the longest step

# A point of the body, by the numbers that the top of this module explains.
POINT: Final = np.dtype(
    [
        ("along", "f8"),  # [m]
        ("across", "f8"),  # [m]
        ("radius", "f8"),  # [m]
    ],
    align=True,
)

# One of the two contacts.
SIDE: Final = record(
    ("sign", "f8"),  # 1 of the tail, -1 of the nose: what holds for one holds for the other, mirrored
    ("point", POINT),  # that touches
    ("rolling_arm", "f8"),  # [m] of it
    ("on_arc", "i8"),  # 1 if it is on the arc, 0 if it is the corner
    ("at_edge", "i8"),  # 1 if the one has just taken over from the other
    ("gap", "f8"),  # [m] between it and the slope
    ("gap_rate", "f8"),  # sign of the gap rate
    ("zeros", "i8"),  # leading coefficients of the gap rate that are zero by construction
    ("turning", "i8"),  # 1 while it is to be decided whether the gap rate changes its sign
    ("stiffness", "f8"),  # [N/m]
    # Series of a step.
    ("gaps", "f8", (WIDTH,)),  # [m]
    ("normals", "f8", (WIDTH,)),  # [N]
)

# Series of a step that concern the body as a whole.
MOTION: Final = record(
    ("x", "f8", (WIDTH,)),  # [m] of the mass centre
    ("y", "f8", (WIDTH,)),  # [m]
    ("phi", "f8", (WIDTH,)),  # [rad]
    ("v_n", "f8", (WIDTH,)),  # [m/s] of the mass centre along the normal
    ("speed", "f8", (WIDTH,)),  # [m/s] of the mass centre along the slope
    ("v_t", "f8", (WIDTH,)),  # [m/s] slip velocity
    ("omega", "f8", (WIDTH,)),  # [rad/s]
    ("normal", "f8", (WIDTH,)),  # [N] sum of both sides
    ("load", "f8", (WIDTH,)),  # [N m] sum of rolling arm times normal force, the bound of the rolling moment
    ("force", "f8", (WIDTH,)),  # [N] along the slope
    ("moment", "f8", (WIDTH,)),  # [N m] of rolling
    ("sines", "f8", (WIDTH,)),  # of phi
    ("cosines", "f8", (WIDTH,)),
    ("pull_sine", "f8", (WIDTH,)),  # [N m] the forces turn the body by this times the sine of phi
    ("pull_cosine", "f8", (WIDTH,)),  # [N m] and this times the cosine
    ("scratch", "f8", (WIDTH,)),  # whose root is sought
)

# The contact of both sides. Make it with :func:`sledenv.kernel.state.new`: behind the terms of a series are zeros.
CHORD: Final = record(
    ("x", "f8"),  # [m] of the mass centre
    ("y", "f8"),  # [m]
    ("phi", "f8"),  # [rad] from where the chord lies flat
    ("turns", "f8"),  # [rad] that phi leaves out, an odd multiple of pi
    ("v_n", "f8"),  # [m/s] of the mass centre along the normal
    ("v_t", "f8"),  # [m/s] slip velocity
    ("omega", "f8"),  # [rad/s]
    ("tail", SIDE),
    ("nose", SIDE),
    ("tail_first", "i8"),  # 1 if the side of the tail came down first
    ("middle", POINT),  # where the body slips: the mean of those of both sides
    # The branch of slip and spin: what these velocities do from here on.
    ("slip", "f8"),  # signs of v_t and omega, 0 where locked
    ("spin", "f8"),
    ("slip_zeros", "i8"),  # leading coefficients of v_t and omega that are zero by construction
    ("spin_zeros", "i8"),
    ("slip_left", "i8"),  # signs with which they have just been released, or 0
    ("spin_left", "i8"),
    # How long a step may be.
    ("scale", "f8"),  # [m/s] of the velocities
    ("longest", "f8"),  # [s]
    ("edge", "f8"),  # [rad] size of phi where the arc takes over from a corner
    ("stalled", "i8"),  # events in a row without any progress in time
    # A step: its series, and what ends it.
    ("motion", MOTION),
    ("length", "f8"),  # [s] of the step
    ("event", "i8"),  # code of what happens at its end,
    ("event_sign", "f8"),  # the sign of the side to which it happens, or with which a velocity is released
)


@kernel
def _side(chord: np.void, number: int) -> np.void:
    """Side that came down first (0) or second (1): the order must not tell a body from its mirror image."""
    side: np.void = chord["tail"] if (number == 0) == (chord["tail_first"] != 0) else chord["nose"]
    return side


@kernel
def _arms(point: np.void, phi: float) -> tuple[float, float]:
    sine, cosine = math.sin(phi), math.cos(phi)
    a = -point["along"] * sine - point["across"] * cosine
    return a, point["radius"] + point["along"] * cosine - point["across"] * sine


@kernel
def _set_features(body: Body, contact: np.void, chord: np.void) -> None:
    """Write where the sides touch, from what touches there."""
    tail, nose = chord["tail"], chord["nose"]
    height, half = corner_lengths(body)
    for side in (tail, nose):
        point, on_arc = side["point"], side["on_arc"] != 0
        point["along"] = body.eccentricity if on_arc else height
        point["across"] = 0.0 if on_arc else side["sign"] * half
        point["radius"] = body.radius if on_arc else 0.0
        side["rolling_arm"] = contact["arc_arm"] if on_arc else contact["corner_arm"]
    middle, one, two = chord["middle"], tail["point"], nose["point"]
    middle["along"] = 0.5 * (one["along"] + two["along"])
    middle["across"] = 0.5 * (one["across"] + two["across"])
    middle["radius"] = 0.5 * (one["radius"] + two["radius"])


@kernel
def _let_move(contact: np.void, side: np.void, gap_rate: float) -> None:
    """Let the gap of a side close (-1) or open (1)."""
    side["gap_rate"] = gap_rate
    side["stiffness"] = contact["k_closing"] if gap_rate < 0.0 else contact["k_opening"]


@kernel
def _begin(body: Body, slope: Incline, contact: np.void, chord: np.void) -> bool:
    """Take over the contact of one side and add the other; say whether that touches too."""
    size = body.radius + body.eccentricity
    started = int(contact["feature"])
    turns = math.pi * (2.0 * math.floor(contact["phi"] / (2.0 * math.pi)) + 1.0)
    phi, omega = contact["phi"] - turns, contact["omega"]
    tail_first = started == TAIL or (started == ARC and phi < 0.0)
    chord["tail_first"] = 1 if tail_first else 0
    tail, nose = chord["tail"], chord["nose"]
    tail["sign"], nose["sign"] = 1.0, -1.0
    first, second = _side(chord, 0), _side(chord, 1)
    first["on_arc"], second["on_arc"] = 1 if started == ARC else 0, 0
    _set_features(body, contact, chord)
    a, b = _arms(first["point"], phi)
    _, b_second = _arms(second["point"], phi)
    # Of two corners the difference of the arms suffers no cancellation.
    _, half = corner_lengths(body)
    gap = contact["gap"] + (b - b_second if started == ARC else -2.0 * first["sign"] * half * math.sin(phi))
    if abs(gap) > TOUCHING * size:
        return False
    first["gap"], second["gap"] = contact["gap"], min(gap, 0.0)

    v_n = contact["v_n"] + a * omega
    v_t = contact["v_t"] + (_arms(chord["middle"], phi)[1] - b) * omega
    if abs(v_t) <= 1e-15 * (abs(contact["v_t"]) + size * abs(omega)):
        v_t = 0.0
    chord["x"], chord["y"], chord["phi"], chord["turns"] = contact["x"], contact["gap"] + b, phi, turns
    chord["v_n"], chord["v_t"], chord["omega"] = v_n, v_t, omega
    for side in (tail, nose):
        _let_move(contact, side, 1.0 if v_n - _arms(side["point"], phi)[0] * omega > 0.0 else -1.0)
        side["zeros"], side["at_edge"], side["turning"] = 0, 0, 0
    chord["slip"], chord["spin"] = 0.0, 0.0
    chord["slip_zeros"], chord["spin_zeros"], chord["slip_left"], chord["spin_left"] = 0, 0, 0, 0

    chord["scale"] = max(abs(v_n), abs(v_t), size * abs(omega), math.sqrt(slope.gravity * size), 1e-12)
    softness = 2.0 / body.mass + 2.0 * size**2 * (1.0 + contact["friction"]) / body.inertia
    chord["longest"] = UNIT_ANGLE / math.sqrt(contact["k_closing"] * softness)
    chord["edge"] = math.pi - body.half_angle
    chord["stalled"] = 0
    return True


@kernel
def _choose_branch(body: Body, slope: Incline, contact: np.void, chord: np.void) -> None:
    """Choose what slip and spin do from here on.

    For the box rule the two normal forces act as their sum, at the arm of their resultant.
    """
    tail, nose, phi, omega = chord["tail"], chord["nose"], chord["phi"], chord["omega"]
    size = body.radius + body.eccentricity
    shallow = NO_DEPTH * size
    depth_1, depth_2 = max(-tail["gap"], shallow), max(-nose["gap"], shallow)
    deepest = max(-tail["gap"], -nose["gap"])
    if min(-tail["gap"], -nose["gap"]) > 0.0 and deepest < shallow:
        lift = shallow / deepest  # both are loaded: their ratio counts
        depth_1, depth_2 = -tail["gap"] * lift, -nose["gap"] * lift
    n_1, n_2 = tail["stiffness"] * depth_1, nose["stiffness"] * depth_2
    normal = n_1 + n_2
    lever = (_arms(tail["point"], phi)[0] * n_1 + _arms(nose["point"], phi)[0] * n_2) / normal
    arm = (tail["rolling_arm"] * n_1 + nose["rolling_arm"] * n_2) / normal
    a, b = _arms(chord["middle"], phi)
    slip_left, spin_left = chord["slip_left"], chord["spin_left"]
    signs = Branch(
        -1,  # of neither side: the normal force is given, whichever way the gaps move
        2 * slip_left if slip_left != 0 else sign_of(chord["v_t"]),
        2 * spin_left if spin_left != 0 else sign_of(omega),
    )
    chosen = resolve(
        Mobility(1.0 / body.mass, 1.0 / body.inertia, lever, b),
        Drive(slope.downhill + a * omega * omega, -slope.inward),
        contact["friction"],
        arm,
        size,
        Bounds(normal, normal),
        signs,
    )
    # A friction without a force has no surface to stay on: its velocity passes zero freely.
    slip = 1 if contact["friction"] == 0.0 else chosen.slip
    spin = 1 if arm == 0.0 else chosen.spin
    # Where one velocity alone has been released, at its bound, its acceleration vanishes too.
    leaving = 2 if (slip != chord["slip"]) != (spin != chord["spin"]) else 1
    chord["slip_zeros"] = (leaving if slip_left != 0 else 1) if chord["v_t"] == 0.0 else 0
    chord["spin_zeros"] = (leaving if spin_left != 0 else 1) if omega == 0.0 else 0
    chord["slip"], chord["spin"] = slip, spin


@kernel
def _expand(body: Body, slope: Incline, contact: np.void, chord: np.void) -> None:
    """Write the series of one step: docs/physics.md (8.4)."""
    motion, tail, nose, middle = chord["motion"], chord["tail"], chord["nose"], chord["middle"]
    x, y, phi, gap_1, gap_2 = motion["x"], motion["y"], motion["phi"], tail["gaps"], nose["gaps"]
    v_n, v_t, omega, speed = motion["v_n"], motion["v_t"], motion["omega"], motion["speed"]
    sines, cosines = motion["sines"], motion["cosines"]
    pull_sine, pull_cosine = motion["pull_sine"], motion["pull_cosine"]
    along_1, across_1 = tail["point"]["along"], tail["point"]["across"]
    along_2, across_2 = nose["point"]["along"], nose["point"]["across"]
    along, across, radius = middle["along"], middle["across"], middle["radius"]
    stiffness_1, arm_1 = tail["stiffness"], tail["rolling_arm"]
    stiffness_2, arm_2 = nose["stiffness"], nose["rolling_arm"]
    m, friction, slip, spin = body.mass, contact["friction"], chord["slip"], chord["spin"]
    x[0], y[0], phi[0], gap_1[0], gap_2[0] = chord["x"], chord["y"], chord["phi"], tail["gap"], nose["gap"]
    v_n[0], v_t[0], omega[0] = chord["v_n"], chord["v_t"], chord["omega"]
    sines[0], cosines[0] = math.sin(chord["phi"]), math.cos(chord["phi"])
    arm = radius + along * cosines[0] - across * sines[0]
    speed[0] = v_t[0] - arm * omega[0]
    tilt, lever = sines[0] * omega[0], cosines[0] * omega[0]  # products of sine and cosine with the spin
    for k in range(ORDER):
        after = 1.0 / (k + 1)
        weight, drive = (slope.inward, slope.downhill) if k == 0 else (0.0, 0.0)
        n_1, n_2 = -stiffness_1 * gap_1[k], -stiffness_2 * gap_2[k]
        normal, load = n_1 + n_2, arm_1 * n_1 + arm_2 * n_2
        tail["normals"][k], nose["normals"][k], motion["normal"][k], motion["load"][k] = n_1, n_2, normal, load
        gap_1[k + 1] = (v_n[k] + along_1 * tilt + across_1 * lever) * after
        gap_2[k + 1] = (v_n[k] + along_2 * tilt + across_2 * lever) * after
        x[k + 1], y[k + 1], phi[k + 1] = speed[k] * after, v_n[k] * after, omega[k] * after
        sines[k + 1], cosines[k + 1] = lever * after, -tilt * after
        v_n[k + 1] = (normal / m - weight) * after
        # What depends on the spin to come is left out at first: its own coefficient, and the force that comes with it.
        tilt, lever = 0.0, 0.0
        for i in range(1, k + 2):
            tilt += sines[i] * omega[k + 1 - i]
            lever += cosines[i] * omega[k + 1 - i]
        drift = along * lever - across * tilt
        pull_sine[k] = along_1 * n_1 + along_2 * n_2
        pull_cosine[k] = across_1 * n_1 + across_2 * n_2
        by_sine, by_cosine = 0.0, 0.0
        for i in range(k + 1):
            by_sine += pull_sine[i] * sines[k - i]
            by_cosine += pull_cosine[i] * cosines[k - i]
        turning = by_sine + by_cosine
        force = -slip * friction * normal
        spin_rate = 0.0
        if spin != 0.0:
            moment = -spin * load
            if slip == 0.0:
                held = (k + 1) * drift + drive
                spin_rate = (turning + moment - m * arm * held) / (body.inertia + m * arm * arm)
                force = -m * (arm * spin_rate + held)
            else:
                spin_rate = (turning + moment + arm * force) / body.inertia
        else:
            if slip == 0.0:
                force = -m * drive
            moment = -turning - arm * force
        motion["force"][k], motion["moment"][k] = force, moment
        pull_sine[k] -= across * force
        pull_cosine[k] += along * force
        omega[k + 1] = spin_rate * after
        speed[k + 1] = (force / m + drive) * after
        tilt += sines[0] * omega[k + 1]
        lever += cosines[0] * omega[k + 1]
        v_t[k + 1] = 0.0 if slip == 0.0 else speed[k + 1] + radius * omega[k + 1] + along * lever - across * tilt


@kernel
def _bound_step(body: Body, limits: Limits, contact: np.void, chord: np.void) -> None:
    """Write how long the series hold, at most up to the end of the descent: NaN if they are not finite."""
    motion = chord["motion"]
    size = body.radius + body.eccentricity
    length = longest_step(
        size, chord["scale"], limits.tolerance, chord["longest"], motion["v_n"], motion["v_t"], motion["omega"]
    )
    left = max(limits.max_time - contact["time"], 0.0)
    chord["event"] = TIME_ENDS if length >= left else NOTHING
    chord["length"] = min(length, left)
    if chord["slip_zeros"] == 2:
        chord["slip_zeros"] = leading_zeros(motion["v_t"], chord["slip"])
    if chord["spin_zeros"] == 2:
        chord["spin_zeros"] = leading_zeros(motion["omega"], chord["spin"])


@kernel
def _happens(at: float, event: int, sign: float, chord: np.void) -> None:
    """Let the step end with an event, if there is one."""
    if at < math.inf:
        chord["length"], chord["event"], chord["event_sign"] = at, event, sign


@kernel
def _find_gap_events(chord: np.void) -> None:
    """Look for where the gap of a side turns, and for where the side leaves."""
    q = chord["motion"]["scratch"]
    for number in range(2):
        side = _side(chord, number)
        gaps, sign, gap_rate = side["gaps"], side["sign"], side["gap_rate"]
        for k in range(ORDER):
            q[k] = gap_rate * (k + 1) * gaps[k + 1]
        q[ORDER:] = 0.0
        _happens(first_root(q, chord["length"], side["zeros"], 0.0), RATE_ZERO, sign, chord)
        if gap_rate > 0.0:
            _happens(series_root(gaps, q, -1.0, chord["length"], 0), SEPARATION, sign, chord)


@kernel
def _find_friction_events(contact: np.void, chord: np.void) -> None:
    """Look for the end of a locked slip or spin, and for where a free one stops."""
    motion = chord["motion"]
    q, normal, load = motion["scratch"], motion["normal"], motion["load"]
    force, moment = motion["force"], motion["moment"]
    # Where one side leaves alone, a release at that very time is left to the contact of the other.
    before = before_separation(chord["length"]) if chord["event"] == SEPARATION else math.inf
    if chord["slip"] == 0.0:
        for sign in both_signs(force[0]):
            at = bound_root(normal, force, q, sign, contact["friction"], chord["length"])
            if at < before:
                _happens(at, SLIP_RELEASED, float(-sign), chord)
    elif contact["friction"] > 0.0:
        at = series_root(motion["v_t"], q, chord["slip"], chord["length"], chord["slip_zeros"])
        _happens(at, SLIP_ZERO, 0.0, chord)
    if chord["spin"] == 0.0:
        for sign in both_signs(moment[0]):
            at = bound_root(load, moment, q, sign, 1.0, chord["length"])
            if at < before:
                _happens(at, SPIN_RELEASED, float(-sign), chord)
    elif chord["tail"]["rolling_arm"] + chord["nose"]["rolling_arm"] > 0.0:
        at = series_root(motion["omega"], q, chord["spin"], chord["length"], chord["spin_zeros"])
        _happens(at, SPIN_ZERO, 0.0, chord)


@kernel
def _find_place_events(slope: Incline, chord: np.void) -> None:
    """Look for the end of the slope, and for where the body turns past an end or the middle of its arc."""
    motion = chord["motion"]
    q, phi = motion["scratch"], motion["phi"]
    if slope.length < math.inf:
        _happens(slope_end(motion["x"], q, slope.length, chord["length"]), SLOPE_ENDS, 0.0, chord)
    for number in range(2):
        side = _side(chord, number)
        sign, on_arc = side["sign"], side["on_arc"] != 0
        edge = -sign * chord["edge"]
        at = level_root(phi, q, sign if on_arc else -sign, edge, chord["length"], side["at_edge"], 0.0)
        _happens(at, FEATURE_ENDS, sign, chord)
        if on_arc:
            at = level_root(phi, q, -sign, -sign * math.pi, chord["length"], 0, 0.0)
            _happens(at, MIDDLE_PASSED, sign, chord)


@kernel
def _sample(limits: Limits, contact: np.void, flight: np.void, chord: np.void, trajectory: np.ndarray) -> None:
    """Add rows over one step, both its ends included: forces may jump between it and the next."""
    motion, length = chord["motion"], chord["length"]
    rows = max(CONTACT_ROWS, math.ceil(length / limits.sample_interval))
    for i in range(rows + 1):
        t = length * (i / rows)
        phi, omega = horner(motion["phi"], t), horner(motion["omega"], t)
        row = next_row(trajectory, flight)
        write_motion(
            row,
            contact["time"] + t,
            horner(motion["x"], t),
            horner(motion["y"], t),
            phi + chord["turns"],
            horner(motion["v_t"], t) - _arms(chord["middle"], phi)[1] * omega,
            horner(motion["v_n"], t),
            omega,
        )
        normal, force, moment = horner(motion["normal"], t), horner(motion["force"], t), horner(motion["moment"], t)
        write_forces(row, normal, force, moment, CHORD_CODE, int(chord["slip"]), int(chord["spin"]))


@kernel
def _integral(series: np.ndarray, t: float) -> float:
    """Integral of the series of a force or power from 0 to ``t``."""
    total = 0.0
    for k in range(ORDER - 1, -1, -1):
        total = total * t + series[k] / (k + 1)
    return total * t


@kernel
def _loss(bound: np.ndarray, velocity: np.ndarray, q: np.ndarray, factor: float, t: float) -> float:
    """Work of ``factor`` times the bound of a friction against its velocity."""
    for k in range(ORDER):
        power = 0.0
        for i in range(k + 1):
            power += bound[i] * velocity[k - i]
        q[k] = factor * power
    return max(_integral(q, t), 0.0)


@kernel
def _advance(contact: np.void, chord: np.void) -> None:
    """Move the body to the end of the step, and add up impulses and losses."""
    motion, tail, nose, t = chord["motion"], chord["tail"], chord["nose"], chord["length"]
    q = motion["scratch"]
    chord["stalled"] = 0 if contact["time"] + t > contact["time"] else chord["stalled"] + 1
    contact["time"] += t
    contact["normal_impulse"] += _integral(motion["normal"], t)
    contact["tangential_impulse"] += _integral(motion["force"], t)
    contact["rolling_impulse"] += _integral(motion["moment"], t)
    if chord["slip"] != 0.0:
        contact["sliding"] += _loss(motion["normal"], motion["v_t"], q, chord["slip"] * contact["friction"], t)
    if chord["spin"] != 0.0:
        contact["rolling"] += _loss(motion["load"], motion["omega"], q, chord["spin"], t)
    chord["x"], chord["y"], chord["phi"] = horner(motion["x"], t), horner(motion["y"], t), horner(motion["phi"], t)
    chord["v_n"], chord["v_t"] = horner(motion["v_n"], t), horner(motion["v_t"], t)
    chord["omega"] = horner(motion["omega"], t)
    eased = 0.0  # one sum of both sides: a mirror image exchanges them
    for side in (tail, nose):
        before = side["gap"]
        leaves = chord["event"] == SEPARATION and chord["event_sign"] == side["sign"]
        side["gap"] = 0.0 if leaves else horner(side["gaps"], t)
        if side["gap_rate"] > 0.0:
            eased += before * before - side["gap"] * side["gap"]
        side["at_edge"] = 0
        if t > 0.0:
            side["zeros"] = 0
    contact["hysteresis"] += 0.5 * (contact["k_closing"] - contact["k_opening"]) * eased
    if t > 0.0:
        chord["slip_zeros"], chord["spin_zeros"], chord["slip_left"], chord["spin_left"] = 0, 0, 0, 0


@kernel
def _turn_back(body: Body, slope: Incline, contact: np.void, chord: np.void) -> bool:
    """Let a side whose gap rate is zero close or open from here on; say whether it can do either, or rests.

    Both sides turn if both gap rates are zero, as after a flat landing.
    """
    tail, nose = chord["tail"], chord["nose"]
    apart = _arms(tail["point"], chord["phi"])[0] - _arms(nose["point"], chord["phi"])[0]
    both = abs(apart * chord["omega"]) <= SAME_RATE * chord["scale"]
    if both:
        chord["omega"] = 0.0
    for side in (tail, nose):
        side["turning"] = 1 if both or side["sign"] == chord["event_sign"] else 0
    gap_rate = 0.0
    for trial in (-1.0, 1.0):
        for side in (tail, nose):
            if side["turning"] != 0:
                _let_move(contact, side, trial)
        _expand(body, slope, contact, chord)
        agrees = True  # every side that turns accelerates as it would have to
        for side in (tail, nose):
            if side["turning"] != 0 and not trial * side["gaps"][2] > 0.0:
                agrees = False
        if agrees:
            gap_rate = trial
    for side in (tail, nose):
        if side["turning"] != 0 and gap_rate != 0.0:
            _let_move(contact, side, gap_rate)
            side["zeros"] = 1
    return gap_rate != 0.0


@kernel
def _handle_event(body: Body, slope: Incline, contact: np.void, chord: np.void) -> int:
    """Do what the event at the end of a step asks for; return the status after it."""
    event, sign = chord["event"], chord["event_sign"]
    if event == NOTHING:
        finite = math.isfinite(chord["y"] + chord["v_n"] + chord["omega"] + chord["v_t"])
        return RUNNING if finite else NON_FINITE
    if event == TIME_ENDS:
        return TIMEOUT
    if event == SEPARATION:
        return ONE_CORNER
    if event == SLOPE_ENDS:
        chord["x"] = slope.length
        return FINISH
    if event == MIDDLE_PASSED:
        return BURIED
    if event in (SLIP_ZERO, SLIP_RELEASED):
        chord["v_t"] = 0.0
        chord["slip_left"] = int(sign)
    elif event in (SPIN_ZERO, SPIN_RELEASED):
        chord["omega"] = 0.0
        chord["spin_left"] = int(sign)
    elif event == FEATURE_ENDS:
        side = chord["tail"] if sign > 0.0 else chord["nose"]
        side["on_arc"], side["at_edge"] = 1 - side["on_arc"], 1
        chord["phi"] = -sign * chord["edge"]
        _set_features(body, contact, chord)
    elif not _turn_back(body, slope, contact, chord):  # RATE_ZERO
        return TUMBLED
    _choose_branch(body, slope, contact, chord)
    return RUNNING


@kernel
def _end(contact: np.void, chord: np.void) -> None:
    """Go back to the coordinates of the side that touches, or of the deeper one."""
    tail, nose, phi, omega = chord["tail"], chord["nose"], chord["phi"], chord["omega"]
    on_tail = tail["gap"] < nose["gap"]
    if tail["gap"] == nose["gap"]:  # flat: the side that came down first, or a mirror image would end on the same side
        on_tail = phi < 0.0 or (phi == 0.0 and chord["tail_first"] != 0)
    side = tail if on_tail else nose
    a, b = _arms(side["point"], phi)
    contact["feature"] = ARC if side["on_arc"] != 0 else (TAIL if on_tail else NOSE)
    contact["x"] = chord["x"]
    contact["phi"] = phi + chord["turns"]
    contact["gap"] = side["gap"]
    contact["v_n"] = chord["v_n"] - a * omega
    contact["v_t"] = chord["v_t"] - (_arms(chord["middle"], phi)[1] - b) * omega
    contact["omega"] = omega
    contact["stored"] = 0.5 * contact["k_closing"] * (min(tail["gap"], 0.0) ** 2 + min(nose["gap"], 0.0) ** 2)


@kernel
def chord_contact(
    body: Body,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    contact: np.void,
    chord: np.void,
    trajectory: np.ndarray,
) -> int:
    """Follow a contact from the moment the second side comes down until one leaves or the body lies on its chord.

    Parameters
    ----------
    body, slope, limits
        See :mod:`sledenv.kernel.params`.
    flight : record of OUTCOME
        Its steps and rows of the trajectory are counted.
    contact : record of CONTACT
        Compliant; that of the feature that came down first, overwritten by that of the one that touches last. Impulses
        and losses are added up.
    chord : record of CHORD
        Work space.
    trajectory : ndarray of TRAJECTORY
        Recorded if it has any rows; see :func:`sledenv.kernel.trajectory.next_row`.

    Returns
    -------
    int
        Status: ONE_CORNER where one side has left, SEPARATED where both have, TUMBLED where a side comes to rest,
        BURIED where both corners are in the slope with the arc between them down.
    """
    if not _begin(body, slope, contact, chord):
        return BURIED
    _choose_branch(body, slope, contact, chord)
    status = RUNNING
    while status == RUNNING:
        if flight["steps"] >= limits.max_steps or chord["stalled"] > MOST_STALLED:
            status = STEP_BUDGET
            break
        flight["steps"] += 1
        _expand(body, slope, contact, chord)
        _bound_step(body, limits, contact, chord)
        if not math.isfinite(chord["length"]):
            status = NON_FINITE
            break
        _find_gap_events(chord)
        _find_friction_events(contact, chord)
        _find_place_events(slope, chord)
        if trajectory.shape[0] > 0 and chord["length"] > 0.0:
            _sample(limits, contact, flight, chord, trajectory)
        _advance(contact, chord)
        status = _handle_event(body, slope, contact, chord)
    _end(contact, chord)
    if status == ONE_CORNER and contact["gap"] >= 0.0:
        return SEPARATED
    return status
