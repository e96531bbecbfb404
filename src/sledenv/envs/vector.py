"""Native vector environments: all lanes advance in one call of the batch kernel."""

from __future__ import annotations

import copy
import os
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Unpack

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.core import RenderFrame
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from sledenv.envs.descent import SledDescent
from sledenv.envs.info import INFO_KEYS, checked_info, context_info, episode_info
from sledenv.envs.inputs import FIELDS, Contexts, Given, checked_actions, read_options
from sledenv.envs.launch import SledLaunch, Snapshot, check_snapshot
from sledenv.envs.streams import Floats, Lanes, Streams
from sledenv.envs.task import Task, TaskOptions, check_options
from sledenv.scenarios.scenario import Scenario
from sledenv.simulation.lanes import check_room
from sledenv.simulation.ride import RideBatch
from sledenv.simulation.rules import checked_count, checked_seed
from sledenv.simulation.scene import State

CHEAP_INFO = tuple(key for key in INFO_KEYS if key != "rebounds")

_LANE = 1024  # bytes that a lane takes at least
Flags = NDArray[np.bool_]


class Advance(NamedTuple):
    """What a step of some lanes gives, arrays with one row a lane."""

    rewards: Floats
    terminated: Flags
    truncated: Flags
    info: dict[str, Any]  # arrays, in dicts


class SledVectorEnv(VectorEnv[NDArray[np.float32], NDArray[np.float32], NDArray[Any]]):
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
        As for :class:`sledenv.envs.launch.SledLaunch`; a scalar environment repeats the steps of each lane.
    max_episode_steps : int, optional
        After how many steps an episode is truncated, as by :class:`gymnasium.wrappers.TimeLimit`. That of an id ends no
        episode of the shipped scenarios.

    Attributes
    ----------
    observation_names, action_names : tuple of str
        What the entries of one lane's observation and action are.
    """

    single_action_space: spaces.Box
    _single: type[SledLaunch]  # what one lane is
    # Attributes that make up a snapshot, and what each may be.
    _episode: dict[str, tuple[type, ...]] = {
        "_contexts": (np.ndarray,),
        "_launches": (np.ndarray,),
        "_seen": (np.ndarray,),
        "_steps": (np.ndarray,),
        "_ended": (np.ndarray,),
        "_rides": (RideBatch, type(None)),
    }
    _rides: RideBatch | None = None  # of SledDescent, once lanes have been launched

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
        check_room(int(num_envs) * _LANE, f"num_envs = {num_envs!r}: as many lanes", "lower it")
        self.info_keys = checked_info(info)
        if max_episode_steps is not None:
            max_episode_steps = checked_count("max_episode_steps", max_episode_steps)
        try:
            mode = AutoresetMode(autoreset_mode)
        except ValueError:
            modes = ", ".join(repr(mode.value) for mode in AutoresetMode)
            raise ValueError(f"autoreset_mode = {autoreset_mode!r}: must be one of {modes}") from None
        self.task = Task(scenario, control, **task)
        self.num_envs = int(num_envs)
        self.single_observation_space, self.single_action_space = self._spaces()
        self.observation_names, self.action_names = self._names()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.autoreset_mode = mode
        self.metadata = self._single.metadata | {"autoreset_mode": mode}
        self.max_episode_steps = max_episode_steps
        self.render_mode = render_mode
        self._drawn: list[SledLaunch] = []  # each repeats a lane
        if render_mode is not None:
            for _ in range(self.num_envs):
                lane = self._single(self.task.scenario, control, render_mode, info=(), **task)
                self._drawn.append(lane)
        self._streams = Streams(self.num_envs, self.task.draws)
        self._contexts: Contexts | None = None  # before the first reset
        self._launches = np.zeros((self.num_envs, len(State._fields)))  # with which the lanes were let go last
        self._seen = np.zeros(self.observation_space.shape or (), np.float32)  # observation of each lane
        self._steps = np.zeros(self.num_envs, np.int64)  # since the reset
        self._ended = np.zeros(self.num_envs, np.bool_)

    @abstractmethod
    def _spaces(self) -> tuple[spaces.Box, spaces.Box]:
        """Observation and action space of one lane."""

    @abstractmethod
    def _names(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of the entries of an observation and of an action of one lane."""

    @abstractmethod
    def _advance(self, lanes: Lanes, actions: Floats) -> Advance:
        """Advance lanes by one step each, with actions that have been checked, and renew what is seen of them."""

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
        if not isinstance(options, Mapping | None):
            raise TypeError(f"options = {options!r}: must be a mapping such as {{'split': 'test'}}")
        given = dict(options or {})
        mask = given.pop("reset_mask", None)
        lanes = np.arange(self.num_envs) if mask is None else np.flatnonzero(self._checked_mask(mask))
        if self._contexts is None and len(lanes) < self.num_envs:
            raise ResetNeeded("the first reset must be one of all lanes")
        seeds = self._checked_seeds(seed, lanes)
        fixed = read_options(given, self.task.split, self.num_envs, ("reset_mask",)).of(lanes)
        self.task.check(fixed)
        self._streams.seed(lanes, seeds)
        info: dict[str, Any] = {}
        self._restart(lanes, info, fixed)
        return self._seen.copy(), info

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
        if self._contexts is None:
            raise ResetNeeded("call reset before step")
        if self.autoreset_mode is AutoresetMode.DISABLED and self._ended.any():
            lane = int(np.argmax(self._ended))
            raise ResetNeeded(f"lane {lane} has ended: reset it, with options={{'reset_mask': ...}} it alone")
        rewards = np.zeros(self.num_envs)
        terminated, truncated = np.zeros((2, self.num_envs), np.bool_)
        info: dict[str, Any] = {}
        waiting, lanes = np.flatnonzero(self._ended), np.flatnonzero(~self._ended)
        chosen = checked_actions(self.single_action_space, actions, self.num_envs, lanes)
        if lanes.size:
            step = self._advance(lanes, chosen[lanes])
            rewards[lanes], terminated[lanes], truncated[lanes] = step.rewards, step.terminated, step.truncated
            self._steps[lanes] += 1
            if self.max_episode_steps is not None:
                truncated[lanes] |= self._steps[lanes] >= self.max_episode_steps
            if self._drawn:
                for i in lanes.tolist():
                    self._drawn[i].step(chosen[i])
        if waiting.size:
            self._restart(waiting, info)
        observations = self._seen.copy()
        ended = terminated | truncated
        if self.autoreset_mode is AutoresetMode.SAME_STEP and ended.any():
            done = np.flatnonzero(ended)  # of all lanes: none waits in this mode
            final_obs = np.fromiter(observations[done], dtype=object, count=len(done))
            self._add_infos(info, {"final_obs": final_obs, "final_info": _rows(step.info, done)}, done)
            if not ended.all():
                _blank(step.info, done)
                self._add_infos(info, step.info, np.flatnonzero(~ended))
            self._restart(done, info)
            observations[done] = self._seen[done]
        else:
            if lanes.size:
                self._add_infos(info, step.info, lanes)
            self._ended = ended
        return observations, rewards, terminated, truncated, info

    def render(self) -> tuple[RenderFrame, ...] | None:
        """Return what the scalar environment in place of each lane would, as :class:`SyncVectorEnv` does.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset.
        """
        if not self._drawn:
            gym.logger.warn("render is called without a render_mode: give one to gym.make_vec")
            return None
        return tuple(lane.render() for lane in self._drawn)  # type: ignore[misc]  # a list of pictures is one as well

    def close_extras(self, **kwargs: Any) -> None:
        """Close the windows, if there are any."""
        for lane in self._drawn:
            lane.close()

    def snapshot(self) -> Snapshot:
        """Return where all lanes stand, their random streams included, as :meth:`SledLaunch.snapshot` does for one.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset.
        """
        if self._contexts is None:
            raise ResetNeeded("call reset before snapshot")
        episode = {name: copy.deepcopy(getattr(self, name)) for name in self._episode}
        return Snapshot(self._identity(), episode, copy.deepcopy(self._streams))

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot: what follows is, bit for bit, what would have followed there.

        Parameters
        ----------
        snapshot : Snapshot
            Of this batch or of another one with the same arguments, which draws nothing.

        Raises
        ------
        TypeError, ValueError
            If it is no snapshot, or one of another task; the batch stays where it is.
        """
        own = {name: getattr(self, name) for name in ("_launches", "_seen", "_steps", "_ended")}
        arrays = own | {"_contexts": np.empty((self.num_envs, self.task.draws))}
        check_snapshot(snapshot, self._identity(), self._episode, arrays, Streams)
        if snapshot.stream.shape != self._streams.shape:
            raise ValueError(f"snapshot.stream has shape {snapshot.stream.shape}: must be {self._streams.shape}")
        if self._drawn:
            raise ValueError(f"render_mode = {self.render_mode!r}: a batch that draws cannot go on from a snapshot")
        for name, value in copy.deepcopy(snapshot.episode).items():
            setattr(self, name, value)
        self._streams = copy.deepcopy(snapshot.stream)

    def _identity(self) -> dict[str, Any]:
        batch = {"num_envs": self.num_envs, "autoreset_mode": self.autoreset_mode.value, "info": self.info_keys}
        return {"environment": type(self).__name__} | batch | self.task.identity

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]  # as in SyncVectorEnv
        """Seed of each lane, None before the first reset."""
        return tuple(self._streams.seeds)

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
            raise TypeError(f"seed = {seed!r}: must be an integer >= 0, or a sequence of one a lane")
        if len(seed) != self.num_envs:
            raise ValueError(f"seed has {len(seed)} entries: must be one a lane, {self.num_envs}")
        owns = [(i, seed[i]) for i in lanes.tolist()]
        return [None if own is None else checked_seed(own, f"seed[{i}]") for i, own in owns]

    def _restart(self, lanes: Lanes, info: dict[str, Any], given: Given | None = None) -> None:
        """Begin an episode in lanes, in contexts of which something may be given, and add its info."""
        if given is None:
            given = read_options(None, self.task.split, len(lanes))
        contexts = self.task.begin(given, lambda drawn: self._streams.take(lanes[drawn]))
        if self._contexts is None:
            self._contexts = np.empty((self.num_envs, contexts.shape[1]))
        self._contexts[lanes] = contexts
        self._seen[lanes] = 0.0
        self._seen[lanes, :FIELDS] = self.task.observe(contexts)
        self._steps[lanes] = 0
        self._ended[lanes] = False
        if self._drawn:
            for row, i in enumerate(lanes.tolist()):
                self._drawn[i].enter(contexts[row : row + 1])
        if "context" in self.info_keys:
            self._add_infos(info, {"context": context_info(contexts)}, lanes)

    def _add_infos(self, infos: dict[str, Any], columns: dict[str, Any], lanes: Lanes) -> None:
        """Add the info of many lanes: what ``VectorEnv._add_info`` does for one.

        New columns may have a row for every lane, blank for those that are not meant.
        """
        told = np.zeros(self.num_envs, np.bool_)
        told[lanes] = True
        for key, value in columns.items():
            if isinstance(value, dict):
                self._add_infos(infos.setdefault(key, {}), value, lanes)
            elif key not in infos and len(value) == self.num_envs:
                infos[key] = value
            else:
                if key not in infos:
                    made = np.empty if value.dtype == object else np.zeros  # of empty objects each is None
                    infos[key] = made(self.num_envs, value.dtype)
                infos[key][lanes] = value
            mask = f"_{key}"
            infos[mask] = infos[mask] | told if mask in infos else told.copy()


class SledLaunchVector(SledVectorEnv):
    """Many :class:`sledenv.envs.launch.SledLaunch` at once: each step runs one whole descent in every lane.

    The arguments are those of :class:`SledVectorEnv`.
    """

    _single = SledLaunch

    def _spaces(self) -> tuple[spaces.Box, spaces.Box]:
        return self.task.observation_space, self.task.action_space

    def _names(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        return self.task.observation_names, self.task.action_names

    def _advance(self, lanes: Lanes, actions: Floats) -> Advance:
        assert self._contexts is not None
        contexts = self._contexts[lanes]
        launches = self.task.launches(contexts, actions)
        batch = self.task.descend_batch(contexts, launches, keep_rebounds="rebounds" in self.info_keys)
        info = episode_info(contexts, launches, batch, self.info_keys)
        return Advance(batch.jam.reward, np.ones(len(lanes), np.bool_), np.zeros(len(lanes), np.bool_), info)


class SledDescentVector(SledVectorEnv):
    """Many :class:`sledenv.envs.descent.SledDescent` at once: each step runs one hop in every lane.

    The arguments are those of :class:`SledVectorEnv`.
    """

    _single = SledDescent

    def _spaces(self) -> tuple[spaces.Box, spaces.Box]:
        return self.task.ride_observation_space, self.task.ride_action_space

    def _names(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        return self.task.ride_observation_names, self.task.ride_action_names

    def _advance(self, lanes: Lanes, actions: Floats) -> Advance:
        assert self._contexts is not None
        fresh = self._steps[lanes] == 0
        rides = self._launch(lanes[fresh], actions[fresh, :-1])
        trims = np.zeros(self.num_envs)
        trims[lanes[~fresh]] = self.task.trims(actions[~fresh, -1])
        rides.hop(trims)  # the other lanes have ended
        batch = rides.descents(lanes if len(lanes) < self.num_envs else None)
        self._seen[lanes, FIELDS:] = self.task.observe_flights(batch.outcomes)
        info = episode_info(self._contexts[lanes], self._launches[lanes], batch, self.info_keys)
        return Advance(*self.task.verdict(batch), info)

    def _launch(self, lanes: Lanes, actions: Floats) -> RideBatch:
        """Return the rides of all lanes, those of some begun anew."""
        assert self._contexts is not None
        contexts = self._contexts[lanes]
        launches = self._launches[lanes] = self.task.launches(contexts, actions)
        if self._rides is None:
            self._rides = self.task.rides(contexts, launches, keep_rebounds="rebounds" in self.info_keys)
        elif lanes.size:
            scenario, bodies = self.task.scenario, self.task.bodies_of(contexts)
            self._rides.launch(lanes, scenario.laws(contexts), scenario.slopes(contexts), launches, bodies)
        return self._rides


def _rows(columns: dict[str, Any], lanes: Lanes) -> dict[str, Any]:
    """Select rows of arrays in dicts."""
    return {key: _rows(value, lanes) if isinstance(value, dict) else value[lanes] for key, value in columns.items()}


def _blank(columns: dict[str, Any], lanes: Lanes) -> None:
    """Blank rows of arrays in dicts."""
    for value in columns.values():
        if isinstance(value, dict):
            _blank(value, lanes)
        else:
            value[lanes] = None if value.dtype == object else 0
