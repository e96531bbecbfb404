"""Episodes of many lanes: how they begin, what a step does and where they stand. One lane is a batch of one."""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from numpy.typing import NDArray

from sledenv.envs.info import checked_info, context_info, episode_info, launch_info
from sledenv.envs.inputs import Given, read_options
from sledenv.envs.task import Task
from sledenv.envs.viewer import Viewer, checked_render_mode
from sledenv.simulation.jam import SHARE_OF_PROGRESS
from sledenv.simulation.outcomes import DescentBatch
from sledenv.simulation.records import RUNNING
from sledenv.simulation.scenes import Lanes, Scenes
from sledenv.simulation.simulator import Simulator

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Snapshot(NamedTuple):
    """Where an environment stands, random streams included; opaque, picklable, may be restored any number of times."""

    task: dict[str, Any]  # of what
    episode: dict[str, Any]
    stream: list[np.random.Generator | None]  # one per lane


class Step(NamedTuple):
    """The results of a step of some lanes, arrays with one row per lane."""

    rewards: Floats
    terminated: Flags
    truncated: Flags
    info: dict[str, Any]  # arrays, in dicts


class Episodes(ABC):
    """Episodes under way in lanes of one task.

    Parameters
    ----------
    task : Task
    lanes : int
        How many.
    info : sequence of str
        Entries of info to give, of ``INFO_KEYS`` in :mod:`sledenv.envs.info`.
    render_mode : str, optional
        How lanes are shown. One that is alone can be filmed without.
    most_steps : int, optional
        After how many an episode is truncated.
    """

    by_hops: ClassVar[bool]  # whether a step is a flight worth a decision, and not the whole descent
    observation_names: tuple[str, ...]
    action_names: tuple[str, ...]
    # Attributes that make up a snapshot.
    _state: ClassVar = ("lanes", "trims", "paid", "seen", "steps", "ended", "seeds", "pasts")

    def __init__(
        self, task: Task, lanes: int, info: Sequence[str], render_mode: str | None, most_steps: int | None = None
    ) -> None:
        self.task = task
        self.info_keys = checked_info(info)
        checked_render_mode(render_mode)
        self.most_steps = most_steps
        self.observation_space, self.action_space = task.observation_space, task.action_space
        self.observation_names, self.action_names = task.observation_names, task.action_names
        self.generators: list[np.random.Generator | None] = [None] * lanes  # all that is drawn comes from them
        self.seeds: list[int | None] = [None] * lanes
        self.begun = False  # before the first reset
        self.lanes: Simulator | None = None  # once the first episodes have begun
        self.trims = np.zeros(lanes)  # [rad/s] lent in the last step
        self.paid = np.zeros(lanes)  # rewards since the reset
        self.seen = np.zeros((lanes, *self.observation_space.shape), np.float32)  # observations
        self.steps = np.zeros(lanes, np.int64)  # since the reset
        self.ended = np.zeros(lanes, np.bool_)  # waits for a reset
        shown = lanes if render_mode is not None or lanes == 1 else 0
        self.viewers = [Viewer(task, render_mode, by_hops=self.by_hops) for _ in range(shown)]

    @abstractmethod
    def _begun(self, lanes: Lanes) -> None:
        """Go on to where the first decision of episodes is."""

    @abstractmethod
    def _advance(self, lanes: Lanes, actions: Floats) -> DescentBatch:
        """Advance lanes by one step each, and return their descents so far."""

    def seed(self, lanes: Lanes, seeds: Sequence[int | None]) -> None:
        """Start streams anew where there is a seed, and from fresh entropy where there was none before."""
        for i, seed in zip(lanes.tolist(), seeds, strict=True):
            if seed is not None or self.generators[i] is None:
                self.generators[i], self.seeds[i] = seeding.np_random(seed)

    def begin(self, lanes: Lanes, given: Given | None = None) -> dict[str, Any]:
        """Begin an episode in lanes, in contexts of which something may be given, and return its info."""
        if given is None:
            given = read_options(None, self.task.split, len(lanes))
        scenes = self.task.begin(given, lambda drawn: self._draw(lanes[drawn]))
        if self.lanes is None:  # of all lanes
            self.lanes = self.task.simulator(scenes, keep_rebounds=self.by_hops and "rebounds" in self.info_keys)
        else:
            self.lanes.launch(lanes, scenes)
        self.begun = True
        self.steps[lanes], self.trims[lanes], self.paid[lanes] = 0, 0.0, 0.0
        self.ended[lanes] = False
        self._begun(lanes)
        self._look(lanes)
        for k, i in enumerate(lanes.tolist() if self.viewers else ()):
            self.viewers[i].enter(scenes if len(lanes) == 1 else scenes.take(np.array([k])))
        info: dict[str, Any] = {}
        if "context" in self.info_keys:
            info["context"] = context_info(scenes.drawn)
        if self.by_hops and "launch" in self.info_keys:
            info["launch"] = launch_info(scenes.launches)
        return info

    def _scenes(self, lanes: Lanes) -> Scenes:
        """Return the scenes of lanes."""
        assert self.lanes is not None
        return self.lanes.scenes if len(lanes) == len(self.steps) else self.lanes.scenes.take(lanes)

    def _look(self, lanes: Lanes) -> None:
        """Renew what is seen of lanes."""
        assert self.lanes is not None
        flights = self.lanes.flights if len(lanes) == len(self.steps) else self.lanes.flights.take(lanes)
        self.seen[lanes] = self.task.observe(self._scenes(lanes), flights)

    def step(self, lanes: Lanes, actions: Floats) -> Step:
        """Advance lanes by one step each, with actions that have been checked, a row per lane."""
        batch = self._advance(lanes, actions)
        terminated = batch.outcomes["status"] != RUNNING
        earned = np.where(terminated, batch.jam.reward, SHARE_OF_PROGRESS * batch.jam.progress)
        rewards = earned - self.paid[lanes]
        self.paid[lanes] = earned
        self.steps[lanes] += 1
        truncated = self.steps[lanes] >= (math.inf if self.most_steps is None else self.most_steps)
        self.ended[lanes] = terminated | truncated
        scenes = self._scenes(lanes)
        for k, i in enumerate(lanes.tolist() if self.viewers else ()):
            own = scenes if len(lanes) == 1 else scenes.take(np.array([k]))
            self.viewers[i].step(own, float(self.trims[i]))
        return Step(rewards, terminated, truncated, episode_info(scenes, batch, self.info_keys))

    def snapshot(self, environment: dict[str, Any]) -> Snapshot:
        """Return where all lanes stand, and what of an environment another must have in common to go on from there."""
        if not self.begun:
            raise ResetNeeded("call reset before snapshot")
        episode = {name: copy.deepcopy(getattr(self, name)) for name in self._state}
        return Snapshot(self._identity(environment), episode, copy.deepcopy(self.generators))

    def restore(self, snapshot: Snapshot, environment: dict[str, Any]) -> None:
        """Go on from a snapshot, or raise TypeError or ValueError: all lanes stay where they are then."""
        self._check(snapshot, self._identity(environment))
        for name, value in copy.deepcopy(snapshot.episode).items():
            setattr(self, name, value)
        self.generators = copy.deepcopy(list(snapshot.stream))
        self.begun = True

    @property
    def pasts(self) -> list[Any]:
        """The past of each lane that is shown."""
        return [viewer.past for viewer in self.viewers]

    @pasts.setter
    def pasts(self, pasts: list[Any]) -> None:
        assert self.lanes is not None  # of the same snapshot
        for i, (viewer, past) in enumerate(zip(self.viewers, pasts, strict=False)):
            viewer.enter(self.lanes.scenes.take(np.array([i])), past)

    def _draw(self, lanes: Lanes) -> Floats:
        generators: list[Any] = self.generators  # seeded before
        return np.array([generators[i].random(self.task.draws) for i in lanes.tolist()])

    def _identity(self, environment: dict[str, Any]) -> dict[str, Any]:
        return environment | {"info": self.info_keys} | self.task.identity

    def _check(self, snapshot: Any, task: dict[str, Any]) -> None:
        """Raise TypeError or ValueError unless a snapshot is one of a task."""
        if not isinstance(snapshot, Snapshot):
            raise TypeError(f"snapshot = {snapshot!r}: must come from snapshot()")
        if not isinstance(snapshot.task, dict) or snapshot.task.keys() != task.keys():
            raise ValueError(f"snapshot.task = {snapshot.task!r}: the snapshot is of another task, must be {task}")
        for name, must in task.items():
            if (given := snapshot.task[name]) != must:
                which = f"snapshot.task[{name!r}] = {given!r}"
                raise ValueError(f"{which}: the snapshot is of another task, must be {must!r}")
        held = snapshot.episode
        if not isinstance(held, dict) or tuple(held) != self._state:
            raise ValueError(f"snapshot.episode = {held!r}: must hold {', '.join(self._state)}")
        if len(held["pasts"]) < len(self.viewers):
            raise ValueError("snapshot.episode['pasts'] is empty: a batch that draws needs a snapshot of one that does")


class LaunchEpisodes(Episodes):
    """Episodes of one step: a launch, then the whole descent."""

    by_hops = False

    def _begun(self, lanes: Lanes) -> None:
        pass  # the launch itself is the decision

    def _advance(self, lanes: Lanes, actions: Floats) -> DescentBatch:
        assert self.lanes is not None
        scenes = self.task.aimed(self._scenes(lanes), actions)
        self.lanes.scenes = self.lanes.scenes.put(lanes, scenes)
        return self.task.descend(scenes, keep_rebounds="rebounds" in self.info_keys)


class DescentEpisodes(Episodes):
    """Episodes of one flight worth a decision a step, from a launch that nobody chooses."""

    by_hops = True

    def _begun(self, lanes: Lanes) -> None:
        assert self.lanes is not None
        self.lanes.wait(lanes)

    def _advance(self, lanes: Lanes, actions: Floats) -> DescentBatch:
        assert self.lanes is not None
        self.trims[:] = 0.0
        self.trims[lanes] = self.task.spins(self._scenes(lanes), actions, self.steps[lanes])
        self.lanes.hop(self.trims)  # the other lanes have ended
        self._look(lanes)
        return self.lanes.descents(lanes if len(lanes) < len(self.steps) else None)
