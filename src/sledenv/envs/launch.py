"""SledLaunch: choose the initial orientation and spin, then the whole descent runs in one step."""

from __future__ import annotations

import os
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from sledenv.envs.render import DescentRenderer
from sledenv.envs.task import Contexts, Control, Task, checked_actions, only_lane
from sledenv.scenario import Context, Scenario


class SledLaunch(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A one-step environment: from the context of a launch to its orientation and/or spin.

    Observation
        ``Box(-1, 1, (8,), float32)``: slope angle, friction, restitution, speed, drop, fall, orientation and spin of
        the context, scaled by the ranges of the scenario. What does not vary and what the agent controls reads 0.
    Action
        ``Box(-1, 1, (1,) or (2,), float32)``: orientation and/or spin at launch, scaled to the control bounds.
    Reward
        progress / 2 + sqrt(retention) / 2 in [0, 1]; see :mod:`sledenv.jam` and docs/environments.md.
    Ending
        Every episode terminates after its one step.
    Info
        ``context``, ``rebounds`` (a dict of columns, one entry a rebound), ``jam``, ``is_success`` and ``descent``
        (status, time, energy).

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    control : {"both", "orientation", "spin"}
        What the agent chooses; the rest is a disturbance that it observes.
    render_mode : {"human", "rgb_array"}, optional
        A window that plays the descent, or one picture of it.

    Notes
    -----
    ``reset(options={"context": Context(...)})`` fixes the context instead of drawing it.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 30}
    action_space: spaces.Box  # type: ignore[assignment]

    def __init__(
        self,
        scenario: str | os.PathLike[str] | Scenario = "brake_mat",
        control: Control = "both",
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode = {render_mode!r}: must be one of {self.metadata['render_modes']}")
        self.task = Task(scenario, control)
        self.observation_space = self.task.observation_space
        self.action_space = self.task.action_space
        self.render_mode = render_mode
        self._renderer: DescentRenderer | None = None
        self._context: Contexts | None = None  # one lane
        self._launch: NDArray[np.float64] | None = None  # of the last step; None while a launch is awaited

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Draw a context, or take ``options["context"]``.

        Raises
        ------
        ValueError
            For an unknown option, or naming the field of a context that cannot be simulated.
        """
        given = dict(options or {})
        context = given.pop("context", None)
        if given:
            raise ValueError(f"unknown option {next(iter(given))!r}: 'context' is the only one")
        fixed = None if context is None else self.task.given(context)
        super().reset(seed=seed)
        self._context = self.task.draw(self.np_random.random((1, self.task.draws))) if fixed is None else fixed
        self._launch = None
        if self.render_mode == "human":
            self._show()
        return self.task.observe(self._context)[0], only_lane({"context": self.task.context_info(self._context)})

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Run the whole descent.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset and after the end of an episode.
        gymnasium.error.InvalidAction
            For an action outside the action space; the episode goes on.
        """
        if self._context is None or self._launch is not None:
            raise ResetNeeded("call reset before step: an episode has one step")
        launch = self.task.launches(self._context, checked_actions(self.action_space, [action], 1))
        descent = self.task.descend(self._context, launch)
        self._launch = launch
        if self.render_mode == "human":
            self._show()
        info = self.task.info(self._context, descent.as_batch())
        return self.task.observe(self._context)[0], float(descent.jam.reward), True, False, only_lane(info)

    def render(self) -> NDArray[np.uint8] | None:
        """Return a picture of the launch, or of the whole descent after the step: shape (H, W, 3), uint8."""
        if self._context is None:
            raise ResetNeeded("call reset before render")
        if self.render_mode is None:
            gym.logger.warn("render is called without a render_mode: give one to gym.make")
            return None
        if self.render_mode == "human":
            return None  # drawn by reset and step
        renderer = self._drawing()
        if self._launch is None:
            return self._launch_frame()
        return renderer.strobe(self.task.descend(self._context, self._launch, record="trajectory"))

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _drawing(self) -> DescentRenderer:
        if self._renderer is None:
            self._renderer = DescentRenderer(self.task.body, fps=self.metadata["render_fps"])
        return self._renderer

    def _launch_frame(self) -> NDArray[np.uint8]:
        assert self._context is not None
        context = Context(*self._context[0].tolist())
        scenario = self.task.scenario
        return self._drawing().launch_frame(scenario.slope(context), scenario.launch(context))

    def _show(self) -> None:
        assert self._context is not None
        renderer = self._drawing()
        if self._launch is None:
            renderer.show(self._launch_frame())
        else:
            renderer.play(self.task.descend(self._context, self._launch, record="trajectory"))
