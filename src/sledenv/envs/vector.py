"""Native vector environments: all lanes advance in one call of the batch kernel."""

from __future__ import annotations

import os
import reprlib
import sys
from collections.abc import Sequence
from typing import Any, Unpack

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.core import RenderFrame
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from sledenv.envs.episodes import DescentEpisodes, Episodes, Flags, Floats, LaunchEpisodes, Snapshot
from sledenv.envs.info import INFO_KEYS
from sledenv.envs.inputs import checked_actions, checked_options, read_options
from sledenv.envs.spec import OfAnyFolder
from sledenv.envs.task import Task, TaskOptions, check_options
from sledenv.envs.viewer import METADATA
from sledenv.scenarios.scenario import Scenario
from sledenv.simulation.lanes import check_room
from sledenv.simulation.rules import checked_count, checked_seed
from sledenv.simulation.scenes import Lanes

CHEAP_INFO = tuple(key for key in INFO_KEYS if key != "rebounds")

_LANE = 1024  # bytes that a lane takes at least


class SledVectorEnv(OfAnyFolder, VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """Many lanes of one task: seeds, resets, autoreset and info, whatever an episode consists of.

    Lane i of ``reset(seed=s)`` gives, bit for bit, the episodes of the scalar environment after ``reset(seed=s + i)``,
    whatever the number of lanes: like :class:`gymnasium.vector.SyncVectorEnv`, in observations, rewards, endings and
    info.

    With Gymnasium's default autoreset mode, ``"NextStep"``, every second step of SledLaunch is the reset of all lanes:
    it ignores the actions and rewards 0. ``autoreset_mode="SameStep"`` has none of these.

    Parameters
    ----------
    num_envs : int
        Number of lanes, >= 1.
    scenario, control, solver, split, launch_noise, observe
        As for :class:`sledenv.envs.launch.SledLaunch`, shared by all lanes.
    autoreset_mode : AutoresetMode or str
        When an ended lane begins its next episode: ``"NextStep"`` (Gymnasium's default, spends a step on it),
        ``"SameStep"`` or ``"Disabled"``.
    info : sequence of str
        Entries of the scalar environment's info to give: all but "rebounds" by default, which cost more than the rest.
    render_mode : str, optional
        As for :class:`sledenv.envs.launch.SledLaunch`.
    max_episode_steps : int, optional
        After how many steps an episode is truncated, as by :class:`gymnasium.wrappers.TimeLimit`. That of an id ends no
        episode of the shipped scenarios.

    Attributes
    ----------
    observation_names, action_names : tuple of str
        What the entries of one lane's observation and action are.
    """

    single_action_space: spaces.Box
    _kind: type[Episodes]

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | os.PathLike[str] | Scenario = "sled_snow",
        control: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        info: Sequence[str] = CHEAP_INFO,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        **task: Unpack[TaskOptions],
    ) -> None:
        check_options(type(self), task)
        if isinstance(num_envs, bool) or not isinstance(num_envs, int | np.integer) or num_envs < 1:
            raise ValueError(f"num_envs = {num_envs!r}: must be an integer >= 1")
        if num_envs > sys.maxsize:
            raise ValueError(f"num_envs = {reprlib.repr(num_envs)}: must be an integer in [1, {sys.maxsize}]")
        check_room(int(num_envs) * _LANE, f"num_envs = {num_envs!r}: as many lanes", "lower it")
        if max_episode_steps is not None:
            max_episode_steps = checked_count("max_episode_steps", max_episode_steps)
        try:
            mode = AutoresetMode(autoreset_mode)
        except ValueError:
            modes = ", ".join(repr(mode.value) for mode in AutoresetMode)
            raise ValueError(f"autoreset_mode = {autoreset_mode!r}: must be one of {modes}") from None
        self.task = Task(scenario, control, ride=self._kind.by_hops, **task)
        self.num_envs = int(num_envs)
        self.episodes = self._kind(self.task, self.num_envs, info, render_mode, max_episode_steps)
        self.single_observation_space = self.episodes.observation_space
        self.single_action_space = self.episodes.action_space
        self.observation_names, self.action_names = self.episodes.observation_names, self.episodes.action_names
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.info_keys = self.episodes.info_keys
        self.autoreset_mode = mode
        self.metadata = METADATA | {"autoreset_mode": mode}
        self.max_episode_steps = max_episode_steps
        self.render_mode = render_mode

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode in every lane, or in some.

        Parameters
        ----------
        seed : int or sequence of int or None, optional
            Lane i is seeded with ``seed + i``, or with an entry of its own; a lane without goes on with its stream.
        options : dict, optional
            ``context``, ``split``: what is fixed of the contexts of all lanes, see
            :func:`sledenv.envs.inputs.read_options`.
            ``reset_mask``: bool array of shape (num_envs,), the lanes to reset; all by default.

        Returns
        -------
        observations : ndarray of float32, shape (num_envs, ...)
            Lanes that are not reset keep theirs.
        info : dict

        Raises
        ------
        ValueError, TypeError
            For an unknown option, or a wrong mask, context or seed; nothing has changed then.
        gymnasium.error.ResetNeeded
            If the very first reset leaves lanes out.
        """
        given = checked_options(options)
        mask = given.pop("reset_mask", None)
        lanes = np.arange(self.num_envs) if mask is None else np.flatnonzero(self._checked_mask(mask))
        if not self.episodes.begun and len(lanes) < self.num_envs:
            raise ResetNeeded("the first reset must be one of all lanes")
        seeds = self._checked_seeds(seed, lanes)
        fixed = read_options(given, self.task.split, self.num_envs, ("reset_mask",)).of(lanes)
        self.task.check(fixed)
        if lanes[0] == 0 and seeds[0] is not None:
            super().reset(seed=seeds[0])  # np_random, which is nobody's lane
        self.episodes.seed(lanes, seeds)
        info: dict[str, Any] = {}
        self._add_infos(info, self.episodes.begin(lanes, fixed), lanes)
        return self.episodes.seen.copy(), info

    def step(self, actions: NDArray[np.float32]) -> tuple[NDArray[np.float32], Floats, Flags, Flags, dict[str, Any]]:
        """Advance every lane by one step; a lane that is reset by it ("NextStep") ignores its action.

        Parameters
        ----------
        actions : ndarray, shape (num_envs, k)

        Returns
        -------
        observations, rewards, terminated, truncated, info
            New arrays of num_envs rows; info in Gymnasium's vector form, each ``key`` with a mask ``_key``.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset, or if a lane has ended and its reset is left to the caller ("Disabled").
        gymnasium.error.InvalidAction
            Naming the lane; no lane has advanced then.
        """
        episodes, ended = self.episodes, self.episodes.ended
        if not episodes.begun:
            raise ResetNeeded("call reset before step")
        if self.autoreset_mode is AutoresetMode.DISABLED and ended.any():
            lane = int(np.argmax(ended))
            raise ResetNeeded(f"lane {lane} has ended: reset it, with options={{'reset_mask': ...}} it alone")
        rewards = np.zeros(self.num_envs)
        terminated, truncated = np.zeros((2, self.num_envs), np.bool_)
        info: dict[str, Any] = {}
        waiting, lanes = np.flatnonzero(ended), np.flatnonzero(~ended)
        names = self.task.action_names
        chosen = checked_actions(self.single_action_space, names, actions, self.num_envs, lanes)
        if lanes.size:
            step = episodes.step(lanes, chosen[lanes])
            rewards[lanes], terminated[lanes], truncated[lanes] = step.rewards, step.terminated, step.truncated
        if waiting.size:
            self._add_infos(info, episodes.begin(waiting), waiting)
        observations = episodes.seen.copy()
        done = np.flatnonzero(terminated | truncated)
        if self.autoreset_mode is AutoresetMode.SAME_STEP and done.size:  # all lanes stepped: none waits in this mode
            final_obs = np.fromiter(observations[done], dtype=object, count=len(done))
            self._add_infos(info, {"final_obs": final_obs, "final_info": _rows(step.info, done)}, done)
            kept = np.setdiff1d(lanes, done)
            if kept.size:
                self._add_infos(info, _rows(step.info, kept), kept)
            self._add_infos(info, episodes.begin(done), done)
            observations[done] = episodes.seen[done]
        elif lanes.size:
            self._add_infos(info, step.info, lanes)
        return observations, rewards, terminated, truncated, info

    def render(self) -> tuple[RenderFrame, ...] | None:
        """Return what the scalar environment in place of each lane would, as :class:`SyncVectorEnv` does.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset.
        """
        if self.render_mode is None:
            gym.logger.warn("render is called without a render_mode: give one to gym.make_vec")
            return None
        if not self.episodes.begun:
            raise ResetNeeded("call reset before render")
        frames: Any = tuple(viewer.render() for viewer in self.episodes.viewers)  # None each in a window
        return frames  # type: ignore[no-any-return]

    def close_extras(self, **kwargs: Any) -> None:
        """Close the windows, if there are any."""
        if hasattr(self, "episodes"):  # Gymnasium before 1.3 also closes what was refused by __init__
            for viewer in self.episodes.viewers:
                viewer.close()

    def snapshot(self) -> Snapshot:
        """Return where all lanes stand, their random streams included, as :meth:`SledLaunch.snapshot` does for one.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset.
        """
        return self.episodes.snapshot(self._identity())

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot: what follows is, bit for bit, what would have followed there.

        Parameters
        ----------
        snapshot : Snapshot
            Of this batch or of another one with the same arguments.

        Raises
        ------
        TypeError, ValueError
            If it is no snapshot, or one of another task; the batch stays where it is.
        """
        self.episodes.restore(snapshot, self._identity())

    def _identity(self) -> dict[str, Any]:
        batch = {"num_envs": self.num_envs, "autoreset_mode": self.autoreset_mode.value}
        return {"environment": type(self).__name__} | batch

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]  # as in SyncVectorEnv
        """Seed of each lane, None before the first reset."""
        return tuple(self.episodes.seeds)

    def _checked_mask(self, mask: Any) -> Flags:
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise TypeError(f"options['reset_mask'] = {mask!r}: must be an array of bool")
        if mask.shape != (self.num_envs,):
            raise ValueError(f"options['reset_mask'] has shape {mask.shape}: must be ({self.num_envs},)")
        if not mask.any():
            raise ValueError("options['reset_mask'] has no lane to reset: at least one entry must be True")
        return mask

    def _checked_seeds(self, seed: Any, lanes: Lanes) -> list[int | None]:
        """Return the seed of each of some lanes, or raise TypeError or ValueError."""
        if isinstance(seed, int | np.integer):
            first = checked_seed(seed)
            return [first + i for i in lanes.tolist()]
        if seed is None:
            return [None] * len(lanes)
        if isinstance(seed, str) or not (isinstance(seed, Sequence) or (isinstance(seed, np.ndarray) and seed.ndim)):
            raise TypeError(f"seed = {seed!r}: must be an integer >= 0, or a sequence of one per lane")
        if len(seed) != self.num_envs:
            raise ValueError(f"seed has {len(seed)} entries: must be one per lane, {self.num_envs}")
        owns = [(i, seed[i]) for i in lanes.tolist()]
        return [None if own is None else checked_seed(own, f"seed[{i}]") for i, own in owns]

    def _add_infos(self, infos: dict[str, Any], columns: dict[str, Any], lanes: Lanes) -> None:
        """Add the info of some lanes, a row each: what ``VectorEnv._add_info`` does for one."""
        told = np.zeros(self.num_envs, np.bool_)
        told[lanes] = True
        for key, value in columns.items():
            if isinstance(value, dict):
                self._add_infos(infos.setdefault(key, {}), value, lanes)
            else:
                if key not in infos:
                    made = np.empty if value.dtype == object else np.zeros  # of empty objects each is None
                    infos[key] = made(self.num_envs, value.dtype)
                infos[key][lanes] = value
            mask = f"_{key}"
            infos[mask] = infos[mask] | told if mask in infos else told.copy()


# VectorEnv is named once more, as skrl looks for it among the direct bases of a batch alone.
class SledLaunchVector(SledVectorEnv, VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """Many :class:`sledenv.envs.launch.SledLaunch` at once: each step runs one whole descent in every lane.

    The arguments are those of :class:`SledVectorEnv`.
    """

    _kind = LaunchEpisodes


class SledDescentVector(SledVectorEnv, VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
    """Many :class:`sledenv.envs.descent.SledDescent` at once: each step runs one flight worth a decision in every lane.

    The arguments are those of :class:`SledVectorEnv` but ``control``.
    """

    _kind = DescentEpisodes

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | os.PathLike[str] | Scenario = "sled_rollers",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        info: Sequence[str] = CHEAP_INFO,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        **task: Unpack[TaskOptions],
    ) -> None:
        check_options(type(self), task)
        super().__init__(num_envs, scenario, None, autoreset_mode, info, render_mode, max_episode_steps, **task)


def _rows(columns: dict[str, Any], lanes: Lanes) -> dict[str, Any]:
    """Select rows of arrays in dicts."""
    return {key: _rows(value, lanes) if isinstance(value, dict) else value[lanes] for key, value in columns.items()}
