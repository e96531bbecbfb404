"""SledDescent: choose the launch, then trim the spin at every rebound on the way down."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Unpack

import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from sledenv.envs.info import INFO_KEYS, episode_info, only_lane
from sledenv.envs.inputs import Contexts, checked_actions
from sledenv.envs.launch import SledLaunch
from sledenv.envs.task import FLIGHT, TaskOptions
from sledenv.scenarios.scenario import Scenario
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.records import Status
from sledenv.simulation.ride import Ride


class SledDescent(SledLaunch):
    """A sled on its way down, one hop a step: first the launch, then a trim of the spin at every rebound.

    Observation
        ``Box(-1, 1, (20,), float32)``: the eleven fields of the context as in :class:`SledLaunch`, then the flight, all
        0 before the launch: progress, sine and cosine of the orientation, velocity along and off the slope, spin, spin
        lent by the rider's rotor, time and number of rebounds; scaled as docs/environments.md says.
    Action
        ``Box(-1, 1, (k + 1,), float32)``: the launch as in :class:`SledLaunch`, then the trim. The first step uses
        the launch alone and follows the descent to its first rebound; every other one uses the trim alone: the spin
        that the rider's rotor lends to the body until the next rebound, scaled by the bound of the scenario. A
        scenario without a rider ignores it.
    Reward
        That of the whole descent in the last step, 0 before; the work of the trims counts as energy supplied. Without
        any trim the return is the reward of :class:`SledLaunch`, bit for bit.
    Ending
        Terminated when the sled finishes or jams, and where the rules of the scenario say so, such as where the rider
        touches; truncated at a limit of the scenario.
    Info
        As for :class:`SledLaunch`, of the descent so far.

    Parameters
    ----------
    scenario, control, render_mode, solver, split, launch_noise, observe, info
        As for :class:`SledLaunch`; the window shows each hop as it is made.
    """

    _episode = SledLaunch._episode | {"_ride": (Ride, type(None))}

    def __init__(
        self,
        scenario: str | os.PathLike[str] | Scenario = "sled_snow",
        control: str | None = None,
        render_mode: str | None = None,
        *,
        info: Sequence[str] = INFO_KEYS,
        **task: Unpack[TaskOptions],
    ) -> None:
        super().__init__(scenario, control, render_mode, info=info, **task)
        self.observation_space = self.task.ride_observation_space
        self.action_space = self.task.ride_action_space
        self.observation_names, self.action_names = self.task.ride_observation_names, self.task.ride_action_names
        self._ride: Ride | None = None  # of the present episode, once it has been launched

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode in a new context, as :meth:`SledLaunch.reset` does."""
        observation, info = super().reset(seed=seed, options=options)
        return np.append(observation, np.zeros(len(FLIGHT), np.float32)), info

    def enter(self, context: Contexts) -> None:
        """Begin an episode in a context that another environment has drawn, as :meth:`SledLaunch.enter` does."""
        self._ride = None
        super().enter(context)

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Launch the sled, or trim it, and follow it to its next rebound or to the end of the descent.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset and after the end of an episode.
        gymnasium.error.InvalidAction
            For an action outside the action space; the episode goes on.
        """
        if self._context is None or (self._ride is not None and self._ride.status != Status.RUNNING):
            raise ResetNeeded("call reset before step: there is no descent under way")
        chosen = checked_actions(self.action_space, [action], 1)
        if self._ride is None:
            launch = self.task.launch(self._context, chosen[:, :-1])
            ride = self.task.ride(self._context, launch, record="trajectory" if self.render_mode else "rebounds")
            ride.hop()
            self._launch, self._ride = launch, ride
        else:
            ride = self._ride
            if self.task.scenario.rider is not None:
                ride.trim(self.task.trims(chosen[0, -1]).item())
            ride.hop()
        if self.render_mode == "human":
            self._drawing().play(self._unseen())
        descent = ride.descent()
        batch = descent.as_batch()
        rewards, terminated, truncated = self.task.verdict(batch)
        observation = np.append(self.task.observe(self._context)[0], self.task.observe_flights(batch.outcomes)[0])
        launches = np.array([self._launch])
        info = only_lane(episode_info(self._context, launches, batch, self.info_keys))
        return observation, rewards.item(), terminated.item(), truncated.item(), info

    def _recorded(self) -> Descent:
        assert self._ride is not None
        return self._ride.descent()
