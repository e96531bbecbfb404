"""What is differentiated of a descent, by which parameters, and the derivatives: :class:`Sensitivity`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.ground import MOST_ZONES
from sledenv.simulation.bodies import Body
from sledenv.simulation.jam import SHOWN, DescentJam, Shown
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.rules import checked_choice
from sledenv.simulation.scene import Slope, State, Zone

Floats = NDArray[np.float64]

LAUNCH: Final = State._fields
OF_ZONE: Final = dict(zip(Zone._fields, ("m", "m", "", "m", "m", "", "N/m"), strict=True))
PARAMETERS: Final = {
    **dict(zip(LAUNCH, ("m", "m", "rad", "m/s", "m/s", "rad/s"), strict=True)),
    "restitution": "",
    "friction": "",
    "rolling_arm": "m",
    "corner_rolling_arm": "m",
    "stiffness": "N/m",
    "angle": "rad",
    "length": "m",
    "gravity": "m/s^2",
    "mass": "kg",
    "radius": "m",
    "eccentricity": "m",
    "inertia": "kg m^2",
    "half_angle": "rad",
    # Of the zones of the slope, counted from 1.
    **{f"zone_{k}_{name}": unit for k in range(1, MOST_ZONES + 1) for name, unit in OF_ZONE.items()},
}
REBOUND_QUANTITIES: Final = {  # fields of REBOUND
    "t_touchdown": "s",
    "x_contact": "m",
    "u_before": "m/s",
    "v_before": "m/s",
    "omega_before": "rad/s",
    "t": "s",
    "x": "m",
    "phi": "rad",
    "u_after": "m/s",
    "v_after": "m/s",
    "omega_after": "rad/s",
}
STATE_AFTER: Final = ("x", "phi", "u_after", "v_after", "omega_after")  # y follows from phi: the body touches
END_QUANTITIES: Final = {
    "t": "s",
    **{name: PARAMETERS[name] for name in LAUNCH},
    **{name: SHOWN.get(name, Shown()).unit for name in DescentJam._fields},
}


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of a descent with respect to ``parameters``, of which there are P.

    Derivatives hold as long as the sequence of events stays: what touches, what slips, sticks, turns, closes and opens
    in each contact, in order, and how the descent ends. ``sides`` and ``distances`` tell how long that is.

    Attributes
    ----------
    descent : Descent
        The one that is looked at.
    parameters : tuple of str
        Names; their units are in ``PARAMETERS``.
    values, scales : ndarray, shape (P,)
        Values of the parameters, and the farthest change of each that was looked at.
    rebounds, rebound_errors : ndarray, shape (N, 11, P)
        Derivatives of what is in ``REBOUND_QUANTITIES`` at the first N rebounds, and the estimated error of each.
    end, end_errors : ndarray, shape (10, P)
        The same of what is in ``END_QUANTITIES`` when the descent has ended.
    sides : ndarray of int, shape (N + 1, P)
        0 where a derivative holds to both sides, as far as each rebound and in the end (the last row). 1 or -1 where it
        holds for more or for less of the parameter alone: to the other side another sequence of events, or what is not
        allowed, begins at once. 0 too where that is so to both sides; the derivative is then NaN.
    distances : ndarray, shape (N + 1, P, 2)
        How much less and how much more each parameter may be until the sequence of events changes in one of the
        rebounds up to this one, and in the whole descent (the last row). inf if it does not within ``scales`` and the
        range that the parameter is allowed; 0 if it does within 2^-32 of ``scales``. Known to 1e-7 of themselves. They
        are sought at distances that are halved again and again: a sequence that is back before twice the distance at
        which it was left may be missed.
    """

    descent: Descent
    parameters: tuple[str, ...]
    values: Floats
    scales: Floats
    rebounds: Floats
    rebound_errors: Floats
    end: Floats
    end_errors: Floats
    sides: NDArray[np.int64]
    distances: Floats

    def of_rebounds(self, quantity: str, parameter: str) -> Floats:
        """Derivative of a quantity at each rebound, shape (N,), such as ``of_rebounds("omega_after", "friction")``."""
        checked_choice("quantity", quantity, tuple(REBOUND_QUANTITIES))
        return self.rebounds[:, list(REBOUND_QUANTITIES).index(quantity), self._place(parameter)]

    def of_end(self, quantity: str, parameter: str) -> float:
        """Derivative of a quantity at the end of the descent, such as ``of_end("reward", "phi")``."""
        checked_choice("quantity", quantity, tuple(END_QUANTITIES))
        return float(self.end[list(END_QUANTITIES).index(quantity), self._place(parameter)])

    @property
    def growth(self) -> Floats:
        """Singular values of the derivative of the state after each rebound by the launch, shape (N, 5).

        The largest comes first: by so much a small difference of the launch may have grown. Differences are made
        comparable by :attr:`units`. NaN where a derivative is.

        Raises
        ------
        ValueError
            If a field of the launch is not among the parameters.
        """
        columns = [self._place(name) for name in LAUNCH]
        rows = [list(REBOUND_QUANTITIES).index(name) for name in STATE_AFTER]
        scale = self.units
        after = np.array([scale[LAUNCH.index(name.removesuffix("_after"))] for name in STATE_AFTER])
        matrices = self.rebounds[:, rows][:, :, columns] * scale / after[:, np.newaxis]
        known = np.isfinite(matrices).all(axis=(1, 2))
        values = np.full(matrices.shape[:2], np.nan)
        values[known] = np.linalg.svd(matrices[known], compute_uv=False)
        return values

    @property
    def units(self) -> Floats:
        """Natural units of x, y, phi, u, v and omega, shape (6,).

        They follow from the size of the body and the square root of gravity times size; without gravity from the speed.
        """
        return natural_units(self.descent.body, self.descent.slope, self.descent.launch)

    def _place(self, parameter: str) -> int:
        checked_choice("parameter", parameter, self.parameters)
        return self.parameters.index(parameter)


def natural_units(body: Body, slope: Slope, launch: State) -> Floats:
    """Units of x, y, phi, u, v and omega that suit a body."""
    size = body.size or 1.0
    speed = math.sqrt(slope.gravity * size) or math.hypot(launch.u, launch.v, size * launch.omega) or 1.0
    return np.array([size, size, 1.0, speed, speed, speed / size])
