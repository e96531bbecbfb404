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

import numpy as np

from sledenv.kernel import events, normal, progress, records
from sledenv.kernel.friction import Bounds, Branch, Drive, Mobility, resolve
from sledenv.kernel.geometry import corner_lengths
from sledenv.kernel.jit import kernel
from sledenv.kernel.params import Body, Incline, Limits
from sledenv.kernel.roots import first_root, horner
from sledenv.kernel.rows import TERMS
from sledenv.kernel.series import ORDER
from sledenv.kernel.trajectory import CONTACT_ROWS, next_row, write_forces, write_motion

SAME_RATE = 1e-12  # of the speed scale: gap rates of the two sides that are equal but for rounding
TOUCHING = 1e-9  # of the size: gap of the second side where it starts to touch
UNIT_ANGLE = 1.4  # of the fastest contact oscillation in the longest step


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
    # A friction without a force never stops a velocity. Nothing else is known beforehand.
    chord["step"]["safe_v_t"] = 0.0 if contact["friction"] > 0.0 else 1.0
    chord["step"]["safe_omega"] = 0.0 if tail["rolling_arm"] + nose["rolling_arm"] > 0.0 else 1.0


@kernel
def _let_move(contact: np.void, side: np.void, gap_rate: float) -> None:
    """Let the gap of a side close (-1) or open (1)."""
    side["gap_rate"] = gap_rate
    side["stiffness"] = normal.stiffness(gap_rate < 0.0, contact)


@kernel
def _begin(body: Body, slope: Incline, contact: np.void, chord: np.void) -> bool:
    """Take over the contact of one side and add the other; say whether that touches too."""
    size = contact["size"]
    started = int(contact["feature"])
    turns = math.pi * (2.0 * math.floor(contact["phi"] / (2.0 * math.pi)) + 1.0)
    phi, omega = contact["phi"] - turns, contact["omega"]
    tail_first = started == records.TAIL or (started == records.ARC and phi < 0.0)
    chord["tail_first"] = 1 if tail_first else 0
    tail, nose = chord["tail"], chord["nose"]
    tail["sign"], nose["sign"] = 1.0, -1.0
    first, second = _side(chord, 0), _side(chord, 1)
    first["on_arc"], second["on_arc"] = 1 if started == records.ARC else 0, 0
    _set_features(body, contact, chord)
    a, b = _arms(first["point"], phi)
    _, b_second = _arms(second["point"], phi)
    # Of two corners the difference of the arms suffers no cancellation.
    _, half = corner_lengths(body)
    gap = contact["gap"] + (b - b_second if started == records.ARC else -2.0 * first["sign"] * half * math.sin(phi))
    if abs(gap) > TOUCHING * size:
        return False
    first["gap"], second["gap"] = contact["gap"], min(gap, 0.0)

    v_n = contact["v_n"] + a * omega
    v_t = contact["v_t"] + (_arms(chord["middle"], phi)[1] - b) * omega
    if abs(v_t) <= 1e-15 * (abs(contact["v_t"]) + size * abs(omega)):
        v_t = 0.0
    contact["phi"], contact["turns"], contact["v_t"] = phi, turns, v_t
    chord["y"], chord["v"] = contact["gap"] + b, v_n
    for side in (tail, nose):
        _let_move(contact, side, 1.0 if v_n - _arms(side["point"], phi)[0] * omega > 0.0 else -1.0)
        side["zeros"], side["at_edge"], side["turning"] = 0, 0, 0
    progress.forget_branch(contact)
    contact["scale"] = progress.speed_scale(slope, size, v_n, v_t, omega)
    softness = 2.0 / body.mass + 2.0 * size**2 * (1.0 + contact["friction"]) / body.inertia
    chord["longest"] = UNIT_ANGLE / math.sqrt(normal.stiffness(True, contact) * softness)
    chord["edge"] = math.pi - body.half_angle
    chord["step"]["unit"] = 1.0
    return True


@kernel
def _load(side: np.void, contact: np.void, chord: np.void) -> float:
    """Load [m] of a side."""
    rate = chord["v"] - _arms(side["point"], contact["phi"])[0] * contact["omega"]
    return float(normal.load_at(contact, side["gap"], rate))


@kernel
def _choose_branch(body: Body, slope: Incline, contact: np.void, chord: np.void) -> None:
    """Choose what slip and spin do from here on.

    For the box rule the two normal forces act as their sum, at the arm of their resultant.
    """
    tail, nose, phi, omega = chord["tail"], chord["nose"], contact["phi"], contact["omega"]
    size = contact["size"]
    shallow = progress.NO_DEPTH * size
    deep_1, deep_2 = -_load(tail, contact, chord), -_load(nose, contact, chord)
    depth_1, depth_2 = max(deep_1, shallow), max(deep_2, shallow)
    deepest = max(deep_1, deep_2)
    if min(deep_1, deep_2) > 0.0 and deepest < shallow:
        lift = shallow / deepest  # both are loaded: their ratio counts
        depth_1, depth_2 = deep_1 * lift, deep_2 * lift
    n_1, n_2 = tail["stiffness"] * depth_1, nose["stiffness"] * depth_2
    push = n_1 + n_2
    lever = (_arms(tail["point"], phi)[0] * n_1 + _arms(nose["point"], phi)[0] * n_2) / push
    arm = (tail["rolling_arm"] * n_1 + nose["rolling_arm"] * n_2) / push
    a, b = _arms(chord["middle"], phi)
    signs = Branch(
        -1,  # of neither side: the normal force is given, whichever way the gaps move
        progress.signs_of(contact["v_t"], contact["slip_left"]),
        progress.signs_of(omega, contact["spin_left"]),
    )
    chosen = resolve(
        Mobility(1.0 / body.mass, 1.0 / body.inertia, lever, b),
        Drive(slope.downhill + a * omega * omega, -slope.inward),
        contact["friction"],
        arm,
        size,
        Bounds(push, push),
        signs,
    )
    # A friction without a force has no surface to stay on: its velocity passes zero freely.
    slip = 1 if contact["friction"] == 0.0 else chosen.slip
    spin = 1 if arm == 0.0 else chosen.spin
    progress.take_branch(Branch(0, slip, spin), contact)


@kernel
def _expand(body: Body, slope: Incline, contact: np.void, chord: np.void) -> None:
    """Write the series of one step: docs/physics.md (8.4)."""
    step, tail, nose, middle = chord["step"], chord["tail"], chord["nose"], chord["middle"]
    x, y, phi, gap_1, gap_2 = step["x"], chord["height"], step["phi"], tail["gaps"], nose["gaps"]
    v_n, v_t, omega, speed = step["v_n"], step["v_t"], step["omega"], chord["speed"]
    sines, cosines = step["sines"], step["cosines"]
    pull_sine, pull_cosine = chord["pull_sine"], chord["pull_cosine"]
    along_1, across_1 = tail["point"]["along"], tail["point"]["across"]
    along_2, across_2 = nose["point"]["along"], nose["point"]["across"]
    along, across, radius = middle["along"], middle["across"], middle["radius"]
    stiffness_1, arm_1 = tail["stiffness"], tail["rolling_arm"]
    stiffness_2, arm_2 = nose["stiffness"], nose["rolling_arm"]
    m, friction, slip, spin = body.mass, contact["friction"], contact["slip"], contact["spin"]
    x[0], y[0], phi[0], gap_1[0], gap_2[0] = contact["x"], chord["y"], contact["phi"], tail["gap"], nose["gap"]
    v_n[0], v_t[0], omega[0] = chord["v"], contact["v_t"], contact["omega"]
    sines[0], cosines[0] = math.sin(contact["phi"]), math.cos(contact["phi"])
    arm = radius + along * cosines[0] - across * sines[0]
    speed[0] = v_t[0] - arm * omega[0]
    tilt, lever = sines[0] * omega[0], cosines[0] * omega[0]  # products of sine and cosine with the spin
    for k in range(ORDER):
        after = 1.0 / (k + 1)
        weight, drive = (slope.inward, slope.downhill) if k == 0 else (0.0, 0.0)
        rate_1 = v_n[k] + along_1 * tilt + across_1 * lever
        rate_2 = v_n[k] + along_2 * tilt + across_2 * lever
        gap_1[k + 1], gap_2[k + 1] = rate_1 * after, rate_2 * after
        n_1 = -stiffness_1 * normal.load_at(contact, gap_1[k], rate_1)
        n_2 = -stiffness_2 * normal.load_at(contact, gap_2[k], rate_2)
        push, load = n_1 + n_2, arm_1 * n_1 + arm_2 * n_2
        step["normal"][k], chord["load"][k] = push, load
        x[k + 1], y[k + 1], phi[k + 1] = speed[k] * after, v_n[k] * after, omega[k] * after
        sines[k + 1], cosines[k + 1] = lever * after, -tilt * after
        v_n[k + 1] = (push / m - weight) * after
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
        force = -slip * friction * push
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
        step["force"][k], step["moment"][k] = force, moment
        pull_sine[k] -= across * force
        pull_cosine[k] += along * force
        omega[k + 1] = spin_rate * after
        speed[k + 1] = (force / m + drive) * after
        tilt += sines[0] * omega[k + 1]
        lever += cosines[0] * omega[k + 1]
        v_t[k + 1] = 0.0 if slip == 0.0 else speed[k + 1] + radius * omega[k + 1] + along * lever - across * tilt


@kernel
def _happens(at: float, event: int, sign: float, chord: np.void) -> None:
    """Let the step end with an event of one side, if there is one."""
    if events.happens(at, event, chord["step"]):
        chord["event_sign"] = sign


@kernel
def _gap_events(contact: np.void, chord: np.void) -> None:
    """Look for where the gap of a side turns, and for where the side leaves."""
    step = chord["step"]
    q = step["scratch"]
    for number in range(2):
        side = _side(chord, number)
        gaps, sign, gap_rate = side["gaps"], side["sign"], side["gap_rate"]
        for k in range(ORDER):
            q[k] = gap_rate * (k + 1) * gaps[k + 1]
        q[ORDER:] = 0.0
        _happens(first_root(q, step["length"], side["zeros"], 0.0), events.RATE_ZERO, sign, chord)
        if gap_rate > 0.0:
            for k in range(TERMS):
                q[k] = -normal.load_at(contact, gaps[k], (k + 1) * gaps[k + 1])
            q[TERMS:] = 0.0
            _happens(first_root(q, step["length"], 0, 0.0), events.SEPARATION, sign, chord)


@kernel
def _place_events(contact: np.void, chord: np.void) -> None:
    """Look for the end of the slope, and for where the body turns past an end or the middle of its arc."""
    step = chord["step"]
    q, phi = step["scratch"], step["phi"]
    if contact["length"] < math.inf:
        at = events.slope_end(step["x"], q, contact["length"], step["length"])
        events.happens(at, events.SLOPE_ENDS, step)
    for number in range(2):
        side = _side(chord, number)
        sign, on_arc = side["sign"], side["on_arc"] != 0
        edge = -sign * chord["edge"]
        at = events.level_root(phi, q, sign if on_arc else -sign, edge, step["length"], side["at_edge"], 0.0)
        _happens(at, events.FEATURE_ENDS, sign, chord)
        if on_arc:
            at = events.level_root(phi, q, -sign, -sign * math.pi, step["length"], 0, 0.0)
            _happens(at, events.MIDDLE_PASSED, sign, chord)


@kernel
def _sample(limits: Limits, contact: np.void, flight: np.void, chord: np.void, trajectory: np.ndarray) -> None:
    """Add rows over one step, both its ends included: forces may jump between it and the next."""
    step = chord["step"]
    length = step["length"]
    rows = max(CONTACT_ROWS, math.ceil(length / limits.sample_interval))
    for i in range(rows + 1):
        t = length * (i / rows)
        phi, omega = horner(step["phi"], t), horner(step["omega"], t)
        row = next_row(trajectory, flight)
        write_motion(
            row,
            contact["time"] + t,
            horner(step["x"], t),
            horner(chord["height"], t),
            phi + contact["turns"],
            horner(step["v_t"], t) - _arms(chord["middle"], phi)[1] * omega,
            horner(step["v_n"], t),
            omega,
        )
        push, force, moment = horner(step["normal"], t), horner(step["force"], t), horner(step["moment"], t)
        write_forces(row, push, force, moment, records.CHORD, int(contact["slip"]), int(contact["spin"]))


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
    step, tail, nose = chord["step"], chord["tail"], chord["nose"]
    q, t, before = step["scratch"], step["length"], contact["time"]
    contact["time"] += t
    contact["normal_impulse"] += _integral(step["normal"], t)
    contact["tangential_impulse"] += _integral(step["force"], t)
    contact["rolling_impulse"] += _integral(step["moment"], t)
    if contact["slip"] != 0.0:
        contact["sliding"] += _loss(step["normal"], step["v_t"], q, contact["slip"] * contact["friction"], t)
    if contact["spin"] != 0.0:
        contact["rolling"] += _loss(chord["load"], step["omega"], q, contact["spin"], t)
    contact["x"], contact["phi"] = horner(step["x"], t), horner(step["phi"], t)
    contact["v_t"], contact["omega"] = horner(step["v_t"], t), horner(step["omega"], t)
    chord["y"], chord["v"] = horner(chord["height"], t), horner(step["v_n"], t)
    passes = progress.time_passes(before, contact, step)
    eased = 0.0  # one sum of both sides: a mirror image exchanges them
    for side in (tail, nose):
        gap = side["gap"]
        leaves = step["event"] == events.SEPARATION and chord["event_sign"] == side["sign"]
        side["gap"] = 0.0 if leaves else horner(side["gaps"], t)
        if side["gap_rate"] > 0.0:
            eased += gap * gap - side["gap"] * side["gap"]
        side["at_edge"] = 0
        if passes:
            side["zeros"] = 0
    contact["hysteresis"] += normal.per_square(contact)[1] * eased


@kernel
def _turn_back(body: Body, slope: Incline, contact: np.void, chord: np.void) -> bool:
    """Let a side whose gap rate is zero close or open from here on; say whether it can do either, or rests.

    Both sides turn if both gap rates are zero, as after a flat landing.
    """
    tail, nose = chord["tail"], chord["nose"]
    apart = _arms(tail["point"], contact["phi"])[0] - _arms(nose["point"], contact["phi"])[0]
    both = abs(apart * contact["omega"]) <= SAME_RATE * contact["scale"]
    if both:
        contact["omega"] = 0.0
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
    step, sign = chord["step"], chord["event_sign"]
    event = int(step["event"])
    if event == events.NOTHING:
        finite = math.isfinite(chord["y"] + chord["v"] + contact["omega"] + contact["v_t"])
        return records.RUNNING if finite else records.NON_FINITE
    if event == events.SEPARATION:
        return records.ONE_CORNER
    if event == events.SLOPE_ENDS:
        contact["x"] = contact["length"]
        return records.FINISH
    if event == events.MIDDLE_PASSED:
        return records.BURIED
    if event == events.FEATURE_ENDS:
        side = chord["tail"] if sign > 0.0 else chord["nose"]
        side["on_arc"], side["at_edge"] = 1 - side["on_arc"], 1
        contact["phi"] = -sign * chord["edge"]
        _set_features(body, contact, chord)
    elif event != events.RATE_ZERO:
        progress.stop_or_release(contact, step)
    elif not _turn_back(body, slope, contact, chord):
        return records.TUMBLED
    _choose_branch(body, slope, contact, chord)
    return records.RUNNING


@kernel
def _end(contact: np.void, chord: np.void) -> None:
    """Go back to the coordinates of the side that touches, or of the deeper one."""
    tail, nose, phi, omega = chord["tail"], chord["nose"], contact["phi"], contact["omega"]
    on_tail = tail["gap"] < nose["gap"]
    if tail["gap"] == nose["gap"]:  # flat: the side that came down first, or a mirror image would end on the same side
        on_tail = phi < 0.0 or (phi == 0.0 and chord["tail_first"] != 0)
    side = tail if on_tail else nose
    a, b = _arms(side["point"], phi)
    contact["feature"] = records.ARC if side["on_arc"] != 0 else (records.TAIL if on_tail else records.NOSE)
    contact["phi"] = phi + contact["turns"]
    contact["gap"] = side["gap"]
    contact["v_n"] = chord["v"] - a * omega
    contact["v_t"] -= (_arms(chord["middle"], phi)[1] - b) * omega
    contact["stored"] = normal.per_square(contact)[0] * (min(tail["gap"], 0.0) ** 2 + min(nose["gap"], 0.0) ** 2)


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
        return records.BURIED
    step = chord["step"]
    _choose_branch(body, slope, contact, chord)
    status = records.RUNNING
    while status == records.RUNNING:
        if flight["steps"] >= limits.max_steps or contact["stalled"] > progress.MOST_STALLED:
            status = records.STEP_BUDGET
            break
        flight["steps"] += 1
        _expand(body, slope, contact, chord)
        bounded = progress.bound_step(limits, chord["longest"], contact, step)
        if bounded == records.NON_FINITE:
            status = bounded
            break
        step["event"] = events.NOTHING
        _gap_events(contact, chord)
        events.friction_events(contact, step, chord["load"], 1.0)
        _place_events(contact, chord)
        if trajectory.shape[0] > 0 and step["length"] > 0.0:
            _sample(limits, contact, flight, chord, trajectory)
        _advance(contact, chord)
        status = _handle_event(body, slope, contact, chord)
        if step["event"] == events.NOTHING and bounded == records.TIMEOUT:
            status = bounded
    _end(contact, chord)
    if status == records.ONE_CORNER and contact["gap"] >= 0.0:
        return records.SEPARATED
    return status
