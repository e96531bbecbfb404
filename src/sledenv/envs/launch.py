"""SledLaunch: choose how the sled is let go, then the whole descent runs in one step."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.core import RenderFrame
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from sledenv.envs.episodes import Episodes, LaunchEpisodes, Snapshot
from sledenv.envs.info import INFO_KEYS, only_lane
from sledenv.envs.inputs import checked_actions, read_options
from sledenv.envs.spec import OfAnyFolder
from sledenv.envs.task import Task, TaskOptions, check_options
from sledenv.envs.viewer import METADATA
from sledenv.scenarios.scenario import Scenario
from sledenv.simulation.rules import checked_seed
from sledenv.simulation.scenes import Lanes

_ONLY: Lanes = np.zeros(1, np.intp)  # number of the only lane


class SledLaunch(OfAnyFolder, gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A one-step environment: from the context of a launch to what an agent chooses of it.

    Observation
        ``Box(-1, 1, (11,), float32)``: slope angle, friction, restitution, speed, drop, fall, orientation, spin, begin
        and friction of the zone that is drawn, and number of the body of the context, scaled by the ranges of the
        scenario. What does not vary, what ``observe`` leaves out and what the agent controls reads 0. Where there is a
        profile, 24 entries more: x, y and whether it is there of each of the first eight vertices, and its radius where
        any is rounded.
    Action
        ``Box(-1, 1, (k,), float32)``: what ``control`` names of the launch, scaled to the control bounds.
    Reward
        progress / 2 + sqrt(retention) / 2 in [0, 1]; see :mod:`sledenv.simulation.jam` and docs/environments.md.
    Ending
        Every episode terminates after its one step.
    Info
        ``context``; ``launch``, the orientation [rad], spin [rad/s] and speed [m/s] with which the body was let go, its
        error included; ``rebounds`` (a dict of columns, one entry per rebound), ``jam``, ``is_success`` and ``descent``
        (status, an index of ``sledenv.simulation.STATUS_OF_CODE``, time, energy).

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    control : str, optional
        What the agent chooses, such as "both", orientation and spin; the rest is a disturbance that it observes.
        docs/environments/launch.md lists the words. That of the scenario by default.
    render_mode : {"human", "rgb_array"}, optional
        A window that plays the descent, or a picture of where it stands.
    solver : {"compliant", "rigid"}
        Which contact is simulated, as for :func:`sledenv.simulate`.
    split : {"train", "validation", "test"}, optional
        Draw contexts of this split alone; no two splits have one in common, whatever the seeds.
    launch_noise : pair of float, optional
        Standard deviations of normal errors of the orientation [rad] and the spin [rad/s] at launch; those of
        the scenario by default. (0, 0) launches exactly.
    observe : "all" or sequence of str
        Fields of the context that the agent sees; the others vary as before, but read 0.
    info : sequence of str
        Entries of info to give, all by default. Without "rebounds" every value has the same form at every step, as some
        collectors of other libraries need.

    Attributes
    ----------
    observation_names, action_names : tuple of str
        What the entries of an observation and of an action are.

    Notes
    -----
    ``reset(options={"context": {"friction": 0.3}})`` fixes part of the context, or all of it by a ``Context(...)``;
    ``options={"split": "test"}`` draws the rest from another split.
    """

    metadata = METADATA
    observation_space: spaces.Box  # type: ignore[assignment]
    action_space: spaces.Box  # type: ignore[assignment]
    _kind: type[Episodes] = LaunchEpisodes

    def __init__(
        self,
        scenario: str | os.PathLike[str] | Scenario = "sled_snow",
        control: str | None = None,
        render_mode: str | None = None,
        *,
        info: Sequence[str] = INFO_KEYS,
        **task: Unpack[TaskOptions],
    ) -> None:
        check_options(type(self), task)
        self.task = Task(scenario, control, ride=self._kind.by_hops, **task)
        self.episodes = self._kind(self.task, 1, info, render_mode)
        self.observation_space = self.episodes.observation_space
        self.action_space = self.episodes.action_space
        self.observation_names: tuple[str, ...] = self.episodes.observation_names
        self.action_names: tuple[str, ...] = self.episodes.action_names
        self.info_keys = self.episodes.info_keys
        self.render_mode = render_mode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode in a new context.

        Parameters
        ----------
        seed : int, optional
            Of the random stream, which goes on without.
        options : dict, optional
            ``context`` and ``split``: what is fixed of the context, see :func:`sledenv.envs.inputs.read_options`. The
            random stream stays where it is if nothing is left to be drawn.

        Raises
        ------
        TypeError, ValueError
            For a wrong seed, an unknown option, or naming the field of a context that cannot be simulated; the episode
            goes on.
        """
        given = read_options(options, self.task.split)
        self.task.check(given)
        super().reset(seed=None if seed is None else checked_seed(seed))
        self.episodes.generators[0] = self.np_random
        info = self.episodes.begin(_ONLY, given)
        return self.episodes.seen[0].copy(), only_lane(info)

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Run the whole descent, or in :class:`sledenv.envs.descent.SledDescent` to the next flight worth a decision.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset and after the end of an episode.
        gymnasium.error.InvalidAction
            For an action outside the action space; the episode goes on.
        """
        episodes = self.episodes
        if not episodes.begun or episodes.ended[0]:
            raise ResetNeeded("call reset before step: no episode is under way")
        step = episodes.step(_ONLY, checked_actions(self.action_space, self.task.action_names, action))
        ends = step.terminated.item(), step.truncated.item()
        return episodes.seen[0].copy(), step.rewards.item(), *ends, only_lane(step.info)

    def render(self) -> RenderFrame | None:
        """Return what the render mode asks for.

        Returns
        -------
        ndarray of uint8, shape (H, W, 3), or None
            "rgb_array": a picture of the launch, or of the end of the descent so far. "human": None, the window is
            drawn by ``reset`` and ``step``.
        """
        self._check_begun("render")
        if self.render_mode is None:
            gym.logger.warn("render is called without a render_mode: give one to gym.make")
        return self.episodes.viewers[0].render()

    def film(self) -> Iterator[NDArray[np.uint8]]:
        """Draw the film of all that has happened since the last call or the reset, one picture after the other.

        There are ``metadata["render_fps"]`` of them per second of the descent, and no render mode is needed.
        :func:`sledenv.envs.film.write_film` makes a file of it.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset.
        """
        self._check_begun("film")
        return self.episodes.viewers[0].film()

    def snapshot(self) -> Snapshot:
        """Return where the environment stands; what is done with it later does not change the snapshot.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset.
        """
        self.episodes.generators[0] = self.np_random
        return self.episodes.snapshot(self._identity())

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot: what follows is, bit for bit, what would have followed there.

        Parameters
        ----------
        snapshot : Snapshot
            Of this environment or of another one with the same arguments.

        Raises
        ------
        TypeError, ValueError
            If it is no snapshot, or one of another task; the environment stays where it is.
        """
        self.episodes.restore(snapshot, self._identity())
        (generator,) = self.episodes.generators
        assert generator is not None
        self.np_random = generator

    def close(self) -> None:
        """Close the window, if there is one."""
        self.episodes.viewers[0].close()

    def _identity(self) -> dict[str, Any]:
        return {"environment": type(self).__name__}

    def _check_begun(self, call: str) -> None:
        if not self.episodes.begun:
            raise ResetNeeded(f"call reset before {call}")
