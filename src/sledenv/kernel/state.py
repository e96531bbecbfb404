"""What a descent works on while it runs, as records with named fields: a contact, a step of it, a flight, an impact.

In a kernel a field is ``step["length"]``, in a straight-line program (:mod:`sledenv.compiler.trace`) ``step.length``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from sledenv.compiler.rows import WIDTH
from sledenv.compiler.values import nearest
from sledenv.kernel import normal
from sledenv.kernel.params import Incline, State
from sledenv.kernel.records import CONTACT_LOSSES, LOSSES

# A generator of random numbers (Park and Miller) mixes the codes of a sequence: whole numbers, exact in a double.
_MIX, _PRIME = 48271.0, 2147483647.0
_LINE = 64  # bytes of cache


def record(*fields: tuple[Any, ...]) -> np.dtype:
    """Type of a record that fills whole lines of cache: no vector of eight numbers then lies across two of them."""
    size = np.dtype(list(fields)).itemsize
    filling = (-size % _LINE) // 8  # numbers
    return np.dtype([*fields, ("filling", "f8", (filling,))] if filling else list(fields))


def new(record: np.dtype, count: int = 1) -> np.ndarray:
    """Return zeroed records, shape (count,), the first of which begins at a line of cache."""
    size = count * record.itemsize
    room = np.zeros(size + _LINE, np.uint8)
    first = -room.ctypes.data % _LINE
    return np.ndarray(count, record, room, first)  # a view would examine every field of the type


MOTION: Final = ("t", *State._fields)  # where a body is, and how it moves
IMPULSES: Final = (
    "normal_impulse",  # [N s]
    "tangential_impulse",  # [N s]
    "rolling_impulse",  # [N m s]
)
SUMS: Final = (*IMPULSES, *CONTACT_LOSSES)  # impulses, and losses [J]
PEAKS: Final = (
    "peak_force",  # [N] largest normal force
    "peak_penetration",  # [m]
)
# Phases of a search. POISED: on the surface without a gap rate, to be looked at by itself.
FALLING, SEARCHING, LANDED, POISED = -1.0, 0.0, 1.0, 2.0
SEARCH: Final = (  # for the touchdown; times are counted from the start of the flight
    "horizon",  # [s] a later touchdown is of no interest
    "phase",  # of the search
    "touchdown",  # [s] reached so far; in the end that of the touchdown, inf if there is none
    "bound",  # [m/s^2] the gap never accelerates more than this towards the slope
    "noise",  # [m] rounding error of the gap
    "kink",  # [rad] angle from the start to the first straight side that the body may land on; inf if there is none
    "margin",  # of the speeds: smaller gap rates do not show whether the body lifts off
    "in_reach",  # [s] from when on the body is in reach of the slope
    "clear",  # [s] up to which the gap is known to be open
    "last_step",  # [s] length of the step before
    "root",  # [s] a root of the gap,
    "alone_from",  # [s] and from when on there is no other before it
)

# What comes next in a descent: the start of a flight, or the rest of the search for its touchdown.
TAKING_OFF, SEEKING = range(2)

# A contact: what the body has in common for all its points. The coordinates are its own: a locked velocity is exactly
# zero, and gaps do not suffer from cancellation.
CONTACT: Final = record(
    ("time", "f8"),  # [s] since the launch
    ("x", "f8"),  # [m] of the mass centre
    ("phi", "f8"),  # [rad] orientation, less
    ("turns", "f8"),  # [rad] these
    ("omega", "f8"),  # [rad/s] spin
    ("count", "f8"),  # of points, 1 or 2
    *((name, "f8") for name in SUMS),  # what the contact adds up
    *((name, "f8") for name in PEAKS),
    ("held", "f8"),  # 1 once the contact has ended: the forces of its last step are then those at its end
    ("side_touched", "f8"),  # code of the first straight side that touched with both its ends, 0 if none has
    ("undecided", "f8"),  # 1 if the branch is to be chosen
    ("sequence", "f8"),  # code of the branches so far, see :func:`followed_by`,
    ("branch", "f8"),  # and of the last one
    ("spin", "f8"),  # sign of omega from here on, 0 where it is locked
    ("spin_zeros", "f8"),  # leading coefficients of omega that are zero by construction
    ("spin_left", "f8"),  # sign with which it has just been released, or 0
    ("stalled", "f8"),  # events in a row without any progress in time
    # Body, slope and law.
    ("per_mass", "f8"),  # [1/kg]
    ("ratio", "f8"),  # [1/m^2] mass over inertia
    ("size", "f8"),  # [m] of the body
    ("inward", "f8"),  # [m/s^2] gravity along the inward normal
    ("downhill", "f8"),  # [m/s^2] and along the slope
    *normal.FIELDS,
    ("scale", "f8"),  # [m/s] of the velocities
)

# A point of a contact: an arc that touches.
POINT: Final = record(
    ("arc", "f8"),  # its place in the outline. Its lowest point lies at (-a, -b) from the mass centre:
    ("h", "f8"),  # [m] a = h sin(phi + shift),
    ("r", "f8"),  # [m] b = r - h cos(phi + shift)
    ("shift", "f8"),  # [rad]
    ("turn", "f8"),  # [rad] what the orientation of the contact exceeds the interval of the arc by: 0, or a whole turn
    ("piece", "f8"),  # of the ground, on which it touches; there is
    ("friction", "f8"),  # [-]
    ("arm", "f8"),  # [m] and the arm of its rolling resistance
    ("yielding", "f8"),  # [1/kg] largest mobility
    ("gap", "f8"),  # [m] between arc and slope
    ("v_n", "f8"),  # [m/s] gap rate
    ("v_t", "f8"),  # [m/s] slip velocity
    ("low", "f8"),  # [rad] orientations at which the contact passes on to another arc, infinite where it does not
    ("high", "f8"),
    # Another arc may touch beside it: its gap is that of this one, and
    ("other", "f8"),  # [m] this,
    ("other_sine", "f8"),  # [m] and these times sine and cosine of phi + shift.
    ("other_cosine", "f8"),
    ("rising", "f8"),  # 1 if it comes down as the orientation rises, 0 if as it falls
    ("middle", "f8"),  # [rad] above this the rising one is watched, below the falling one
    ("direct", "f8"),  # 1 if that is the nearer one
    ("other_left", "f8"),  # 1 if the other arc has just left
    ("at_edge", "f8"),  # 1 if the contact has just passed on from another arc
    # The branch: what each velocity does from here on.
    ("gap_rate", "f8"),  # signs of v_n and v_t, 0 where locked
    ("slip", "f8"),
    ("stiffness", "f8"),  # [N/m]
    ("pace", "f8"),  # [s] unit of time of a step, as long as the spin is slow
    ("gap_zeros", "f8"),  # leading coefficients of v_n and v_t that are zero by construction
    ("slip_zeros", "f8"),
    ("gap_left", "f8"),  # signs with which velocities have just been released, or 0
    ("slip_left", "f8"),
)

# How a body touches down.
TOUCHDOWN: Final = record(
    ("time", "f8"),  # [s]
    ("x", "f8"),  # [m]
    ("phi", "f8"),  # [rad]
    ("u", "f8"),  # [m/s] of the mass centre
    ("v", "f8"),
    ("v_t", "f8"),  # [m/s]
    ("v_n", "f8"),
    ("omega", "f8"),  # [rad/s]
    ("arc", "f8"),  # which arc
    ("a", "f8"),  # [m] its arms
    ("b", "f8"),
)

# One step of a contact: power series in time, counted in a unit of the step's own, so that a coefficient is what its
# term adds after one unit; then what ends the step, and how.
STEP: Final = record(
    # The series.
    ("x", "f8", (WIDTH,)),  # [m]
    ("phi", "f8", (WIDTH,)),  # [rad]
    ("gap", "f8", (WIDTH,)),  # [m]
    ("v_n", "f8", (WIDTH,)),  # [m/s]
    ("v_t", "f8", (WIDTH,)),  # [m/s]
    ("omega", "f8", (WIDTH,)),  # [rad/s]
    ("normal", "f8", (WIDTH,)),  # [N]
    ("force", "f8", (WIDTH,)),  # [N] of a locked slip
    ("moment", "f8", (WIDTH,)),  # [N m] of a locked spin
    ("sines", "f8", (WIDTH,)),  # of theta
    ("cosines", "f8", (WIDTH,)),
    ("scratch", "f8", (WIDTH,)),  # whose root is sought
    ("theta", "f8"),  # [rad] phi + shift,
    ("sine", "f8"),  # its sine
    ("cosine", "f8"),  # and cosine
    ("unit", "f8"),  # [s] of time
    # When the contact oscillation, with frozen arms, is expected to end its phase.
    ("per_pulsation", "f8"),  # [s]
    ("abeam", "f8"),  # [m] direction of the phase angle up to there
    ("ahead", "f8"),
    ("expected", "f8"),  # code of the event,
    ("guess", "f8"),  # [units] where its root is,
    ("most", "f8"),  # [units] up to where it is sought,
    ("root", "f8"),  # [units] and where it was found
    ("length", "f8"),  # [units] of the step
    ("event", "f8"),  # code of what happens at its end
    ("released", "f8"),  # sign with which a velocity is released there
    # The state at its end.
    ("x_end", "f8"),
    ("phi_end", "f8"),
    ("gap_end", "f8"),
    ("v_n_end", "f8"),
    ("v_t_end", "f8"),
    ("omega_end", "f8"),
    ("normal_impulse", "f8"),  # [N s]
    ("force_impulse", "f8"),  # [N s] of a locked slip
    ("moment_impulse", "f8"),  # [N m s] of a locked spin
    ("slip_work", "f8"),  # [J] integral of the normal force times the slip velocity,
    ("spin_work", "f8"),  # [N] and times the spin
    ("travel", "f8"),  # [m] most that x changes by on the way
    ("turn", "f8"),  # [rad] and phi
    # > 0 if a quantity keeps the sign of the branch on the way, or does so once it has left zero.
    ("safe_load", "f8"),
    ("safe_v_n", "f8"),
    ("safe_v_t", "f8"),
    ("safe_omega", "f8"),
    ("safe_other", "f8"),
    # Where velocities are locked: bounds of the normal force, and > 0 if the forces stay within theirs.
    ("least", "f8"),  # [N]
    ("largest", "f8"),  # [N]
    ("safe_least", "f8"),
    ("safe_largest", "f8"),
    ("safe_force", "f8"),  # below its bound,
    ("safe_force_back", "f8"),  # and above the negative of that
    ("safe_moment", "f8"),
    ("safe_moment_back", "f8"),
)

# One hop: a flight, its touchdown, and the impact of a rigid body there.
HOP: Final = record(
    ("size", "f8"),  # [m] nothing of the body reaches further from the mass centre
    ("furthest", "f8"),  # [m] largest h of its arcs
    ("per_mass", "f8"),  # [1/kg]
    ("per_inertia", "f8"),  # [1/(kg m^2)]
    *((name, "f8") for name in Incline._fields),  # what it is subject to
    *((name, "f8") for name in MOTION),  # at the start of the flight; the impact changes omega
    *((name, "f8") for name in SEARCH),
    # The touchdown, or whatever else ends the flight.
    ("duration", "f8"),  # [s] of the flight
    *((f"{name}_landing", "f8") for name in MOTION),
    ("v_t_landing", "f8"),  # [m/s] slip velocity of what is lowest,
    ("v_n_landing", "f8"),  # [m/s] gap rate,
    ("arc", "f8"),  # its place in the outline,
    ("a", "f8"),  # [m] and arms
    ("b", "f8"),  # [m]
    # The impact, while it goes on and after it.
    ("friction", "f8"),  # [-]
    ("arm", "f8"),  # [m] rolling arm of what touches
    ("restitution", "f8"),  # [-] 0 of a plastic impact
    ("v_t", "f8"),  # [m/s] slip velocity
    ("v_n", "f8"),  # [m/s] gap rate
    ("slip", "f8"),  # signs of slip and spin in the next phase, 0 where locked
    ("spin", "f8"),
    ("mu", "f8"),  # [-] tangential force over normal force
    ("rho", "f8"),  # [m] rolling moment over normal force
    ("opening", "f8"),  # 1 while the gap opens, 0 while it closes
    ("span", "f8"),  # [N s] normal impulse of the phase that has just passed
    ("sequence", "f8"),  # code of the phases so far, see :func:`followed_by`
    *((name, "f8") for name in IMPULSES),  # so far
    ("closed", "f8"),  # [J] work of compression
    ("opened", "f8"),  # [J] work of restitution
    ("stored", "f8"),  # [J] what may be given back
    ("v_n_entry", "f8"),  # [m/s] gap rate at the touch
    ("compressed", "f8"),  # [N s] normal impulse at the end of the first compression, of Poisson's hypothesis
    *((name, "f8") for name in LOSSES),  # [J] of the impact, and of the flight before it
)


def copy(source: Any, target: Any, names: Sequence[str], of: str = "{}", to: str = "{}") -> None:
    """In a program: copy fields from one record to another, in which patterns make other names of theirs."""
    for name in names:
        setattr(target, to.format(name), getattr(source, of.format(name)))


def followed_by(sequence: Any, event: Any) -> Any:
    """In a program: the code of a sequence that goes on with an event, a whole number from 0 to a few hundred.

    Equal sequences have equal codes; that different ones have too is as likely as one in 2^31.
    """
    mixed = sequence * _MIX + (event + 1.0)
    return mixed - nearest(mixed * (1.0 / _PRIME)) * _PRIME


def add(source: Any, target: Any, names: Sequence[str]) -> None:
    """In a program: add fields of one record to those of another."""
    for name in names:
        setattr(target, name, getattr(target, name) + getattr(source, name))


def clear(record: Any, names: Sequence[str]) -> None:
    """In a program: set fields of a record to zero."""
    for name in names:
        setattr(record, name, 0.0)
