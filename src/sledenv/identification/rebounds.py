"""Measured rebounds of one body, and the balance of their spins."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from sledenv.identification.fitting import Floats
from sledenv.pages.columns import REBOUND_COLUMNS, TRAJECTORY_COLUMNS
from sledenv.simulation.bodies import Body
from sledenv.simulation.support import lowest_arms, within_a_turn

BEFORE: Final = tuple(REBOUND_COLUMNS[f"{name}_before"] for name in ("u", "v", "omega"))
AFTER: Final = tuple(REBOUND_COLUMNS[f"{name}_after"] for name in ("u", "v", "omega"))
POSE: Final = (TRAJECTORY_COLUMNS["phi"],)
ARMS: Final = ("a_m", "b_m")
TOUCHDOWN: Final = REBOUND_COLUMNS["t_touchdown"]


@dataclass(frozen=True)
class Rebounds:
    """Measured rebounds of one body, checked.

    Attributes
    ----------
    gyration_radius : float
        Root of inertia over mass [m]; the mass itself cancels.
    contacts : ndarray, shape (N, 5)
        Arms a, b [m], and u, v [m/s], omega [rad/s] before.
    after : ndarray, shape (N, 3)
        u, v [m/s], omega [rad/s].
    corner : ndarray of bool, shape (N,)
        Whether a corner touched.
    recordings : ndarray, shape (N,)
        Which recording each is of.
    places : ndarray of str, shape (N,)
        Where each was read, such as "line 6"; empty if it was not read from a table.
    body : Body or None
        None if arms were told.
    phi : ndarray, shape (N,)
        Orientations of the body [rad]; empty if arms were told.
    """

    gyration_radius: float
    contacts: Floats
    after: Floats
    corner: NDArray[np.bool_]
    recordings: NDArray[np.generic]
    places: NDArray[np.str_] = field(default_factory=lambda: np.zeros(0, str))
    body: Body | None = None
    phi: Floats = field(default_factory=lambda: np.zeros(0))

    def __len__(self) -> int:
        return len(self.contacts)

    def rows(self, chosen: NDArray[np.generic]) -> Rebounds:
        """Return some of the rebounds, by a mask or by their numbers."""
        return replace(
            self,
            contacts=self.contacts[chosen],
            after=self.after[chosen],
            corner=self.corner[chosen],
            recordings=self.recordings[chosen],
            places=self.places[chosen] if len(self.places) else self.places,
            phi=self.phi[chosen] if len(self.phi) else self.phi,
        )

    def oriented(self, phi: Floats) -> Rebounds:
        """Return the rebounds that the body would have in other orientations [rad], with the same velocities."""
        if self.body is None:
            raise ValueError("body = None: arms were told, which have no orientation")
        reach, corner = arms_of(self.body, phi)
        return replace(self, contacts=np.hstack([reach, self.before]), corner=corner, phi=phi)

    @property
    def arms(self) -> Floats:
        """Arms a and b [m], shape (N, 2)."""
        return self.contacts[:, :2]

    @property
    def before(self) -> Floats:
        """Velocities u, v [m/s] and omega [rad/s], shape (N, 3)."""
        return self.contacts[:, 2:]

    @property
    def scales(self) -> Floats:
        """Factors that make velocities comparable: square roots of M over the mass, (1, 1, radius of gyration)."""
        return np.array([1.0, 1.0, self.gyration_radius])

    @cached_property
    def speed(self) -> Floats:
        """Root of ``v' M v / m`` before [m/s], shape (N,): the kinetic energy as a speed."""
        speed: Floats = np.sqrt(np.sum((self.before * self.scales) ** 2, axis=1))
        return speed

    @property
    def approach(self) -> Floats:
        """Speed [m/s] at which the gap closes, shape (N,)."""
        return self.contacts[:, 0] * self.contacts[:, 4] - self.contacts[:, 3]

    @property
    def opening(self) -> Floats:
        """Speed [m/s] at which the gap opens afterwards, shape (N,)."""
        return self.after[:, 1] - self.contacts[:, 0] * self.after[:, 2]

    @property
    def slips(self) -> tuple[Floats, Floats]:
        """Velocities u + b omega [m/s] of the contact point along the slope, before and after, shape (N,) each."""
        b = self.contacts[:, 1]
        return self.before[:, 0] + b * self.before[:, 2], self.after[:, 0] + b * self.after[:, 2]

    @property
    def energy_after(self) -> Floats:
        """``v' M v / m`` after [m^2/s^2], shape (N,)."""
        energy: Floats = np.sum((self.after * self.scales) ** 2, axis=1)
        return energy

    @property
    def normal_alone(self) -> bool:
        """Whether nothing slips, turns or could be turned, so that there is neither friction nor rolling resistance."""
        return not (self.contacts[:, [0, 1, 2, 4]].any() or self.after[:, [0, 2]].any())

    def place(self, row: int) -> str:
        """Return where a rebound was read, such as "line 6" of a file."""
        return str(self.places[row]) if len(self.places) else f"row {row}"

    def residuals(self, velocities: Floats) -> Floats:
        """Differences from the velocities after, shape (N, 3), in the energy norm and relative to the speed before."""
        found: Floats = (velocities - self.after) * self.scales / self.speed[:, None]
        return found

    def errors(self, velocities: Floats) -> Floats:
        """Root of ``dv' M dv / v0' M v0``, shape (N,)."""
        found: Floats = np.linalg.norm(self.residuals(velocities), axis=1)
        return found

    @property
    def moments(self) -> Floats:
        """Moments of the recorded impulses over the mass [m^2/s], about the arms a and b, shape (N, 2)."""
        change = self.after - self.before
        return np.stack([-self.arms[:, 0] * change[:, 1], self.arms[:, 1] * change[:, 0]], axis=1)

    @property
    def changes_of_spin(self) -> Floats:
        """Changes of spin times the square of the radius of gyration [m^2/s], shape (N,)."""
        return self.gyration_radius**2 * (self.after - self.before)[:, 2]

    def balance(self) -> pd.DataFrame:
        """Compare the recorded spins with the moments of the recorded impulses about the arms, whatever the law.

        The moment of the normal impulse is ``-a P``, that of the tangential one ``b S``. A law without rolling
        resistance leaves the spin no other source, so that the shares found here, by least squares, are 1 each, and
        near it where rolling resistance is small. A share that is far off, or negative, means that an arm, the spin or
        the radius of gyration is told wrongly, in its sign or in its unit: no contact law makes good for that.

        Returns
        -------
        DataFrame
            Rows ``a`` and ``b``: ``share`` [-] and its standard ``error``, NaN where that arm does not turn the body.
        """
        moments, spin = self.moments, self.changes_of_spin
        told = np.linalg.norm(moments, axis=0) > 1e-9 * np.linalg.norm(spin)
        found = pd.DataFrame(np.nan, ["a", "b"], ["share", "error"])
        if told.any() and len(self) > 2:
            design = moments[:, told]
            shares = np.linalg.lstsq(design, spin)[0]
            inverse = np.linalg.pinv(design.T @ design, hermitian=True)
            scores = design * (spin - design @ shares)[:, None]
            spread = inverse @ (scores.T @ scores) @ inverse
            found.loc[told, "share"], found.loc[told, "error"] = shares, np.sqrt(np.diag(spread))
        return found


def arms_of(body: Body, phi: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Arms [m] at orientations [rad], (N, 2), and whether a corner touches, (N,)."""
    arcs, found = lowest_arms(body.record, within_a_turn(phi))
    return found, body.record["corner"][0][arcs] > 0.0
