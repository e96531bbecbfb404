"""Outcomes: a simulated descent, and a batch of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from typing import Any, Final, Literal, get_args

import numpy as np

from sledenv.kernel.records import CONTACT_FORCES, OUTCOME, STATUS_OF_CODE, Energy, Status
from sledenv.simulation.bodies import Body
from sledenv.simulation.jam import DescentJam, ReboundJam, descent_jam, rebound_jam
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.settings import Settings
from sledenv.simulation.views import shown

Record = Literal["rebounds", "trajectory"]
RECORDS: Final = get_args(Record)

_NAMES = list(OUTCOME.names or ())


_STATUS, _TIME, _REBOUNDS, _SAMPLES = map(_NAMES.index, ("status", "t", "rebounds", "samples"))
_STATE, _ENERGY = (itemgetter(*map(_NAMES.index, names)) for names in (State._fields, Energy._fields))


CONTACTS: Final = np.dtype(
    [
        ("t", "f8"),  # [s]
        ("row", "i8"),  # of the trajectory
        *((name, of) for name, (of, *_) in (CONTACT_FORCES.fields or {}).items()),
    ]
)
"""Contacts of a trajectory, one after the other: :attr:`Descent.contacts`."""


def ground_name(code: int, rounding: Sequence[float] = ()) -> str:
    """Return what is touched of the ground, from its code in records: "piece 2" or "vertex 1" of the profile.

    With the radii of the vertices one that has a radius is a bend: "bend 1".
    """
    k, at_vertex = divmod(code, 2)
    vertex = "bend" if any(rounding[k : k + 1]) else "vertex"
    return f"{vertex if at_vertex else 'piece'} {k}"


def contacts_in(rows: np.ndarray) -> np.ndarray:
    """Return the contacts in rows of a trajectory, a record of ``CONTACTS`` for each row and each contact there is."""
    there = np.arange(rows["contacts"].shape[1]) < rows["touching"][:, np.newaxis]
    row, _ = np.nonzero(there)
    forces, found = rows["contacts"][there], np.zeros(len(row), CONTACTS)
    found["t"], found["row"] = rows["t"][row], row
    for name in CONTACT_FORCES.names or ():
        found[name] = forces[name]
    return found


@dataclass(frozen=True, eq=False, repr=False)
class Descent:
    """One simulated descent.

    Attributes
    ----------
    status : Status
        Why it ended; a string such as "finish", "jammed" or "timeout".
    time : float
        Duration [s].
    state : State
        At the end.
    rebounds : ndarray of REBOUND, shape (n,)
        One row for each contact, in order; the last may be a contact in which the descent ended.
    trajectory : ndarray of TRAJECTORY, shape (m,)
        Empty unless simulated with ``record="trajectory"``. Times never decrease; two rows share one where forces may
        jump.
    contacts : ndarray of CONTACTS, shape (k,)
        What touches what in the trajectory: one row for each of its rows and each contact there is, in this order.
    energy : Energy
        The ledger.
    body, law, slope, launch
        What was simulated.
    settings : Settings or None
        How; None where :func:`sledenv.simulate` does not repeat it: a ride that had a rotor or has not ended, or a
        descent by Euler's method.
    """

    body: Body
    law: ContactLaw
    slope: Slope
    launch: State
    status: Status
    time: float
    state: State
    rebounds: np.ndarray
    trajectory: np.ndarray
    energy: Energy
    outcome: np.void
    settings: Settings | None

    def __repr__(self) -> str:
        rows = f", {len(self.trajectory)} rows of trajectory" if len(self.trajectory) else ""
        ended = f"{self.status} at t = {self.time:.4g} s, x = {self.state.x:.4g} m"
        reward = f"; reward {float(self.jam.reward):.3f}" if math.isfinite(self.slope.length) else ""
        return f"Descent({ended}; {_counted(len(self.rebounds), 'rebound')}{rows}{reward})"

    @cached_property
    def contacts(self) -> np.ndarray:
        """Contacts of the trajectory as one table, without records in records.

        Returns
        -------
        ndarray of CONTACTS, shape (k,)
            ``t`` [s] and ``row`` of the trajectory; place ``x``, ``y`` [m] of the touching point and unit normal
            ``normal_x``, ``normal_y`` there, slope frame; forces ``normal`` and ``tangential`` [N], the latter along
            (normal_y, -normal_x); codes of ``part`` of the body and of ``ground``.
        """
        return contacts_in(self.trajectory)

    @property
    def on_chord(self) -> tuple[float, float] | None:
        """When [s] and where [m] the body first lay on its chord, both ends settled, so that it slid or rested there.

        None if it never did, or only bounced or rocked on both ends. By Euler's method nothing settles.
        """
        time, x = float(self.outcome["t_on_chord"]), float(self.outcome["x_on_chord"])
        return (time, x) if math.isfinite(time) else None

    @property
    def at_line(self) -> tuple[float, float] | None:
        """When [s] the mass centre passed the end of the slope, and how fast along the ground [m/s]; None if never."""
        time, u = float(self.outcome["t_line"]), float(self.outcome["u_line"])
        return (time, u) if math.isfinite(time) else None

    @cached_property
    def jam(self) -> DescentJam:
        """Jam metrics of the descent."""
        return descent_jam(self.outcome, self.body.mass, self.slope.length)

    def as_batch(self) -> DescentBatch:
        """Return a batch of this one descent."""
        jam = DescentJam._make(field.reshape(1) for field in self.jam)
        return DescentBatch(self.outcome.reshape(1), self.rebounds[np.newaxis], jam)

    @cached_property
    def rebound_jam(self) -> ReboundJam:
        """Grip, tangential loss and stuck flags of each rebound."""
        return rebound_jam(self.rebounds, self.slope.friction_at(self.rebounds["x_contact"], self.law.friction))

    def _repr_html_(self) -> str:
        """Return what a notebook shows: with a trajectory the page that replays it, or else its story."""
        return shown(self)


@dataclass(frozen=True, eq=False, repr=False)
class DescentBatch:
    """Many simulated descents, arrays of N.

    Attributes
    ----------
    outcomes : ndarray of OUTCOME, shape (N,)
        Status code, time, final state and energy ledger of each.
    rebounds : ndarray of REBOUND, shape (N, max_rebounds) or (0, 0)
        The logs, ``outcomes["rebounds"]`` rows of which are filled.
    jam : DescentJam
        Jam metrics, each of shape (N,).
    """

    outcomes: np.ndarray
    rebounds: np.ndarray
    jam: DescentJam

    def __repr__(self) -> str:
        lanes = len(self.outcomes)
        counts = np.bincount(self.outcomes["status"], minlength=len(STATUS_OF_CODE))
        ends = ", ".join(
            f"{counts[code] / lanes:.1%} {STATUS_OF_CODE[code]}" for code in np.argsort(-counts) if counts[code]
        )
        reward = f"; mean reward {self.jam.reward.mean():.3f}" if lanes else ""
        return f"DescentBatch({_counted(lanes, 'descent')}: {ends or 'none'}{reward})"

    @property
    def status(self) -> np.ndarray:
        """Status of each descent, an array of shape (N,): words of :class:`sledenv.Status`, such as "finish"."""
        return np.asarray(np.array(STATUS_OF_CODE)[self.outcomes["status"]])

    @property
    def time(self) -> np.ndarray:
        """Duration [s], shape (N,)."""
        return np.asarray(self.outcomes["t"])

    @property
    def on_chord(self) -> np.ndarray:
        """When [s] and where [m] each body first lay on its chord, see :class:`Descent`, shape (N, 2); inf if never."""
        return np.stack([self.outcomes["t_on_chord"], self.outcomes["x_on_chord"]], axis=-1)

    @property
    def states(self) -> np.ndarray:
        """Final states, shape (N, 6), columns as in :class:`State`."""
        return np.stack([self.outcomes[name] for name in State._fields], axis=-1)


def _counted(count: int, what: str) -> str:
    """Say how many there are."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def descent_of(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    launch: State,
    outcome: np.void,
    rebounds: np.ndarray,
    trajectory: np.ndarray,
    settings: Settings | None,
) -> Descent:
    """Descent out of what the kernel has written; shares no log with it."""
    values: Any = outcome.item()  # one by one fields take far longer to read
    own = bytearray(rebounds[: values[_REBOUNDS]].tobytes())  # and to copy
    return Descent(
        body=body,
        law=law,
        slope=slope,
        launch=launch,
        status=STATUS_OF_CODE[values[_STATUS]],
        time=values[_TIME],
        state=_state_in(values),
        rebounds=np.ndarray(values[_REBOUNDS], rebounds.dtype, own),
        trajectory=trajectory[: values[_SAMPLES]],
        energy=Energy._make(_ENERGY(values)),
        outcome=outcome,
        settings=settings,
    )


def state_of(outcome: np.void) -> State:
    """Return the state in an OUTCOME; one that is not finite is a status, not an error."""
    values: Any = outcome.item()
    return _state_in(values)


def _state_in(values: tuple[Any, ...]) -> State:
    return State.found(_STATE(values))
