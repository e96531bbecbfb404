"""Rigid impacts apart from a descent: one of a body in some state, and many that are given by their arms."""

from __future__ import annotations

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import wrap
from sledenv.kernel.impact import MOST_PHASES, impact
from sledenv.kernel.outline import distance, lowest_arms, rolling_arm
from sledenv.kernel.params import ContactLaw, State


@kernel
def collide(
    bodies: np.ndarray,
    law: ContactLaw,
    state: State,
    restitution: float,
    hypothesis: int,
    hits: np.ndarray,
    phases: np.ndarray,
    count: np.ndarray,
) -> None:
    """Follow the impact of a body in some state, as a descent does.

    Parameters
    ----------
    bodies : ndarray of BODY, shape (1,)
    law, state
        See :mod:`sledenv.kernel.params`.
    restitution : float
        [-].
    hypothesis : int
        As for :func:`sledenv.kernel.impact.impact`.
    hits : ndarray of IMPACT, shape (1,)
        Overwritten.
    phases : ndarray of PHASE
        Filled from the front.
    count : ndarray of int, shape (1,)
        Set to the number of phases; to MOST_PHASES + 1 if the impact does not end in MOST_PHASES of them.
    """
    hit, body = hits[0], bodies[0]
    hit["size"], hit["per_mass"], hit["per_inertia"] = body["size"], 1.0 / body["mass"], 1.0 / body["inertia"]
    arc, a, b = lowest_arms(body, wrap(state.phi))
    hit["friction"], hit["restitution"] = law.friction, restitution
    hit["rolling_arm"] = rolling_arm(body, law, arc)
    _touch(hit, a, b, state.u, state.v, state.omega)
    count[0] = impact(hypothesis, hit, phases)


@kernel
def _touch(hit: np.void, a: float, b: float, u: float, v: float, omega: float) -> None:
    """Write the arms of the contact point and the velocities of the body at touch."""
    hit["a"], hit["b"] = a, b
    hit["v_t"], hit["v_n"], hit["omega"] = u + b * omega, v - a * omega, omega


@kernel
def collide_each(
    gyration_radius: float,
    contacts: np.ndarray,
    laws: np.ndarray,
    hypothesis: int,
    hits: np.ndarray,
    after: np.ndarray,
    lost: np.ndarray,
) -> None:
    """Follow many impacts of a body of mass 1.

    Parameters
    ----------
    gyration_radius : float
        [m].
    contacts : ndarray, shape (N, 5)
        Arms a, b [m] of the contact point; u, v [m/s] and omega [rad/s] at touch.
    laws : ndarray, shape (N, 3)
        Restitution [-], friction [-] and rolling arm [m].
    hypothesis : int
        As for :func:`sledenv.kernel.impact.impact`.
    hits : ndarray of IMPACT, shape (1,)
        Overwritten.
    after : ndarray, shape (N, 3)
        Filled with u, v and omega.
    lost : ndarray of int, shape (1,)
        Set to the row of the first impact that does not end, or to -1 if all end. Later impacts are not followed.
    """
    hit = hits[0]
    hit["per_mass"], hit["per_inertia"] = 1.0, 1.0 / gyration_radius**2
    lost[0] = -1
    for i in range(contacts.shape[0]):
        a, b = contacts[i, 0], contacts[i, 1]
        hit["size"] = gyration_radius + distance(a, b)
        hit["restitution"], hit["friction"], hit["rolling_arm"] = laws[i, 0], laws[i, 1], laws[i, 2]
        _touch(hit, a, b, contacts[i, 2], contacts[i, 3], contacts[i, 4])
        if impact(hypothesis, hit, None) > MOST_PHASES:
            lost[0] = i
            return
        omega = hit["omega"]
        after[i, 0], after[i, 1], after[i, 2] = hit["v_t"] - b * omega, hit["v_n"] + a * omega, omega
