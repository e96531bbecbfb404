"""What every environment shares: observation of a context, launch of an action, reward and info."""

from __future__ import annotations

import os
from typing import Any, Literal, get_args

import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction
from numpy.typing import NDArray

from sledenv.descent import Descent, Record, simulate
from sledenv.kernel.params import State
from sledenv.kernel.records import REBOUND, Status
from sledenv.scenario import Context, Scenario, load_scenario

Control = Literal["both", "orientation", "spin"]

_CONTROLLED: dict[str, tuple[str, ...]] = {
    "both": ("orientation", "spin"),
    "orientation": ("orientation",),
    "spin": ("spin",),
}


class Task:
    """A scenario and what the agent controls of its launch.

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    control : {"both", "orientation", "spin"}
        Which of the launch the agent chooses; the rest is part of the context.

    Raises
    ------
    ScenarioError, ValueError
        For an unknown scenario or control.
    """

    def __init__(self, scenario: str | os.PathLike[str] | Scenario, control: Control) -> None:
        if control not in get_args(Control):
            raise ValueError(f"control = {control!r}: must be one of {', '.join(map(repr, get_args(Control)))}")
        self.scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
        self.controlled = _CONTROLLED[control]
        self.body = self.scenario.body()
        self._context_low, self._context_high = self.scenario.ranges
        self._seen = np.array([name not in self.controlled for name in Context._fields])
        bounds = {
            "orientation": np.radians(self.scenario.control.orientation_deg),
            "spin": np.array(self.scenario.control.spin_rad_s),
        }
        self._action_low, self._action_high = np.array([bounds[name] for name in self.controlled]).T.copy()
        self.observation_space = spaces.Box(-1.0, 1.0, (len(Context._fields),), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (len(self.controlled),), np.float32)

    def observe(self, context: Context) -> NDArray[np.float32]:
        """Scale a context to [-1, 1] by the ranges of the scenario, float32 of shape (8,).

        What does not vary and what the agent controls reads 0.
        """
        width = self._context_high - self._context_low
        varies = self._seen & (width > 0.0)
        centred = 2.0 * (np.array(context) - self._context_low) / np.where(width > 0.0, width, 1.0) - 1.0
        return np.where(varies, np.clip(centred, -1.0, 1.0), 0.0).astype(np.float32)

    def launch(self, context: Context, action: Any) -> State:
        """Return the state at launch that ``action`` asks for.

        Parameters
        ----------
        context : Context
        action : array_like, shape (1,) or (2,)
            In [-1, 1], scaled to the control bounds of the scenario: orientation and/or spin.

        Raises
        ------
        gymnasium.error.InvalidAction
            If it has another shape, is not a number or lies outside the box.
        """
        given = np.asarray(action, dtype=np.float64)
        if given.shape != self._action_low.shape:
            raise InvalidAction(f"action has shape {given.shape}: must be {self._action_low.shape}")
        if not np.all(np.abs(given) <= 1.0):  # NaN fails too
            raise InvalidAction(f"action = {given.tolist()}: must be within [-1, 1]")
        chosen = self._action_low + 0.5 * (given + 1.0) * (self._action_high - self._action_low)
        return self.scenario.launch(context, **dict(zip(self.controlled, chosen.tolist(), strict=True)))

    def descend(self, context: Context, launch: State, record: Record = "rebounds") -> Descent:
        """Simulate the descent of ``launch`` in ``context``."""
        return simulate(
            self.body,
            self.scenario.law(context),
            self.scenario.slope(context),
            launch,
            max_time=self.scenario.limits.max_time_s,
            max_rebounds=self.scenario.limits.max_rebounds,
            record=record,
        )

    @staticmethod
    def reward(descent: Descent) -> float:
        """Half the progress and half the root of the retained energy, in [0, 1]: docs/environments.md."""
        return float(descent.jam.reward)

    @staticmethod
    def info(context: Context, descent: Descent) -> dict[str, Any]:
        """Everything about a descent that an agent may not see but its user wants to."""
        jam = descent.jam
        return {
            "context": context._asdict(),
            # Columns, not a structured array: Gymnasium's checker compares infos and knows no structured types.
            "rebounds": {name: descent.rebounds[name].copy() for name in REBOUND.names or ()},
            "jam": {
                "progress": float(jam.progress),
                "retention": float(jam.retention),
                "jam_index": float(jam.jam_index),
            },
            "is_success": descent.status == Status.FINISH,
            "descent": {
                "status": str(descent.status),
                "time": descent.time,
                "energy": descent.energy._asdict(),
            },
        }
