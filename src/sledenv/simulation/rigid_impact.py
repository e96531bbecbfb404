"""The Python face of the rigid impact: :func:`rigid_impact`, and many impacts told by their arms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np

from sledenv.kernel.books import contact_mode
from sledenv.kernel.contacts import IMPACT
from sledenv.kernel.entries import run_collision, run_collisions
from sledenv.kernel.impact import ENERGETIC, MOST_PHASES, NEWTON, POISSON
from sledenv.kernel.records import PHASE, Mode
from sledenv.simulation.bodies import Body, made_body
from sledenv.simulation.rules import CLOSED_FRACTION, checked, checked_choice, made
from sledenv.simulation.scene import ContactLaw, State
from sledenv.simulation.support import FLAT, arms_beside, within_a_turn

Hypothesis = Literal["energetic", "poisson", "newton"]

_CODES = {"energetic": ENERGETIC, "poisson": POISSON, "newton": NEWTON}


class Phase(NamedTuple):
    """One stretch of an impact between two events."""

    start: float  # [N s] normal impulse at its start
    impulse: float  # [N s] normal impulse of the phase
    slip: int  # sign of the slip velocity, 0 sticking
    spin: int  # sign of the angular velocity, 0 stopped
    restitution: bool  # True while the gap opens, False while it closes


@dataclass(frozen=True)
class RigidImpact:
    """Result of one rigid impact.

    Attributes
    ----------
    state : State
        After the impact; position and orientation are those before.
    normal_impulse, tangential_impulse : float
        [N s].
    rolling_impulse : float
        [N m s].
    mode : Mode
        How the impact ended, in the words of Table 1.
    phases : tuple of Phase
        In order; empty if there was no impact.
    loss_hysteresis, loss_sliding, loss_rolling : float
        [J]. Under the Newton hypothesis the first may be negative: energy out of nothing, docs/physics.md, section 4.
    """

    state: State
    normal_impulse: float
    tangential_impulse: float
    rolling_impulse: float
    mode: Mode
    phases: tuple[Phase, ...]
    loss_hysteresis: float
    loss_sliding: float
    loss_rolling: float


def velocities_after(
    gyration_radius: float, contacts: np.ndarray, laws: np.ndarray, hypothesis: Hypothesis = "energetic"
) -> np.ndarray:
    """Velocities after many impacts of a body of any shape, told by where its contact point lies each time.

    Parameters
    ----------
    gyration_radius : float
        Root of inertia over mass [m], > 0; the mass itself cancels.
    contacts : ndarray of float, shape (N, 5)
        Arms a, b [m] of the contact point, which lies at (-a, -b) from the mass centre; u, v [m/s] and omega [rad/s]
        at touch. A gap that does not close is not hit.
    laws : ndarray of float, shape (N, 3)
        Restitution [-] in [0, 1], friction [-] and rolling arm [m], both not negative. Neither they nor the contacts
        are checked.
    hypothesis : {"energetic", "poisson", "newton"}
        As for :func:`rigid_impact`.

    Returns
    -------
    ndarray of float, shape (N, 3)
        u, v [m/s] and omega [rad/s].

    Raises
    ------
    ArithmeticError
        If an impact does not end within the bound on its phases.
    """
    after = np.empty((len(contacts), 3))
    contacts, laws = np.ascontiguousarray(contacts, float), np.ascontiguousarray(laws, float)
    lost = np.empty(1, np.int64)
    run_collisions(float(gyration_radius), contacts, laws, _CODES[hypothesis], np.zeros(1, IMPACT), after, lost)
    if lost[0] >= 0:
        raise ArithmeticError(f"the impact of row {lost[0]} did not end within {MOST_PHASES} phases")
    return after


def rigid_impact(
    body: Body,
    law: ContactLaw,
    state: State,
    *,
    restitution: float | None = None,
    hypothesis: Hypothesis = "energetic",
) -> RigidImpact:
    """Solve one impact of rigid surfaces exactly, in the normal impulse: docs/physics.md, section 4.

    Parameters
    ----------
    body, law
        The stiffness of the law is not used.
    state : State
        Velocities at touch and the orientation, in which one point of the body must be lowest; ``x`` and ``y`` are not
        used. A feature that does not approach the slope is not hit: the state is returned as it is.
    restitution : float, optional
        e [-] in [0, 1] in place of that of the law.
    hypothesis : {"energetic", "poisson", "newton"}
        What e means: energetic (Stronge) is consistent with every friction; the other two are for comparison, and
        Newton's can create energy.

    Returns
    -------
    RigidImpact

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range.
    ValueError
        If the body comes down flat, on two points at once, of which one approaches at least.
    ArithmeticError
        If the impact does not end within the bound on its phases.
    """
    checked_choice("hypothesis", hypothesis, get_args(Hypothesis))
    body, law, state = made_body(body), made("law", ContactLaw, law), State(*made("state", State, state))
    e = law.restitution if restitution is None else checked("rigid_impact", "restitution", restitution, CLOSED_FRACTION)
    rows, hits = np.zeros(MOST_PHASES, PHASE), np.zeros(1, IMPACT)
    touching = state._replace(phi=float(within_a_turn(np.array(state.phi))))
    _check_one_point(body, touching, state.phi)
    phases_found = np.empty(1, np.int64)
    run_collision(body.record, law, touching, e, _CODES[hypothesis], hits, rows, phases_found)
    count = int(phases_found[0])
    if count > MOST_PHASES:
        raise ArithmeticError(f"the impact of {state} did not end within {MOST_PHASES} phases")
    hit = {name: float(hits[name][0]) for name in IMPACT.names or ()}
    slip, omega = hit["v_t"], hit["omega"]
    after = state
    if count > 0:
        after = State.found((*state[:3], slip - hit["b"] * omega, hit["v_n"] + hit["a"] * omega, omega))
    phases = tuple(
        Phase(float(row["start"]), float(row["impulse"]), int(row["slip"]), int(row["spin"]), bool(row["restitution"]))
        for row in rows[:count]
    )
    return RigidImpact(
        after,
        hit["normal_impulse"],
        hit["tangential_impulse"],
        hit["rolling_impulse"],
        Mode(contact_mode(state.u + hit["b"] * state.omega, state.omega, slip, omega)),
        phases,
        hit["hysteresis"],
        hit["sliding"],
        hit["rolling"],
    )


def _check_one_point(body: Body, state: State, phi: float) -> None:
    """Raise ValueError where the lowest point of a body jumps to another one, as it does where it lies flat."""
    arms = arms_beside(body, state.phi)
    flat = np.ptp(arms[:, 0]) > 4.0 * FLAT * max(body.size, float(body.record["r"].max()))
    if flat and (state.v - arms[:, 0] * state.omega < 0.0).any():
        raise ValueError(
            f"state.phi = {phi!r}: the body comes down on two points at once there, and this is the impact of one; "
            "simulate(..., solver='rigid') follows both"
        )
