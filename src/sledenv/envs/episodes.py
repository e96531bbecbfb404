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
from sledenv.simulation.outcomes import DescentBatch
from sledenv.simulation.records import RUNNING
from sledenv.simulation.ride import RideBatch
from sledenv.simulation.scene import State

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Lanes = NDArray[np.intp]  # numbers of lanes


class Snapshot(NamedTuple):
    """Where an environment stands, random streams included; opaque, picklable, may be restored any number of times."""

    task: dict[str, Any]  # of what
    episode: dict[str, Any]
    stream: list[np.random.Generator | None]  # one a lane


class Step(NamedTuple):
    """What a step of some lanes gives, arrays with one row a lane."""

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
    _state: ClassVar = ("contexts", "launches", "trims", "paid", "seen", "steps", "ended", "seeds", "rides", "pasts")

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
        self.contexts = np.full((lanes, task.columns), np.nan)
        self.launches = np.zeros((lanes, len(State._fields)))  # with which the lanes were let go last
        self.trims = np.zeros(lanes)  # [rad/s] lent in the last step
        self.paid = np.zeros(lanes)  # rewards since the reset
        self.seen = np.zeros((lanes, *self.observation_space.shape), np.float32)  # observations
        self.steps = np.zeros(lanes, np.int64)  # since the reset
        self.ended = np.zeros(lanes, np.bool_)  # waits for a reset
        self.rides: RideBatch | None = None  # once lanes have been launched, flight by flight
        shown = lanes if render_mode is not None or lanes == 1 else 0
        self.viewers = [Viewer(task, render_mode, by_hops=self.by_hops) for _ in range(shown)]

    @abstractmethod
    def _enter(self, lanes: Lanes) -> dict[str, Any]:
        """Begin in the contexts of some lanes, renew what is seen of them, and return info of it."""

    @abstractmethod
    def _advance(self, lanes: Lanes, actions: Floats) -> DescentBatch:
        """Advance lanes by one step each, renew what is seen of them, and return their descents so far."""

    def seed(self, lanes: Lanes, seeds: Sequence[int | None]) -> None:
        """Start streams anew where there is a seed, and from fresh entropy where there was none before."""
        for i, seed in zip(lanes.tolist(), seeds, strict=True):
            if seed is not None or self.generators[i] is None:
                self.generators[i], self.seeds[i] = seeding.np_random(seed)

    def begin(self, lanes: Lanes, given: Given | None = None) -> dict[str, Any]:
        """Begin an episode in lanes, in contexts of which something may be given, and return its info."""
        if given is None:
            given = read_options(None, self.task.split, len(lanes))
        contexts = self.task.begin(given, lambda drawn: self._draw(lanes[drawn]))
        self.begun = True
        self.contexts[lanes] = contexts
        self.steps[lanes], self.trims[lanes], self.paid[lanes] = 0, 0.0, 0.0
        self.ended[lanes] = False
        info = self._enter(lanes)
        for i in lanes.tolist() if self.viewers else ():
            self.viewers[i].enter(self.contexts[i : i + 1])
        return {"context": context_info(contexts)} | info if "context" in self.info_keys else info

    def step(self, lanes: Lanes, actions: Floats) -> Step:
        """Advance lanes by one step each, with actions that have been checked, a row a lane."""
        batch = self._advance(lanes, actions)
        terminated = batch.outcomes["status"] != RUNNING
        earned = np.where(terminated, batch.jam.reward, 0.5 * batch.jam.progress)
        rewards = earned - self.paid[lanes]
        self.paid[lanes] = earned
        self.steps[lanes] += 1
        truncated = self.steps[lanes] >= (math.inf if self.most_steps is None else self.most_steps)
        self.ended[lanes] = terminated | truncated
        for i in lanes.tolist() if self.viewers else ():
            self.viewers[i].step(self.launches[i], float(self.trims[i]))
        info = episode_info(self.contexts[lanes], self.launches[lanes], batch, self.info_keys)
        return Step(rewards, terminated, truncated, info)

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
        """What has happened in each lane that is shown."""
        return [viewer.past for viewer in self.viewers]

    @pasts.setter
    def pasts(self, pasts: list[Any]) -> None:
        for i, (viewer, past) in enumerate(zip(self.viewers, pasts, strict=False)):
            viewer.enter(self.contexts[i : i + 1], past)

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

    def _enter(self, lanes: Lanes) -> dict[str, Any]:
        self.seen[lanes] = self.task.observe(self.contexts[lanes])
        return {}

    def _advance(self, lanes: Lanes, actions: Floats) -> DescentBatch:
        contexts = self.contexts[lanes]
        launches = self.launches[lanes] = self.task.launches(contexts, actions)
        return self.task.descend_batch(contexts, launches, keep_rebounds="rebounds" in self.info_keys)


class DescentEpisodes(Episodes):
    """Episodes of one flight worth a decision a step, from a launch that nobody chooses."""

    by_hops = True

    def _enter(self, lanes: Lanes) -> dict[str, Any]:
        task, contexts = self.task, self.contexts[lanes]
        launches = self.launches[lanes] = task.launches(contexts)
        if self.rides is None:  # of all lanes
            self.rides = task.rides(contexts, keep_rebounds="rebounds" in self.info_keys)
        else:
            laws, slopes = task.scenario.laws(contexts), task.scenario.slopes(contexts)
            self.rides.launch(lanes, laws, slopes, launches, task.bodies_of(contexts))
        self.rides.await_flights(lanes)
        self.seen[lanes] = task.observe(contexts, self.rides.outcomes(lanes), ground=self.rides.ground(lanes))
        return {"launch": launch_info(launches)} if "launch" in self.info_keys else {}

    def _advance(self, lanes: Lanes, actions: Floats) -> DescentBatch:
        rides, contexts = self.rides, self.contexts[lanes]
        assert rides is not None
        self.trims[:] = 0.0
        self.trims[lanes] = self.task.spins(contexts, actions, self.steps[lanes])
        rides.hop(self.trims)  # the other lanes have ended
        batch = rides.descents(lanes if len(lanes) < len(self.steps) else None)
        self.seen[lanes] = self.task.observe(contexts, batch.outcomes, ground=rides.ground(lanes))
        return batch
