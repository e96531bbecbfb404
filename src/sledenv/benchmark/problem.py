"""Problems: a scenario, what an agent controls, and contexts to train, to validate and to be judged on."""

from __future__ import annotations

import os
import reprlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, Literal, Protocol, Self, get_args

import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri
from scipy.stats import qmc

from sledenv.envs import DESCENT_ID, LAUNCH_ID
from sledenv.envs.columns import GROUPS
from sledenv.envs.inputs import FIELDS, Contexts, checked_actions
from sledenv.envs.task import Task
from sledenv.machine.blame import attribute_errors_to
from sledenv.scenarios import Track, track_names
from sledenv.scenarios.scenario import NOISY, Context, Scenario, Split, check_split
from sledenv.scenarios.sections import CONTROLS
from sledenv.simulation.lanes import check_room
from sledenv.simulation.outcomes import DescentBatch
from sledenv.simulation.records import RUNNING
from sledenv.simulation.rules import (
    checked_choice,
    checked_count,
    checked_seed,
    checked_sequence,
    checked_table,
    is_named,
    numbers_of,
)
from sledenv.simulation.scenes import Scenes
from sledenv.simulation.settings import Solver

Environment = Literal["launch", "descent"]
HeldOut = Literal["test", "shifted", "tracks"]
"""Contexts to judge in: those of the test split, shifted ones, or test contexts spread over the tracks made by hand."""
ENVIRONMENTS: Final = {"launch": LAUNCH_ID, "descent": DESCENT_ID}
_A_TRIAL: Final = 400  # bytes, of its context, its launch and its outcome
TRIALS: Final = 64  # draws of the launch noise with which a launch is judged in each context
_BLOCK = 1 << 18  # descents at a time, so that memory stays bounded


class Policy(Protocol):
    """A map from observations to actions, which can be judged. Messages call it by its ``name``, or by its module."""

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return actions of shape (n, k) in [-1, 1] for what is seen, see :class:`sledenv.envs.task.Task`."""
        ...


class Planner(Protocol):
    """Can be judged in place of a policy: it knows the model, and may follow rides on (:mod:`sledenv.simulation`).

    It is told no more of what lies ahead than a policy is: see :meth:`sledenv.envs.task.Task.masked`.
    """

    def plan(self, scenes: Scenes, flights: np.ndarray | None) -> NDArray[np.float32]:
        """Return actions of shape (n, k) in [-1, 1].

        Parameters
        ----------
        scenes : Scenes
            All that is given of n descents, as far as it is seen.
        flights : ndarray of OUTCOME, shape (n,)
            Where rides stand; None of launches.
        """
        ...


class Agent(Protocol):
    """How a :class:`Policy` or a :class:`Planner` comes about that can be trained.

    A suite names the module whose class ``Agent`` it is; docs/benchmark.md shows a complete one.
    """

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Train on contexts of the splits "train" and "validation", keep the result in a folder and return the agent.

        Parameters
        ----------
        problem : Problem
        settings : dict
            From configs/agents; ``n_timesteps`` is the budget in simulated descents (in flights for SledDescent-v0).
        seed : int
            Of everything random.
        folder : Path
            Exists and is the agent's own.
        """
        ...

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read what :meth:`train` kept."""
        ...


class Problem:
    """A task with the contexts and the draws of noise in which every agent is trained, validated and judged alike.

    :func:`sledenv.evaluate` is for those who have a policy to judge.

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    environment : {"launch", "descent"}
        Whether the agent chooses the launch, or trims every flight of a ride.
    control : str, optional
        What it chooses, as for :class:`sledenv.envs.task.Task`.
    solver : {"compliant", "rigid"}
        As for :func:`sledenv.simulate`; agents are judged on compliant surfaces.
    launch_noise : pair of float, optional
        Standard deviations of the errors of orientation [rad] and spin [rad/s] at launch; those of the
        scenario by default.
    observe : "all" or sequence of str
        Fields of the context that the agent sees, as for :class:`sledenv.envs.task.Task`.
    columns : sequence of str
        Groups of columns that it sees, as there.

    Attributes
    ----------
    noise : ndarray, shape (2,)
        The standard deviations of the launch noise [rad], [rad/s].
    turns : tuple of bool
        For each thing that is chosen whether its bounds are a full turn apart, so that both are the same launch.

    Raises
    ------
    ScenarioError, ValueError
        For an unknown scenario, environment, control, solver or field, or wrong noise.
    """

    def __init__(
        self,
        scenario: str | os.PathLike[str] | Scenario,
        environment: Environment = "launch",
        control: str | None = None,
        *,
        solver: Solver = "compliant",
        launch_noise: tuple[float, float] | None = None,
        observe: Literal["all"] | Sequence[str] = "all",
        columns: Sequence[str] = GROUPS,
    ) -> None:
        ride = checked_choice("environment", environment, get_args(Environment)) == "descent"
        seen: dict[str, Any] = {"observe": observe, "columns": columns}
        self.task = Task(scenario, control, ride=ride, solver=solver, launch_noise=launch_noise, **seen)
        self.scenario = self.task.scenario
        self.environment = environment
        self.id = ENVIRONMENTS[environment]
        self.control = self.task.control
        self.action_space: spaces.Box = self.task.action_space
        self.actions: int = self.action_space.shape[0]
        self.noise: NDArray[np.float64] = self.task.noise
        bounds = self.scenario.control_bounds
        self._seen_by: Task | None = None  # as whose contexts agents see those of this one
        self.turns = tuple(bounds[name][1] - bounds[name][0] == CONTROLS[name].turn for name in self.task.controlled)

    @property
    def env_kwargs(self) -> dict[str, Any]:
        """Keywords, but for a split, of an environment of ``id`` that shows and asks what agents are judged on."""
        task = self.task
        kwargs = {"scenario": self.scenario, "solver": task.solver, "observe": task.observed}
        kwargs["columns"] = task.groups
        kwargs["launch_noise"] = tuple(self.noise.tolist())
        return kwargs if self.environment == "descent" else kwargs | {"control": self.control}

    def shifted(self) -> Problem:
        """Return the problem in contexts of a kind that no one trains on, to judge agents of this one in them.

        They are those of :meth:`sledenv.scenarios.Scenario.shifted`. Agents see them scaled as they are used to.
        """
        return self._seen_here(self.scenario.shifted())

    def on(self, track: Track | str | os.PathLike[str]) -> Problem:
        """Return the ride on a track made by hand, on which no one trains, to judge agents of this one on it.

        Its contexts are those of this problem, over other ground: see :meth:`sledenv.scenarios.Scenario.on`. Agents see
        it scaled as they are used to.

        Raises
        ------
        ValueError
            If it is no ride, or there is no such track.
        """
        self.must_be("descent", "a track made by hand")
        return self._seen_here(self.scenario.on(track))

    def held_out(self, which: HeldOut) -> dict[str, Problem]:
        """Return the problems of a set of held-out contexts: of n problems, context i belongs to number i mod n.

        Of "tracks" they are those of all tracks made by hand, by their names; else it is one, whose name is empty.

        Raises
        ------
        ValueError
            If there is no such set, or it is no ride over ground where "tracks" are asked for.
        """
        checked_choice("held_out", which, get_args(HeldOut))
        if which == "tracks":
            return {name: self.on(name) for name in track_names()}
        return {"": self.shifted() if which == "shifted" else self}

    def _seen_here(self, scenario: Scenario) -> Problem:
        """Return the problem of another scenario, seen on the scales of this one."""
        task, noise = self.task, tuple(self.noise.tolist())
        given = scenario, self.environment, self.control
        other = Problem(*given, solver=task.solver, launch_noise=noise, observe=task.observed, columns=task.groups)
        other._seen_by = task
        return other

    def seeing_all(self) -> Problem:
        """Return the same problem for one from whom nothing is hidden."""
        if not self.task.hidden.any():
            return self
        noise = tuple(self.noise.tolist())
        return Problem(self.scenario, self.environment, self.control, solver=self.task.solver, launch_noise=noise)

    def must_be(self, environment: Environment, what: str) -> None:
        """Raise ValueError, saying what is only of one environment, in the other one."""
        if self.environment != environment:
            raise ValueError(f"problem.environment = {self.environment!r}: must be {environment!r} for {what}")

    def contexts(self, split: Split, count: int, seed: int = 0) -> Contexts:
        """Draw ``count`` contexts of a split, shape (count, 12); context i does not depend on ``count``.

        Raises
        ------
        TypeError, ValueError
            For another split, or a wrong count or seed.
        MemoryError
            For more than there is room for.
        """
        count = checked_count("contexts", count, least=0)
        seed = checked_seed(seed)
        check_room(count * TRIALS * _A_TRIAL, f"contexts = {count}: they and their trials", "take fewer")
        part = _number(split)
        draws = np.array([np.random.default_rng([seed, part, i]).random(FIELDS) for i in range(count)])
        return self.scenario.contexts(draws.reshape(count, FIELDS), split)

    def trials(self, contexts: Contexts, split: Split, count: int = TRIALS) -> Contexts:
        """Repeat contexts of shape (n, 12) with draws of the launch noise, shape (n, t, 14).

        Every context gets the same t = ``count`` quasi-random normal errors, one without launch noise, so that a mean
        over the trials is the expected reward, of agents and of the oracle alike. Each split has errors of its own: an
        agent that searches with those of "train" or "validation" knows nothing of those with which it is judged.

        Of a ride, which begins where the launch has happened, a context has one trial, with one of these errors.

        Raises
        ------
        TypeError, ValueError
            For wrong contexts or another split, or a wrong count.
        MemoryError
            For more than there is room for.
        """
        count = checked_count("count", count)
        if self.environment == "descent":
            return self.drawn(contexts, split)[:, np.newaxis]
        return self._errors(contexts, split, count)

    def scenes(
        self, contexts: Contexts, count: int, seed: Sequence[int], *, noisy: Sequence[bool] = (True, True)
    ) -> Contexts:
        """Repeat contexts of shape (n, 12) with draws of all that one who chooses does not know, shape (n, count, 14).

        These are the errors of orientation and spin, in the last two columns, and the hidden fields of the context,
        uniform in their ranges. They are points of a scrambled Sobol sequence, the same for every context.

        Parameters
        ----------
        contexts : ndarray, shape (n, 12)
        count : int
        seed : sequence of int
            Of the scrambling; other seeds give independent draws.
        noisy : pair of bool
            Which of the two errors there are.

        Raises
        ------
        TypeError, ValueError
            For wrong contexts, or a wrong count or seed.
        MemoryError
            For more than there is room for.
        """
        contexts, count = checked_contexts(contexts), checked_count("count", count)
        check_room(len(contexts) * count * _A_TRIAL, f"count = {count}: as many trials", "take fewer")
        task = self.task
        hidden = np.flatnonzero(task.hidden)
        sequence = qmc.Sobol(len(NOISY) + len(hidden), rng=np.random.default_rng(checked_sequence("seed", seed, int)))
        uniform = np.clip(sequence.random(1 << (count - 1).bit_length())[:count], 1e-12, 1.0 - 1e-12)
        scenes = np.zeros((len(contexts), count, FIELDS + len(NOISY)))
        scenes[..., :FIELDS] = contexts[:, np.newaxis]
        scenes[..., FIELDS:] = np.where(noisy, self.noise, 0.0) * ndtri(uniform[:, : len(NOISY)])
        if hidden.size:
            draws = np.full((count, FIELDS), 0.5)
            draws[:, hidden] = uniform[:, len(NOISY) :]
            scenes[..., hidden] = self.scenario.contexts(draws)[:, hidden]
        return scenes

    def drawn(self, contexts: Contexts, split: Split) -> Contexts:
        """Give each of contexts of shape (n, 12) one draw of the launch noise of a split, shape (n, 14).

        These are the errors of :meth:`trials` in turn, one per context.

        Raises
        ------
        TypeError, ValueError
            For wrong contexts, or another split.
        """
        trials = self._errors(contexts, split, TRIALS)
        lanes = np.arange(len(trials))
        return np.asarray(trials[lanes, lanes % trials.shape[1]])

    def _errors(self, contexts: Contexts, split: Split, count: int) -> Contexts:
        """Repeat contexts with the draws of the launch noise of a split, shape (n, count, 14); once without noise."""
        return self.seeing_all().scenes(contexts, count if self.noise.any() else 1, (0, _number(split)))

    def inside(self, actions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Put actions of shape (..., k) into the box: a full turn wraps around, everything else stops at its bounds."""
        columns = [
            (actions[..., i] + 1.0) % 2.0 - 1.0 if turning else np.clip(actions[..., i], -1.0, 1.0)
            for i, turning in enumerate(self.turns)
        ]
        return np.stack(columns, axis=-1)

    def descend(self, contexts: Contexts, actions: ArrayLike) -> DescentBatch:
        """Simulate one descent per context with launches of shape (n, k), on all cores; of rides see :meth:`judge`.

        Raises
        ------
        TypeError, ValueError
            For contexts that are not of shape (n, 12) or (n, 14) or are wrong, or if the problem is one of rides.
        gymnasium.error.InvalidAction
            For wrong launches.
        """
        self.must_be("launch", "launches that are chosen; judge follows rides")
        contexts = checked_draws("contexts", contexts)
        chosen = checked_actions(self.task.action_space, self.task.action_names, actions, len(contexts))
        return self._descend(contexts, chosen)

    def _descend(self, contexts: Contexts, actions: NDArray[np.float64]) -> DescentBatch:
        return self.task.descend(self.task.aimed(self.task.scenes(contexts), actions))

    def expect(self, trials: Contexts, actions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean rewards of launches over trials.

        Parameters
        ----------
        trials : ndarray, shape (n, t, 14)
            Of :meth:`trials` or :meth:`scenes`.
        actions : ndarray, shape (n, m, k)
            Launches to try in each context; they may lie outside the bounds, as far as a launch may.

        Returns
        -------
        ndarray, shape (n, m)
        """
        count, tried = actions.shape[:2]
        flat, many = actions.reshape(count * tried, -1), trials.shape[1]
        means: NDArray[np.float64] = np.empty(len(flat))
        size = max(1, _BLOCK // many)
        for start in range(0, len(flat), size):
            rows = np.arange(start, min(start + size, len(flat)))
            contexts = trials[rows // tried].reshape(-1, trials.shape[2])
            batch = self._descend(contexts, np.repeat(flat[rows], many, axis=0))
            means[rows] = batch.jam.reward.reshape(len(rows), many).mean(axis=1)
        return means.reshape(count, tried)

    def judge(self, agent: Policy | Planner | Agent, trials: Contexts) -> tuple[DescentBatch, NDArray[np.float64]]:
        """Simulate what an agent does in contexts, on all cores.

        Parameters
        ----------
        agent : Policy or Planner
            It is asked for the launch of a context once, because it sees the same in all of its trials; for the trims
            of a ride in each.
        trials : ndarray, shape (n, t, 14), or (n, 12) or (n, 14)
            Of :meth:`trials`, or contexts of which each is judged once.

        Returns
        -------
        DescentBatch
            Of n t descents, the trials of a context side by side; equal bit for bit to episodes of the environment.
        ndarray, shape (n, k)
            The launches that it chose, or its first trims in the first trials, in [-1, 1].

        Raises
        ------
        TypeError, ValueError
            If it has no method ``act`` or ``plan``, for wrong trials, or if its actions have another shape, are no
            numbers or lie outside [-1, 1].
        GivenCodeError
            If it raises an error itself, which is the cause.
        """
        _check_agent(agent)
        trials = checked_draws("trials", trials, repeated=True)
        trials = trials if trials.ndim == 3 else trials[:, np.newaxis]
        many = trials.shape[1]
        contexts = trials.reshape(-1, trials.shape[2])
        if self.environment == "launch":
            actions = self._answer(agent, self.task.scenes(trials[:, 0, :FIELDS]))
            return self._descend(contexts, np.repeat(actions, many, axis=0)), actions
        batch, trims = self.ride(agent, contexts)
        return batch, np.nan_to_num(trims[::many, :1])

    def ride(self, agent: Policy | Planner | Agent, contexts: Contexts) -> tuple[DescentBatch, NDArray[np.float64]]:
        """Follow the rides of an agent to their ends, on all cores.

        Parameters
        ----------
        agent : Policy or Planner
        contexts : ndarray, shape (n, 12) or (n, 14)

        Returns
        -------
        DescentBatch
        ndarray, shape (n, d)
            Its trims in [-1, 1] of one flight after the other, NaN behind the last; d is at least 1.

        Raises
        ------
        TypeError, ValueError, GivenCodeError
            As :meth:`judge`.
        """
        _check_agent(agent)
        contexts = checked_draws("contexts", contexts)
        task = self.task
        rides, spins = task.rides(task.scenes(contexts)), np.zeros(len(contexts))
        trims: list[NDArray[np.float64]] = []
        while True:
            moving = np.flatnonzero(rides.flights["status"] == RUNNING)
            if not moving.size:
                break
            scenes = rides.scenes.take(moving)
            chosen = self._answer(agent, scenes, rides.flights.take(moving))
            spins[:] = 0.0
            spins[moving] = task.spins(scenes, chosen, np.full(len(moving), len(trims)))
            trims.append(np.full((len(contexts), 1), np.nan))
            trims[-1][moving] = chosen
            rides.hop(spins)
        return rides.descents(), np.hstack(trims or [np.full((len(contexts), 1), np.nan)])

    def _answer(
        self, agent: Policy | Planner | Agent, scenes: Scenes, flights: np.ndarray | None = None
    ) -> NDArray[np.float64]:
        """Return the actions of an agent, shape (n, k), or say whose are wrong and where."""
        whose = f"agent {getattr(agent, 'name', type(agent).__module__)}, scenario {self.scenario.id}"
        if callable(plan := getattr(agent, "plan", None)):
            masked = self.task.masked(scenes, flights)
            with attribute_errors_to(whose, "plan"):
                actions = plan(masked, None if flights is None else flights.copy())
        else:
            task, bounded = (self.task, True) if self._seen_by is None else (self._seen_by, False)
            observations = task.observe(scenes, flights, bounded=bounded)
            with attribute_errors_to(whose, "act"):
                actions = agent.act(observations)  # type: ignore[union-attr]
        try:
            return checked_actions(self.action_space, self.task.action_names, actions, len(scenes.rows))
        except InvalidAction as error:
            raise ValueError(f"{whose}: {error}") from error


def checked_contexts(contexts: Any) -> Contexts:
    """Return contexts as an array of shape (n, 12), or raise TypeError or ValueError."""
    return checked_table("contexts", contexts, Context._fields, Context.rules)


def checked_draws(name: str, given: Any, *, repeated: bool = False) -> Contexts:
    """Return contexts of shape (n, 12), or (n, 14) with errors, as an array, or raise TypeError or ValueError.

    They may be ``repeated`` as well, shape (n, t, 14). Their values are checked where scenes are made of them.
    """
    if is_named(given):
        return checked_table(name, given, Context._fields)
    numbers = numbers_of(name, given, "numbers")
    if numbers.ndim not in (2, 2 + repeated) or numbers.shape[-1] not in (FIELDS, FIELDS + len(NOISY)):
        allowed = f"{'(n, t, 14), ' * repeated}(n, 12) or (n, 14)"
        raise ValueError(f"{name} has shape {numbers.shape}: must be {allowed}")
    return numbers


def _check_agent(agent: Any) -> None:
    if not any(callable(getattr(agent, method, None)) for method in ("act", "plan")):
        raise TypeError(f"agent = {reprlib.repr(agent)}: must have a method act or plan")


def _number(split: Split) -> int:
    """Return which of the splits it is, for the streams of random numbers."""
    check_split(split)
    return get_args(Split).index(split)
