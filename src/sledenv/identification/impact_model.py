"""How the velocities after rebounds follow from restitution, friction and rolling arms, and the fit of these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from sledenv.identification.fitting import Fit, solve
from sledenv.identification.objective import Floats, Loss, Parameter, Problem
from sledenv.identification.rebounds import Rebounds
from sledenv.simulation.rigid_impact import Hypothesis, velocities_after
from sledenv.simulation.rules import checked_bounds, checked_mapping

_MOST_FRICTION = 2.0
_MOST_SOFTENING = 1.0
_LOSS_SCALE = 0.1  # relative to the speed before
_USUAL = {"restitution": 0.5, "friction": 0.2}  # where the first start begins; arms and softening from 0
_STARTS = 16
_FEW_STARTS = 8  # of each part of the data in a comparison


class FitSettings(TypedDict, total=False):
    """How a law is fitted to rebounds: what :meth:`ImpactModel.fit` takes by name."""

    start: Mapping[str, float] | None
    bounds: Mapping[str, tuple[float, float]] | None
    loss: Loss
    loss_scale: float
    starts: int
    seed: int


@dataclass(frozen=True)
class ImpactModel:
    """How rebounds follow from parameters, and which of these are not fitted.

    Attributes
    ----------
    hypothesis : {"energetic", "poisson", "newton"}
        What the restitution means: docs/physics.md, section 4.
    fixed : dict
        Values of parameters that are not fitted.
    reference_speed : float
        Approach speed [m/s] at which the restitution is ``restitution``. With a ``softening`` q it is
        ``restitution (v/reference_speed)^-q`` at the approach speed v, at most 1: the power law of the theory of
        plastic impact, in which q is 1/4 (Johnson 1985, Contact Mechanics, section 11.5).
    """

    hypothesis: Hypothesis = "energetic"
    fixed: Mapping[str, float] = field(default_factory=lambda: {"softening": 0.0})
    reference_speed: float = 1.0

    def parameters(self, gyration_radius: float) -> tuple[Parameter, ...]:
        """What may be fitted; an arm of rolling resistance is at most the radius of gyration."""
        k = gyration_radius
        return (
            Parameter("restitution", "", 0.0, 1.0, 0.1),
            Parameter("friction", "", 0.0, _MOST_FRICTION, 0.1),
            Parameter("rolling_arm", "m", 0.0, k, 0.1 * k),
            Parameter("corner_rolling_arm", "m", 0.0, k, 0.1 * k),
            Parameter("softening", "", -_MOST_SOFTENING, _MOST_SOFTENING, 0.1),
        )

    def velocities(self, rebounds: Rebounds, values: Floats) -> Floats:
        """Velocities after, shape (N, 3): u, v [m/s], omega [rad/s]; for values of all parameters in their order."""
        e, friction, arm, corner_arm, softening = values
        laws = np.empty((len(rebounds), 3))
        laws[:, 0] = e
        if softening != 0.0:
            laws[:, 0] = np.minimum(e * (rebounds.approach / self.reference_speed) ** -softening, 1.0)
        laws[:, 1] = friction
        laws[:, 2] = np.where(rebounds.corner, corner_arm, arm)
        return velocities_after(rebounds.gyration_radius, rebounds.contacts, laws, self.hypothesis)

    def __call__(self, train: Rebounds, test: Rebounds) -> Floats:
        """Fit to some rebounds and predict the velocities after others, shape (N, 3)."""
        return self.velocities(test, self.fit(train, starts=_FEW_STARTS).vector)

    def fit(
        self,
        rebounds: Rebounds,
        start: Mapping[str, float] | None = None,
        *,
        bounds: Mapping[str, tuple[float, float]] | None = None,
        loss: Loss = "soft_l1",
        loss_scale: float = _LOSS_SCALE,
        starts: int = _STARTS,
        seed: int = 0,
    ) -> Fit:
        """Fit the parameters that are not fixed; its arguments are those of :func:`sledenv.identify`.

        Raises
        ------
        ValueError
            Naming an argument, or if the rebounds are too few for the parameters.
        """
        unused = {} if rebounds.corner.any() else {"corner_rolling_arm": 0.0}
        if rebounds.corner.all():
            unused = {"rolling_arm": 0.0}
        limits = checked_bounds(bounds)
        parameters = self.parameters(rebounds.gyration_radius)
        for name in limits:
            if name not in [one.name for one in parameters]:
                raise ValueError(f"bounds: {name!r} is no parameter")
        problem = Problem(
            [one._replace(low=low, high=high) for one in parameters for low, high in [limits.get(one.name, one[2:4])]],
            lambda values: rebounds.residuals(self.velocities(rebounds, values)),
            {**unused, **self.fixed},
            rebounds.recordings,
            loss,
            loss_scale,
        )
        equations = 3 * len(rebounds)
        if equations <= len(problem.free):
            raise ValueError(
                f"{len(rebounds)} rebounds: their {equations} velocities would follow from many values of the "
                f"{len(problem.free)} parameters that are fitted ({', '.join(problem.free)}), and no interval; give "
                f"more rebounds than {len(problem.free) / 3:.3g}, or fix parameters"
            )
        usual = {one.name: min(max(_USUAL.get(one.name, 0.0), one.low), one.high) for one in problem.parameters}
        return solve(problem, {**usual, **checked_mapping("start", start)}, starts=starts, seed=seed)
