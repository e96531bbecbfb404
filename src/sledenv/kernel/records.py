"""Records that a descent returns, and the codes that appear in them."""

from __future__ import annotations

from enum import IntEnum, StrEnum
from typing import Annotated, Any, Final, NamedTuple, get_type_hints

import numpy as np

from sledenv.kernel.params import State

# Kernels use the plain integers (an enum member would not be a compile-time constant); the enums below name them.
RUNNING, FINISH, JAMMED, TUMBLED, TIMEOUT, LOG_FULL, STEP_BUDGET, NON_FINITE, BURIED = range(9)

ARC, NOSE, TAIL, CHORD = range(1, 5)


class Status(StrEnum):
    """Why a descent ended; members are strings, ``STATUS_OF_CODE`` maps the kernel's codes to them."""

    RUNNING = "running"  # under way, never returned by a whole descent
    FINISH = "finish"  # the mass centre reached the end of the slope, or of the run-out behind it
    JAMMED = "jammed"  # at rest for good: full stick on the incline
    TUMBLED = "tumbled"  # the body lay on its chord, or a part of it touched, where the descent was to end
    TIMEOUT = "timeout"  # max_time elapsed
    LOG_FULL = "log_full"  # max_rebounds rebounds were recorded
    STEP_BUDGET = "step_budget"  # max_steps integration steps were spent, or some thousand without getting on
    NON_FINITE = "non_finite"  # a state overflowed or was not a number
    BURIED = (
        "buried"  # deeper in a soft slope than a quarter of the size, or so deep that the model of the contact ends
    )


STATUS_OF_CODE: Final = tuple(Status)
"""Names of the codes above, in their order: of ``status`` in outcomes and in the info of the environments."""


class Feature(IntEnum):
    """Codes of the parts of a segment; those of any other body are the places in its ``parts``, counted from 1."""

    NONE = 0
    ARC = ARC
    NOSE = NOSE  # the downhill corner of an upright body
    TAIL = TAIL  # the uphill corner
    CHORD = CHORD  # both corners


class Mode(IntEnum):
    """How the contact ended, in the words of the paper's Table 1."""

    SLIDE_ROLL = 1  # slips and spins as at entry
    STOP_ROLL = 2  # slip has stopped, the body rolls
    SLIDE = 3  # slips without rotation
    STUCK = 4  # neither slips nor rotates
    SPIN_REVERSAL = 5  # the spin has changed its sign
    SLIP_REVERSAL = 6  # the slip has changed its sign
    DOUBLE_REVERSAL = 7  # both have


LostInContact = Annotated[float, "lost in contact"]
LostInFlight = Annotated[float, "lost in flight"]


class Energy(NamedTuple):
    """Energy ledger of a descent [J]: docs/physics.md, section 9.

    Records, books and figures have each loss that is marked as one here.
    """

    initial: float  # kinetic + potential at launch
    kinetic: float  # of the body at the end
    potential: float  # at the end; zero at x = 0, y = 0
    stored: float  # in the compressed contact at the end
    hysteresis: LostInContact  # between loading and unloading stiffness
    sliding: LostInContact  # to Coulomb friction
    rolling: LostInContact  # to rolling resistance
    drag: LostInFlight  # to the air, in contact too
    rotor: float  # kinetic energy of the rider's rotor at the end
    work: float  # done by the rider's trim
    absorbed: float  # taken up by the rider's trim, and lost
    supplied: float  # launch kinetic energy + drop height + slope descended + work

    @property
    def lost(self) -> float:
        """All losses [J]."""
        total = 0.0
        for name in LOSSES:
            total += getattr(self, name)
        return total + self.absorbed

    @property
    def turnover(self) -> float:
        """Energy [J] that went through the books, on which the residual is to be seen: at launch, at the end, lost."""
        return abs(self.initial) + abs(self.potential) + self.work + self.lost

    @property
    def residual(self) -> float:
        """Energy [J] that the ledger cannot account for: the integration error, small beside the turnover."""
        return self.kinetic + self.potential + self.stored + self.rotor + self.lost - self.initial - self.work


def _marked(mark: Any) -> tuple[str, ...]:
    return tuple(name for name, kind in get_type_hints(Energy, include_extras=True).items() if kind == mark)


LEDGER_FIELDS: Final = Energy._fields
CONTACT_LOSSES: Final = _marked(LostInContact)
FLIGHT_LOSSES: Final = _marked(LostInFlight)
LOSSES: Final = CONTACT_LOSSES + FLIGHT_LOSSES

REBOUND = np.dtype(
    [
        ("t", "f8"),  # [s] at separation (or at the end of a descent that ends in contact)
        ("x", "f8"),  # [m] mass centre at that time
        ("phi", "f8"),  # [rad] at that time
        ("t_touchdown", "f8"),  # [s] when the contact began
        ("x_contact", "f8"),  # [m] where it began: the point that touched
        ("duration", "f8"),  # [s] of the contact
        ("feature", "i4"),  # code of the part of the body that touched first, or of the side that lay on the slope
        ("ground", "i4"),  # code of what was touched first of the ground, as in CONTACT_FORCES
        ("mode", "i4"),  # Mode
        ("normal_impulse", "f8"),  # [N s]
        ("tangential_impulse", "f8"),  # [N s]
        ("rolling_impulse", "f8"),  # [N m s]
        ("peak_force", "f8"),  # [N] largest normal force of a point that touched; inf where surfaces are rigid
        ("peak_penetration", "f8"),  # [m] largest of such a point
        ("u_before", "f8"),  # [m/s] at touchdown
        ("v_before", "f8"),
        ("omega_before", "f8"),  # [rad/s]
        ("u_after", "f8"),  # [m/s] at separation
        ("v_after", "f8"),
        ("omega_after", "f8"),  # [rad/s]
        *((f"loss_{name}", "f8") for name in CONTACT_LOSSES),  # [J]
        ("stuck", "i4"),  # 0 no; 1 below 5 % of the entry speed; 2 exactly (u = 0 and omega = 0)
        ("sequence", "i4"),  # code of what slipped, stuck, turned, closed and opened, in order; 0 by Euler's method
    ],
    align=True,
)

PHASE = np.dtype(
    [
        ("start", "f8"),  # [N s] normal impulse at its start
        ("impulse", "f8"),  # [N s] normal impulse of the phase
        ("slip", "i4"),  # sign of the slip velocity, 0 sticking
        ("spin", "i4"),  # sign of the angular velocity, 0 stopped
        ("restitution", "i4"),  # 1 while the gap opens, 0 while it closes
    ],
    align=True,
)

MOST_CONTACTS: Final = 8  # at once; a row of a trajectory has room for so many

# Where a body touches the slope, and the force on it there. Codes of the ground, in their order along x: 2 k of piece k
# of its profile, 2 k + 1 of vertex k, which ends piece k; a plane is piece 0.
CONTACT_FORCES = np.dtype(
    [
        ("x", "f8"),  # [m] place of the touching point, slope frame
        ("y", "f8"),
        ("normal_x", "f8"),  # [-] unit normal there, out of the ground
        ("normal_y", "f8"),
        ("normal", "f8"),  # [N] force along the normal,
        ("tangential", "f8"),  # [N] and along the tangent (normal_y, -normal_x)
        ("part", "i4"),  # code of the part of the body that touches
        ("ground", "i4"),  # code of what it touches
    ],
    align=True,
)

# Times never decrease. Two rows share one where a step of a contact ends: the state goes on, the forces may jump.
TRAJECTORY = np.dtype(
    [
        ("t", "f8"),  # [s]
        ("x", "f8"),  # [m]
        ("y", "f8"),  # [m]
        ("phi", "f8"),  # [rad]
        ("u", "f8"),  # [m/s]
        ("v", "f8"),  # [m/s]
        ("omega", "f8"),  # [rad/s]
        # Of all contacts together.
        ("normal", "f8"),  # [N] normal forces
        ("tangential", "f8"),  # [N] tangential forces
        ("rolling", "f8"),  # [N m] rolling moments
        # Of what is in contact, 0 in flight: the slip velocity, and the tangential force over its largest value f N.
        ("slip_velocity", "f8"),  # [m/s]
        ("friction_ratio", "f8"),  # [-]
        ("feature", "i4"),  # code of the part of the body in contact, 0 in flight
        ("slip", "i4"),  # sign of the slip velocity, 0 sticking (and in flight)
        ("spin", "i4"),  # sign of the angular velocity, 0 locked (and in flight)
        *((name, "f8") for name in FLIGHT_LOSSES),  # [J] since the launch
        ("touching", "i4"),  # number of contacts, 0 in flight: the first so many of
        ("contacts", CONTACT_FORCES, MOST_CONTACTS),  # these; the others are zero
    ],
    align=True,
)

OUTCOME = np.dtype(
    [
        ("status", "i4"),  # Status
        ("rebounds", "i4"),  # rows of the log that were filled
        ("samples", "i8"),  # rows of the trajectory that were needed (more than its length: it was too short)
        ("steps", "i8"),  # integration steps in contact
        *((name, "f8") for name in ("t", *State._fields)),
        ("t_line", "f8"),  # [s] when the mass centre passed the end of the slope; inf if never
        ("u_line", "f8"),  # [m/s] and how fast along the ground there, 0 if never
        ("t_on_chord", "f8"),  # [s] when the body first lay on its chord with both ends settled; inf if never
        ("x_on_chord", "f8"),  # [m] and where
        ("trim_spin", "f8"),  # [rad/s] spin that the rider's rotor has lent to the body
        *((name, "f8") for name in LEDGER_FIELDS),
    ],
    align=True,
)


class Written(NamedTuple):
    """Tables into which descents are written."""

    flights: np.ndarray  # of OUTCOME: state of each, moved on from a launch or from where a call has stopped
    logs: np.ndarray  # of REBOUND, a row for each or one for all; a rebound without room overwrites the last one
    trajectory: np.ndarray  # of TRAJECTORY, written while there is room; its flight counts all rows
