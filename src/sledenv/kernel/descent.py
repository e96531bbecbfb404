"""The loop of a descent: mode, series, first event, what that changes; flight is an empty list of contacts."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel import guards
from sledenv.kernel.advance import advance_contacts, stop_or_release
from sledenv.kernel.air import felt, pulled, write_margin
from sledenv.kernel.arithmetic import sine_cosine, wrap
from sledenv.kernel.books import (
    book_loose_spring,
    book_step,
    close_rebound,
    lost_to_air,
    note_mode,
    open_rebound,
    side_that_lies,
    stored,
)
from sledenv.kernel.candidates import find_new_contacts
from sledenv.kernel.contacts import LEAST_FORCED, ORDER, add, order_last, write_surface
from sledenv.kernel.expansion import expand, longest_step
from sledenv.kernel.features import make_room, pass_on
from sledenv.kernel.geometry import DEEPEST, height_at, heights_within, place, tangent_at, touching_place
from sledenv.kernel.ground import is_rigid
from sledenv.kernel.mode import choose
from sledenv.kernel.params import Incline, Limits
from sledenv.kernel.rebound import put_back, separate, touches_end
from sledenv.kernel.recording import record_end, record_step
from sledenv.kernel.records import (
    BURIED,
    FINISH,
    JAMMED,
    MOST_CONTACTS,
    NON_FINITE,
    RUNNING,
    STEP_BUDGET,
    TIMEOUT,
    TUMBLED,
)
from sledenv.kernel.strike import AGAIN, most_normal, release_or_strike, strike
from sledenv.kernel.zeros import first_zero

MOST_STALLED: Final = 30  # events in a row without any progress in time; then a small step ignores them
GIVEN_UP: Final = 300  # such events with which a descent ends
STEPS_OF_SWINGS: Final = 4000  # in which a descent gets on by as many swings of its springs, or ends:
SWINGS: Final = 4  # bursts of events are no standstill
AT_ONCE: Final = 1e-12  # of the longest step: a step that is not longer is no progress
FASTER: Final = 8.0  # times as long is each small step more in a row, up to LARGEST of a step
LARGEST: Final = 1e-4
FAR: Final = 1e3  # times what is left: how long a step may be that is cut off there
NEAR: Final = 0.3  # sizes that a step of a flight near a profile goes, for few pieces lie under it,
AHEAD: Final = 2.0  # and as far as the body is above all of the profile that lies within so many sizes of it
THIN: Final = 0.05  # of the size: height of the mass centre of a body that lies, below which that is thin
LONG_FLIGHT: Final = -2  # the flight under way is long enough for a trim


@kernel
def take_up(flight: np.void, space: np.void) -> None:
    """Put the body where a flight is, at its launch or at a rebound."""
    motion = space["motion"]
    motion["t"], motion["x"], motion["y"], motion["phi"] = flight["t"], flight["x"], flight["y"], flight["phi"]
    motion["u"], motion["v"], motion["omega"] = flight["u"], flight["v"], flight["omega"]
    motion["sine"], motion["cosine"] = sine_cosine(wrap(motion["phi"]))
    space["contacts"]["count"] = 0
    space["drag"] = flight["drag"]
    space["stalled"], space["forced"], space["frozen"], space["lifted"] = 0, LEAST_FORCED, 0, 0
    space["undecided"] = 1
    space["marked"], space["marked_steps"] = flight["t"], flight["steps"]


@kernel
def _stop(
    body: np.void, pieces: np.ndarray, status: int, flight: np.void, log: np.ndarray, space: np.void, rows: np.ndarray
) -> None:
    """End the descent with a status; a contact that goes on is recorded as a rebound."""
    contacts = space["contacts"]
    flight["status"] = status
    put_back(space, flight)
    flight["stored"] = stored(contacts)
    if contacts["count"] > 0:
        slip = contacts["at"][0]["slip"]
        close_rebound(body, space, slip, flight, log[min(flight["rebounds"], log.shape[0] - 1)])
    if rows.shape[0] > 0:
        record_end(body, pieces, status == JAMMED, space, flight, rows)


@kernel
def _gets_on(body: np.void, flight: np.void, space: np.void) -> bool:
    """Whether so many last steps in contact were together longer than some swings of the body on its stiffest spring.

    A step is some tenth of a swing. Where events follow one another without an end, steps become ever shorter.
    """
    if flight["steps"] - space["marked_steps"] < STEPS_OF_SWINGS:
        return True
    stiffest, contacts = 0.0, space["contacts"]
    for c in range(contacts["count"]):
        stiffest = max(stiffest, contacts["at"][c]["closing"])
    passed = space["motion"]["t"] - space["marked"]
    space["marked"], space["marked_steps"] = space["motion"]["t"], flight["steps"]
    return bool(passed > 0.0 and passed * math.sqrt(stiffest * body["per_mass"]) > SWINGS * 2.0 * math.pi)


@kernel
def _decide(body: np.void, pieces: np.ndarray, slope: Incline, limits: Limits, flight: np.void, space: np.void) -> int:
    """Choose the mode of the contacts, if anything has changed; return the status, RUNNING if the body moves on."""
    contacts = space["contacts"]
    if flight["steps"] >= limits.max_steps or not _gets_on(body, flight, space):
        return STEP_BUDGET
    flight["steps"] += 1
    if space["undecided"] == 0:
        for c in range(contacts["count"]):
            place(body, pieces, space["motion"], contacts["at"][c])
        return RUNNING
    rests = choose(body, pieces, slope, space)
    note_mode(contacts, space["rebound"])
    if contacts["count"] > 1:
        side = side_that_lies(body, contacts)
        if side != 0.0 and space["rebound"]["side"] == 0.0:
            space["rebound"]["side"] = side
        settled = contacts["spin_still"] != 0 or (
            contacts["at"][0]["gap_still"] != 0 and contacts["at"][1]["gap_still"] != 0
        )
        if side != 0.0 and settled and contacts["at"][0]["gap_still"] != 0:
            if flight["t_on_chord"] == math.inf:
                flight["t_on_chord"], flight["x_on_chord"] = space["motion"]["t"], space["motion"]["x"]
            if limits.end_on_chord != 0.0 and not rests:
                return TUMBLED
    return JAMMED if rests else RUNNING


@kernel
def _is_buried(body: np.void, pieces: np.ndarray, space: np.void) -> bool:
    """Whether a point of the body is deeper in a profile than contacts may be pressed, or its mass centre is under it.

    The mass centre of a thin body comes as near to the ground as its springs let: it may be under it by a little. On a
    plane springs may be pressed as deep as they are: there it is one line that bounds the ground.
    """
    if pieces.shape[0] == 1:
        return False
    motion, contacts, size = space["motion"], space["contacts"], body["size"]
    for c in range(contacts["count"]):
        contact = contacts["at"][c]
        if contact["depth_offset"] - contact["gap"] > DEEPEST * size:
            x, y = touching_place(motion, contact)  # of a crest far behind a side it may be hardly in the ground
            if height_at(pieces, x) - y > DEEPEST * size:
                return True
    above = motion["y"] - height_at(pieces, motion["x"])
    return bool(above < -max(THIN * size - body["lowest"], 0.0))


@kernel
def _longest_flight(pieces: np.ndarray, slope: Incline, motion: np.void, size: float) -> float:
    """How long [s] a step of a flight may be: until the body is below the plane, and over a profile not far."""
    longest, v = math.inf, motion["v"]
    if slope.inward > 0.0:
        square = v * v + 2.0 * slope.inward * (max(motion["y"], 0.0) + size)
        longest = (max(v, 0.0) + math.sqrt(square)) / slope.inward
    if pieces.shape[0] > 1:
        above = motion["y"] - size - heights_within(pieces, motion["x"], (1.0 + AHEAD) * size)[1]
        speed = abs(motion["u"]) + abs(v) + math.sqrt(size * slope.gravity)
        longest = min(longest, max(NEAR * size, min(AHEAD * size, above)) / speed)
    return float(longest)


@kernel
def _find_event(
    body: np.void, pieces: np.ndarray, slope: Incline, air: Incline, limits: Limits, space: np.void
) -> None:
    """Find how long the step is, and what ends it; ``air`` is the slope with the drag that is felt."""
    event, motion, size = space["event"], space["motion"], body["size"]
    longest = longest_step(body, air, limits.tolerance, space)
    left = limits.max_time - motion["t"]
    if space["contacts"]["count"] == 0:
        longest = min(longest, _longest_flight(pieces, slope, motion, size))
    elif pieces.shape[0] > 1:  # it is seen when a body is buried
        for c in range(space["contacts"]["count"]):
            closing = -space["contacts"]["at"][c]["gap_rate"]
            if closing > 0.0:
                longest = min(longest, DEEPEST * size / closing)
    event["code"], event["time"] = guards.NOTHING, longest if longest < FAR * left else left
    s = space["series"]
    if slope.drag > 0.0:
        write_margin(slope, air.drag > 0.0, s, space["poly"])
        if space["poly"][0] > 0.0:  # without gravity nothing is too faint but a body at rest
            event["time"] = min(event["time"], first_zero(space["poly"], event["time"], 0, space["stack"]))
    event["longest"] = event["time"]
    last = s["x"][ORDER] + s["y"][ORDER] + s["sine"][ORDER] + s["cosine"][ORDER] + s["omega"][ORDER]
    if not longest > 0.0 or not math.isfinite(last):
        event["time"] = math.nan
        return
    if space["stalled"] > MOST_STALLED:
        fast = abs(motion["u"]) + abs(motion["v"]) + size * abs(motion["omega"]) + math.sqrt(size * slope.gravity)
        event["time"] = min(event["time"], size / fast) * space["forced"]
        space["forced"] = min(space["forced"] * FASTER, LARGEST)
    else:
        guards.watch_contacts(body, pieces, space)
        find_new_contacts(body, pieces, space)
        guards.watch_finish(space)
    if event["time"] >= left:  # cut off only now: what is found before does not depend on when the time is over
        event["code"], event["time"] = guards.NOTHING, left


@kernel
def _write_motion(s: np.void, t: float, motion: np.void) -> None:
    """Write the values of all series of the body at a time of the step, in one loop: no sum waits for another."""
    x = y = phi = u = v = omega = sine = cosine = 0.0
    for k in range(ORDER, -1, -1):
        x, y, phi = x * t + s["x"][k], y * t + s["y"][k], phi * t + s["phi"][k]
        u, v, omega = u * t + s["u"][k], v * t + s["v"][k], omega * t + s["omega"][k]
        sine, cosine = sine * t + s["sine"][k], cosine * t + s["cosine"][k]
    motion["x"], motion["y"], motion["phi"], motion["u"], motion["v"], motion["omega"] = x, y, phi, u, v, omega
    length = 1.5 - 0.5 * (sine * sine + cosine * cosine)
    motion["sine"], motion["cosine"] = sine * length, cosine * length


@kernel
def _move(body: np.void, slope: Incline, space: np.void) -> bool:
    """Go to the end of the step; return whether the mode is to be chosen anew, but for the event there."""
    motion, contacts, s, t = space["motion"], space["contacts"], space["series"], space["event"]["time"]
    if not motion["t"] + t > motion["t"]:
        space["stalled"] += 1
        space["event"]["time"] = 0.0
        return bool(space["undecided"] != 0)
    if not t > AT_ONCE * space["event"]["longest"]:
        space["stalled"] += 1
    else:
        if space["stalled"] <= MOST_STALLED:
            space["forced"] = LEAST_FORCED
        space["stalled"] = 0
    space["lifted"] = 0
    motion["t"] += t
    space["drag"] += lost_to_air(body, slope, s, t)
    _write_motion(s, t, motion)
    if contacts["count"] == 0:
        motion["sine"], motion["cosine"] = sine_cosine(wrap(motion["phi"]))
        return False
    book_step(space, t)
    return advance_contacts(body, t, space)


@kernel
def _begin_contact(
    body: np.void, pieces: np.ndarray, slope: Incline, limits: Limits, flight: np.void, log: np.ndarray, space: np.void
) -> int:
    """Add the pair that has come to touch to the contacts; return the status."""
    contacts, event = space["contacts"], space["event"]
    if contacts["count"] == MOST_CONTACTS and not make_room(body, pieces, contacts):
        return BURIED
    add(body, pieces, space, event["who"], event["side"], event["piece"])
    contact = contacts["at"][contacts["count"] - 1]
    motion = space["motion"]
    fast = max(abs(motion["u"]), abs(motion["v"]), body["size"] * abs(motion["omega"]))
    begins, rigid = contacts["count"] == 1, is_rigid(space["ground"])
    # Rigid surfaces that touch although they open have parted too slowly for any time to pass.
    if abs(contact["gap_rate"]) < guards.STILL * fast or (rigid and contact["gap_rate"] > 0.0):
        contact["gap_rate"] = 0.0
    if begins:
        contacts["spin_sign"] = contacts["spin_still"] = contacts["spin_left"] = 0
        open_rebound(body, motion, contact, space["rebound"])
        space["strikes"] = 0
    if (begins or not rigid) and touches_end(body, limits, space):
        return TUMBLED
    if not rigid:
        order_last(contacts)
        return RUNNING
    if begins:
        space["rebound"]["peak_force"] = math.inf
    return strike(body, pieces, slope, limits, False, flight, log, space)


@kernel
def _pass_finish(pieces: np.ndarray, limits: Limits, flight: np.void, space: np.void) -> int:
    """Pass the end of the slope, behind which the run-out begins, or that of the run-out; return the status.

    The speed there is that along the ground under the mass centre.
    """
    motion = space["motion"]
    motion["x"] = space["finish"]
    if flight["t_line"] < math.inf:
        return FINISH
    along, up = tangent_at(pieces, motion["x"])
    flight["t_line"], flight["u_line"] = motion["t"], along * motion["u"] + up * motion["v"]
    space["finish"] += limits.run_out
    return RUNNING if limits.run_out > 0.0 else FINISH


@kernel
def _apply(
    body: np.void, pieces: np.ndarray, slope: Incline, limits: Limits, flight: np.void, log: np.ndarray, space: np.void
) -> int:
    """Change what the event at the end of a step changes; return the status, RUNNING if the descent goes on."""
    contacts, event, motion = space["contacts"], space["event"], space["motion"]
    code, side = event["code"], event["side"]
    if code == guards.NOTHING:
        moved = motion["x"] + motion["y"] + motion["phi"] + motion["u"] + motion["v"] + motion["omega"]
        if not math.isfinite(moved):
            return NON_FINITE
        return TIMEOUT if motion["t"] >= limits.max_time else RUNNING
    if code == guards.FINISH:
        return _pass_finish(pieces, limits, flight, space)
    space["undecided"] = 1
    if code == guards.TOUCH:
        return _begin_contact(body, pieces, slope, limits, flight, log, space)
    if code == guards.SEPARATION or (code == guards.GAP_FREE and is_rigid(space["ground"])):
        return separate(body, pieces, limits, event["who"], flight, log, space)
    if code == guards.FEATURE:
        if pass_on(body, pieces, space, event["who"], side):
            return RUNNING
        book_loose_spring(contacts["at"][event["who"]], space["rebound"])
        return separate(body, pieces, limits, event["who"], flight, log, space)
    if code == guards.ZONE:
        contact = contacts["at"][event["who"]]
        contact["zone"] += side
        write_surface(body, space["ground"], contact)
        return RUNNING
    stop_or_release(space)
    return RUNNING


@kernel
def _is_to_be_trimmed(limits: Limits, flight: np.void, space: np.void) -> bool:
    """Whether a flight that nobody has decided about lasts long enough, now that its next event is known.

    Behind the end of the slope nothing is decided any more.
    """
    if space["waits"] == 0 or flight["t_line"] < math.inf:
        return False
    return bool(space["motion"]["t"] - flight["t"] + space["event"]["time"] >= limits.shortest_flight)


@kernel
def _step(
    body: np.void,
    pieces: np.ndarray,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    log: np.ndarray,
    space: np.void,
    rows: np.ndarray,
) -> int:
    """One turn of the loop: mode, series, first event, motion up to it, what it changes. Return the status."""
    contacts, event, rigid = space["contacts"], space["event"], is_rigid(space["ground"])
    if space["stalled"] > GIVEN_UP:
        return STEP_BUDGET
    status, air = RUNNING, felt(slope, space["motion"])
    pull = pulled(air, space["motion"])
    if contacts["count"] > 0:
        status = _decide(body, pieces, pull, limits, flight, space)
    if status in (RUNNING, JAMMED) and _is_buried(body, pieces, space):
        return BURIED
    if contacts["count"] > 0:
        if status == RUNNING and rigid and space["undecided"] != 0:
            status = release_or_strike(body, pieces, pull, limits, flight, log, space)
        if status != RUNNING:
            return RUNNING if status == AGAIN else status
    expand(body, air, space)
    if rigid and contacts["count"] == 1:
        load = space["series"]["of"][0]["normal"][0]
        if not 0.0 <= load <= most_normal(body, slope, space["rebound"]):
            return strike(body, pieces, pull, limits, True, flight, log, space)
    _find_event(body, pieces, slope, air, limits, space)
    if not event["time"] < math.inf:
        return NON_FINITE
    if contacts["count"] == 0 and _is_to_be_trimmed(limits, flight, space):
        return LONG_FLIGHT
    if rows.shape[0] > 0 and event["time"] > 0.0:
        record_step(body, pieces, air, limits, event["time"], space, flight, rows)
    forced = space["stalled"] > MOST_STALLED
    passed = _move(body, air, space)
    space["undecided"] = 1 if passed or forced else 0
    pull = pulled(felt(slope, space["motion"]), space["motion"])
    return _apply(body, pieces, pull, limits, flight, log, space)


@kernel
def descend(
    body: np.void,
    pieces: np.ndarray,
    slope: Incline,
    limits: Limits,
    flight: np.void,
    log: np.ndarray,
    space: np.void,
    rows: np.ndarray,
) -> bool:
    """Follow a descent to its end, or to the next long flight if ``space["once"]`` is 1; return whether that is done.

    It is not done if ``space["work"]`` reaches ``space["most_work"]`` before. The same call then goes on where this one
    has stopped.

    Parameters
    ----------
    body : record of BODY
    pieces : ndarray of PIECE
        The ground, see :func:`sledenv.kernel.geometry.build_pieces`.
    slope : Incline
    limits : Limits
    flight : record of OUTCOME
        State of the descent, at its launch or at a rebound, with status RUNNING. It is moved on; ``close_books`` writes
        its ledger.
    log : ndarray of REBOUND
        A rebound fills the row of its number, or the last row if there are fewer, and makes ``flight["rebounds"]``
        larger by one. The descent ends with status LOG_FULL at ``limits.max_rebounds``.
    space : record of SPACE
        Work space.
    rows : ndarray of TRAJECTORY
        Rows are written while there is room; ``flight["samples"]`` says how many were needed.
    """
    if space["begun"] == 0:
        take_up(flight, space)
        space["finish"] = slope.length + (limits.run_out if flight["t_line"] < math.inf else 0.0)
        space["begun"] = 1
    before = flight["rebounds"]
    while flight["status"] == RUNNING:
        if space["work"] >= space["most_work"]:
            return False
        space["work"] += 1
        status = _step(body, pieces, slope, limits, flight, log, space, rows)
        if status == LONG_FLIGHT:  # back to where it begins
            flight["samples"] = space["samples"]
            break
        if status != RUNNING:
            _stop(body, pieces, status, flight, log, space, rows)
        elif space["once"] != 0 and flight["rebounds"] > before:
            if limits.shortest_flight == 0.0:
                break
            before, space["waits"], space["samples"] = flight["rebounds"], 1, flight["samples"]
    space["begun"] = 0
    return True
