"""How well a policy does in contexts that no training has seen, the same for every policy."""

from __future__ import annotations

import inspect
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sledenv.benchmark.problem import Agent, Environment, HeldOut, Planner, Policy, Problem
from sledenv.benchmark.references import reference
from sledenv.benchmark.runs import agent_name, load_run
from sledenv.benchmark.scores import mean_interval, ratio_interval, share_interval, told
from sledenv.machine.blame import attribute_errors_to
from sledenv.scenarios.scenario import Scenario, load_scenario
from sledenv.simulation.rules import checked_flag

# Attributes of an evaluation that a reference fills, and its columns.
_REFERENCE: Final = {"lower": "lower", "lower_fallen": "lower_falls", "clairvoyant": "clairvoyant"}


class Predicting(Protocol):
    """A model as those of stable-baselines3: ``predict(observations, deterministic=True)`` returns actions and None."""

    def predict(self, observation: Any, /) -> Any:
        """Return actions, shape (n, k), or a tuple of them and a state, which must be None."""
        ...


@dataclass(frozen=True, eq=False)
class Evaluation:
    """How a policy did in test contexts; printed, it is a few lines.

    Attributes
    ----------
    policy : str
        Its name.
    scenario : str
        The id of the scenario.
    rewards : ndarray, shape (n,)
        Of each context, the mean over its trials: 64 draws of the launch noise of a launch, one of a ride.
    status : ndarray of str, shape (n, t)
        How each trial ended.
    places : tuple of str, shape (n,), optional
        The track made by hand on which each context lies; None where contexts have the ground of their scenario.
    held_out : {"test", "shifted", "tracks"}
        Which set the contexts are of.
    reference : str
        What the policy is compared with (:mod:`sledenv.benchmark.references`): a planner that sees no more than the
        policy does, or the best launch found; empty if nothing is known.
    lower, lower_fallen : ndarray, shape (n,), optional
        Reward and share of falls of the reference in each context, NaN where they are not known.
    clairvoyant : ndarray, shape (n,), optional
        The reward of the best ride found by a search that knows the errors of the rider, an estimate.
    """

    policy: str
    scenario: str
    rewards: NDArray[np.float64]
    status: NDArray[np.str_]
    places: tuple[str, ...] | None = None
    held_out: HeldOut = "test"
    reference: str = ""
    lower: NDArray[np.float64] | None = None
    lower_fallen: NDArray[np.float64] | None = None
    clairvoyant: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        for name in ("rewards", "status", *(_REFERENCE if self.lower is not None else ())):
            values = getattr(self, name).view()
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @property
    def where(self) -> str:
        """Words for the contexts."""
        kind = "shifted" if self.held_out == "shifted" else "test"
        ground = "" if self.places is None else f" on {len(set(self.places))} tracks made by hand"
        return f"{len(self.rewards)} {kind} contexts of {self.scenario}{ground}"

    @property
    def mean(self) -> float:
        """Mean reward, in [0, 1]."""
        return float(self.rewards.mean())

    @cached_property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the mean reward over all such contexts."""
        return mean_interval(self.rewards)

    @property
    def fallen(self) -> NDArray[np.float64]:
        """Share of the trials of each context in which a part touches that must not, shape (n,)."""
        return np.asarray((self.status == "tumbled").mean(axis=1))

    @property
    def falls(self) -> float:
        """Share of falls: descents in which a part touches that must not, such as the rider."""
        return float(self.fallen.mean())

    @cached_property
    def falls_interval(self) -> tuple[float, float]:
        """95 % interval of the share of falls over all such contexts; it has a width even if nothing fell."""
        return share_interval(self.fallen)

    @property
    def ratio(self) -> float:
        """Mean reward over that of the reference, in the contexts where this is known; NaN of none."""
        if self.lower is None:
            return math.nan
        known = ~np.isnan(self.lower)
        return float(self.rewards[known].mean() / self.lower[known].mean())

    @cached_property
    def ratio_interval(self) -> tuple[float, float]:
        """95 % interval of the ratio over all such contexts."""
        if self.lower is None:
            return math.nan, math.nan
        known = ~np.isnan(self.lower)
        return ratio_interval(self.rewards[known], self.lower[known])

    @property
    def finished(self) -> float:
        """Share of the descents that finished."""
        return float((self.status == "finish").mean())

    def __repr__(self) -> str:
        lines = [
            f"{self.policy}, {self.where}; 95 % intervals",
            f"mean reward  {told(self.mean, self.interval, '.3f')}",
            f"falls        {told(self.falls, self.falls_interval, '.1%')}",
            f"finished     {self.finished:.1%}",
        ]
        if self.lower is not None:
            known = ~np.isnan(self.lower)
            to = f"to {np.nanmean(self.lower):.3f} of {self.reference}"
            first = "" if known.all() else f" in the first {known.sum()} contexts"
            lines.insert(1, f"ratio        {told(self.ratio, self.ratio_interval, '.3f')} {to}{first}")
        return "\n".join(lines)


def evaluate(
    policy: Callable[[NDArray[np.float32]], ArrayLike] | Predicting | Policy | str | os.PathLike[str],
    scenario: str | os.PathLike[str] | Scenario | None = None,
    contexts: int = 1000,
    *,
    environment: Environment | None = None,
    control: str | None = None,
    launch_noise: tuple[float, float] | None = None,
    observe: Literal["all"] | Sequence[str] | None = None,
    columns: Sequence[str] | None = None,
    shifted: bool = False,
    tracks: bool = False,
    normalize: Any = None,
) -> Evaluation:
    """Ride or launch in test contexts, which no training draws with ``split="train"``.

    Every policy meets the same contexts with the same draws of noise, so that two evaluations compare context by
    context: ``one.rewards - other.rewards``.

    Parameters
    ----------
    policy : callable, object with ``predict``, ``act`` or ``plan``, str or path
        A function of observations, shape (n, m), that returns actions, shape (n, k), in [-1, 1], each row by itself; a
        model of stable-baselines3, which acts without exploration; an agent; or the folder of a run of
        ``python -m sledenv.agents.train``, or the name of one that ships, such as "sled_mat-launch-spin-critic-s0".
        Load only runs that you trust: they can run code as you.
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`. A run has its own, which is the default, and must be this one.
    contexts : int
        How many, at least 2; the first ones are the same for any number.
    environment : {"descent", "launch"}, optional
        Whether the policy trims the flights of a ride or chooses the launch. By default "descent" where a rider meets a
        track, "launch" elsewhere.
    control, launch_noise, observe, columns
        As the policy was trained with; the defaults are those of the environments. A run has its own.
    shifted : bool
        Evaluate in contexts of a kind that no one trains on, those of
        :meth:`sledenv.scenarios.Scenario.shifted`, seen on the scale of the others.
    tracks : bool
        Ride the test contexts on the :mod:`tracks made by hand <sledenv.scenarios>`, on which no one trains:
        each context on the next track, in the order of their names.
    normalize : VecNormalize, optional
        What scales observations before the policy sees them. That of the environment on which a model of
        stable-baselines3 was trained is found; a model that is loaded has lost it.

    Returns
    -------
    Evaluation

    Raises
    ------
    TypeError, ValueError
        For wrong arguments, or a policy of other observations or actions, before anything is simulated; if its actions
        have another shape, are no numbers or lie outside [-1, 1].
    FileNotFoundError
        If there is no such run.
    GivenCodeError
        If the policy raises an error itself, which is the cause.

    Examples
    --------
    No trim at all, and a rule that trims against pose and spin:

    >>> import gymnasium as gym, numpy as np, sledenv
    >>> def still(observations):
    ...     return np.zeros((len(observations), 1))
    >>> sledenv.evaluate(still, "sled_rollers", contexts=200)
    still, 200 test contexts of sled_rollers; 95 % intervals
    ratio        0.674 [0.624, 0.721] to 0.842 of replan, 33 and 5 spins
    mean reward  0.568 [0.524, 0.610]
    falls        44.0% [37.3, 50.9]
    finished     56.0%
    >>> names = gym.make("sledenv/SledDescent-v0", scenario="sled_rollers").unwrapped.observation_names
    >>> pose, spin = names.index("sine"), names.index("omega")
    >>> def against(observations):
    ...     return np.clip(-2 * observations[:, [pose]] - 2 * observations[:, [spin]], -1, 1)
    >>> found = sledenv.evaluate(against, "sled_rollers", contexts=200)
    >>> print(f"{found.ratio:.3f}, {found.falls:.1%} fall")
    0.730, 37.0% fall
    """
    if checked_flag("shifted", shifted) & checked_flag("tracks", tracks):
        raise ValueError("tracks = True: must be False where shifted is True")
    count = _checked_contexts(contexts)
    asked = scenario if isinstance(scenario, Scenario | None) else load_scenario(scenario)
    seen: dict[str, Any] = {"launch_noise": launch_noise, "observe": observe, "columns": columns}
    if isinstance(policy, str | os.PathLike):
        given = {"environment": environment, "control": control} | seen | {"normalize": normalize}
        judged = _run(policy, asked, given)
    else:
        judged = _policy(policy, _posed(asked, environment, control, seen), normalize)
    problem = judged.problem
    if tracks and not (problem.environment == "descent" and problem.scenario.is_ride):
        raise ValueError(f"tracks = True: must be False, {problem.id} in {problem.scenario.id} is no ride over ground")
    return evaluation_of(*judged[:2], count, judged.name, "tracks" if tracks else "shifted" if shifted else "test")


class _Judged(NamedTuple):
    """Who is judged, and in which problem."""

    problem: Problem
    agent: Policy | Planner | Agent
    name: str


def _run(run: str | os.PathLike[str], asked: Scenario | None, given: dict[str, Any]) -> _Judged:
    """Load a run, or raise ValueError if anything is given that it has itself, or another scenario is asked for."""
    for name, value in given.items():
        if value is not None:
            raise ValueError(f"{name} = {value!r}: must be left out, the run {os.fspath(run)} has its own")
    if Path(run).suffix == ".zip":
        raise ValueError(f"policy = {os.fspath(run)!r}: is a file of a model: load it, as PPO.load does, and give that")
    problem, agent, config = load_run(Path(run))
    _check_scenario(asked, problem, os.fspath(run))
    return _Judged(problem, agent, agent_name(config["agent"]))


def _posed(
    asked: Scenario | None, environment: Environment | None, control: str | None, seen: dict[str, Any]
) -> Problem:
    """Return the problem that is asked for; what is None is as the scenario has it."""
    if asked is None:
        raise TypeError("scenario = None: must be the name or the file of a scenario, or a Scenario")
    usual: Environment = "descent" if asked.is_ride else "launch"
    named = {name: value for name, value in seen.items() if value is not None}
    return Problem(asked, usual if environment is None else environment, control, **named)


def _policy(policy: Any, problem: Problem, normalize: Any) -> _Judged:
    """Return a policy of a problem as one that acts, or raise TypeError or ValueError if it is none."""
    name = _name(policy)
    return _Judged(problem, _as_agent(policy, name, problem, normalize), name)


def evaluation_of(
    problem: Problem, agent: Policy | Planner | Agent, contexts: int, name: str, held_out: HeldOut = "test"
) -> Evaluation:
    """Simulate what an agent does in the first contexts of a held-out set, the same for every agent.

    Raises
    ------
    ValueError
        If there is no such set, or the problem is no ride where "tracks" are asked for.
    """
    rows, rewards, status, places = [], [], [], []
    grounds = problem.held_out(held_out)
    for k, (place, one) in enumerate(list(grounds.items())[:contexts]):
        own = np.arange(k, contexts, len(grounds))
        # All are drawn, so that a context has the same draws of noise with and without tracks.
        trials = one.trials(one.contexts("test", contexts), "test")[own]
        batch, _ = one.judge(agent, trials)
        rows.append(own)
        rewards.append(batch.jam.reward.reshape(trials.shape[:2]).mean(axis=1))
        status.append(batch.status.reshape(trials.shape[:2]))
        places += [place] * len(own)
    order = np.argsort(np.concatenate(rows))
    on = tuple(places[i] for i in order) if held_out == "tracks" else None
    ends = np.concatenate(rewards)[order], np.concatenate(status)[order]
    found = Evaluation(name, problem.scenario.id, *ends, on, held_out)
    frozen = reference(problem, held_out)
    if frozen is None:
        return found
    known = frozen.reindex(np.arange(contexts))
    columns = {name: known[column].to_numpy(float) for name, column in _REFERENCE.items()}
    return replace(found, reference=frozen.attrs["policy"], **columns)


class _Named(NamedTuple):
    """A policy made of a function, and what messages call it."""

    act: Callable[[NDArray[np.float32]], Any]
    name: str


def _checked_contexts(contexts: Any) -> int:
    """Return a number of contexts, of which a mean has an interval, or raise TypeError or ValueError."""
    message = f"contexts = {contexts!r}: must be an integer >= 2, of fewer there is no interval"
    if isinstance(contexts, bool) or not isinstance(contexts, int | np.integer):
        raise TypeError(message)
    if contexts < 2:
        raise ValueError(message)
    return int(contexts)


def _check_scenario(asked: Scenario | None, problem: Problem, run: str) -> None:
    """Raise ValueError if a scenario is another one than that on which a run was trained."""
    if asked is None:
        return
    own, other = problem.scenario, asked.ride() if problem.environment == "descent" else asked
    if own.hash != other.hash:
        trained = f"{own.id!r} with the hash {own.hash}"
        raise ValueError(f"scenario = {other.id!r} with the hash {other.hash}: must be that of {run}, {trained}")


def _name(policy: Any) -> str:
    """Return what a policy is called: a function by its name, an ``Agent`` by its module, others by their class."""
    kind = type(policy)
    return str(getattr(policy, "__name__", agent_name(kind.__module__) if kind.__name__ == "Agent" else kind.__name__))


def _as_agent(policy: Any, name: str, problem: Problem, normalize: Any) -> Policy:
    """Return a policy as one that acts, or raise TypeError or ValueError if it is none for the problem."""
    ways = [way for way in ("plan", "act", "predict") if callable(getattr(policy, way, None))]
    if isinstance(policy, type) or not (ways or callable(policy)):
        what = "a function of observations, an object with predict or act, or the folder or name of a run"
        raise TypeError(f"policy = {policy!r}: must be {what}")
    for space in ("observation_space", "action_space"):
        own, wanted = getattr(policy, space, None), getattr(problem.task, space)
        if own is not None and own != wanted:
            shape = getattr(own, "shape", None)
            given = f"policy.{space} " + (f"has shape {shape}" if shape != wanted.shape else "has other bounds")
            must = f"must be {wanted.shape}" if shape != wanted.shape else "must be those"
            raise ValueError(f"{given}: {must} of {problem.id} in {problem.scenario.id}")
    if "plan" in ways:  # which sees no observation
        return policy  # type: ignore[no-any-return]
    if normalize is None and callable(find := getattr(policy, "get_vec_normalize_env", None)):
        normalize = find()
    _check_normalize(normalize, policy, problem)
    act: Callable[[NDArray[np.float32]], Any]
    if "act" in ways:
        act = policy.act
    elif "predict" in ways:
        act = _predicting(policy, name)
    else:
        act = policy
    if normalize is None:
        return _Named(act, name)
    return _Named(lambda observations: act(normalize.normalize_obs(observations)), name)


def _check_normalize(normalize: Any, policy: Any, problem: Problem) -> None:
    """Raise TypeError or ValueError if a policy cannot be shown observations so."""
    wanted = problem.task.observation_space
    if normalize is None:
        # What a model of stable-baselines3 was shown last is kept with it.
        last = getattr(policy, "_last_obs", None)
        if isinstance(last, np.ndarray) and last.shape[1:] == wanted.shape and (np.abs(last) > wanted.high).any():
            raise ValueError(
                "normalize = None: must be the VecNormalize with which the policy was trained, which has seen "
                "observations outside the space; VecNormalize.load reads it"
            )
        return
    if not callable(getattr(normalize, "normalize_obs", None)):
        raise TypeError(f"normalize = {normalize!r}: must be a VecNormalize of stable-baselines3")
    shape = getattr(getattr(normalize, "observation_space", wanted), "shape", None)
    if shape != wanted.shape:
        raise ValueError(f"normalize.observation_space has shape {shape}: must be {wanted.shape}")


def _predicting(policy: Any, name: str) -> Callable[[NDArray[np.float32]], Any]:
    """Return the function that a model predicts by, without exploration where it can."""
    try:
        options = {"deterministic": True} if "deterministic" in inspect.signature(policy.predict).parameters else {}
    except (TypeError, ValueError):  # of compiled code
        options = {}

    def act(observations: NDArray[np.float32]) -> Any:
        with attribute_errors_to(f"agent {name}", "predict"):
            answer = policy.predict(observations, **options)
        if not isinstance(answer, tuple):
            return answer
        actions, *state = answer
        if any(one is not None for one in state):
            raise TypeError("predict returned a state: must be None, each observation is answered by itself")
        return actions

    return act
