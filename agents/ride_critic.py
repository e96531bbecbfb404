"""A critic that knows the distribution of what a ride still earns after every trim, and no actor: the best is done."""

from __future__ import annotations

import copy
import math
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple, Self, cast

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.envs.vector import SledDescentVector
from sledenv.machine.extras import needs

from .classes import Bins, Fit, keep, kept_weights
from .curve import Curve
from .flight import Flights, Landings

with needs("agents", __name__):
    import torch
    from stable_baselines3.common.utils import get_device
    from torch import nn


Floats = NDArray[np.float32]

_FILE: Final = "critic.npz"
_RANGE: Final = (-0.05, 1.05)  # of the bins: what a ride still earns lies in [0, 1]
_AVERAGED: Final = 0.998  # of the averaged weights, how much is kept in a step
_BLUR: Final = 0.06  # standard deviation of the trims over which a rating is averaged: a narrow peak is a doubtful one
_TRAINING, _ACTING = 21, 41  # trims that are rated in a flight
_BLOCK: Final = 256  # flights that are rated at a time


class Critic(nn.Module):
    """Classifies what a ride still earns into bins: a regression would smooth the cliffs between landing and falling.

    Parameters
    ----------
    width, trim_width : int
        Numbers of inputs of a flight and of a trim, as in :class:`sledenv.agents.flight.Flights`.
    layers : sequence of int
        Units of the hidden layers. The first adds up what flights and trims contribute, so that the part of a flight is
        computed once for all of its trims.
    bins : int
    """

    mean: torch.Tensor
    deviation: torch.Tensor

    def __init__(self, width: int, trim_width: int, layers: list[int], bins: int) -> None:
        super().__init__()
        self.flight, self.trim = nn.Linear(width, layers[0]), nn.Linear(trim_width, layers[0], bias=False)
        hidden = [(nn.Linear(a, b), nn.SiLU()) for a, b in pairwise(layers)]
        self.hidden = nn.Sequential(nn.SiLU(), *(part for pair in hidden for part in pair))
        self.last = nn.Linear(layers[-1], bins)
        self.register_buffer("mean", torch.zeros(width))
        self.register_buffer("deviation", torch.ones(width))
        self.bins = Bins(*_RANGE, bins)

    def forward(self, flights: torch.Tensor, trims: torch.Tensor) -> torch.Tensor:
        """Return logits of the bins, (n, m, bins), for flights of shape (n, width) and trims (n, m, trim_width)."""
        values = self.flight((flights - self.mean) / self.deviation)[:, None] + self.trim(trims)
        with torch.autocast(values.device.type, torch.bfloat16):  # on some processors twice as fast
            values = self.hidden(values)
        logits: torch.Tensor = self.last(values.float())
        return logits

    @torch.no_grad()
    def rate(self, flights: Flights, landings: Landings, trims: Floats) -> Floats:
        """Return what is expected of trims, evenly spaced and of shape (m,), in flights; (n, m)."""
        inputs = flights.trimmed(landings, np.broadcast_to(trims, (len(landings.time), len(trims))))
        given = (torch.from_numpy(part).to(self.mean.device) for part in (landings.inputs, inputs))
        expected = self.bins.expected(self(*given)).cpu().numpy()
        near = np.exp(-0.5 * ((trims - trims[:, np.newaxis]) / _BLUR) ** 2)
        return np.asarray(expected @ (near / near.sum(axis=0)), np.float32)


class Samples(NamedTuple):
    """Trims, each with what the ride earned from its flight on."""

    flights: Floats  # (n, width)
    trims: Floats  # (n, 1, trim_width)
    earned: Floats  # (n,)


class Rides:
    """Goes on riding in many lanes, mostly with the trims that a critic rates best.

    Some are drawn from anywhere and some near the best, or nothing would be learned of others. What a trim earned is
    known if all that follow are the best ones; else it is the reward up to the next trial, and from there on what the
    critic expects of the best.

    Parameters
    ----------
    problem : Problem
    settings : dict
    seed : int
    """

    def __init__(self, problem: Problem, settings: dict[str, Any], seed: int) -> None:
        self.descents = 0  # that have ended
        self._lanes, self._flights_a_turn = settings["n_lanes"], settings["n_steps"]
        self._anywhere, self._near, self._width = settings["anywhere"], settings["near"], settings["near_width"]
        self._rng = np.random.default_rng(seed)
        self._flights = Flights(problem)
        kwargs = problem.env_kwargs | {"split": "train", "info": (), "autoreset_mode": AutoresetMode.SAME_STEP}
        self._env = SledDescentVector(self._lanes, **kwargs)
        # No two seeds share a lane's stream of contexts.
        self._seen, _ = self._env.reset(seed=seed * self._lanes)

    def sample(self, critic: Critic | None) -> Samples:
        """Ride ``n_steps`` flights in each of ``n_lanes`` lanes, without a critic by trims from anywhere."""
        steps, lanes = self._flights_a_turn, self._lanes
        rewards, expected = np.zeros((steps, lanes), np.float32), np.zeros((steps + 1, lanes), np.float32)
        ended, best = np.zeros((steps, lanes), bool), np.zeros((steps + 1, lanes), bool)
        told = []
        for step in range(steps + 1):
            landings = self._flights.land(self._seen)
            trims, best[step], expected[step] = self._chosen(critic, landings)
            if step == steps:
                break
            told.append((landings.inputs, self._flights.trimmed(landings, trims)))
            self._seen, rewards[step], ended[step], _, _ = self._env.step(trims)
        self.descents += int(ended.sum())
        earned, after = np.zeros_like(rewards), expected[-1]
        for step in reversed(range(steps)):
            earned[step] = rewards[step] + np.where(ended[step], 0.0, after)
            after = np.where(best[step] | (critic is None), earned[step], np.maximum(expected[step], earned[step]))
        flights, inputs = (np.concatenate(part) for part in zip(*told, strict=True))
        return Samples(flights, inputs, earned.ravel())

    def _chosen(self, critic: Critic | None, landings: Landings) -> tuple[Floats, NDArray[np.bool_], Floats]:
        """Return trims of shape (n, 1), whether each is the best, and what is expected of the best."""
        rng, lanes = self._rng, self._lanes
        anywhere = rng.uniform(-1.0, 1.0, lanes)
        if critic is None:
            return np.asarray(anywhere[:, np.newaxis], np.float32), np.zeros(lanes, bool), np.zeros(lanes, np.float32)
        trims, expected = searched(critic, self._flights, landings, _TRAINING)
        within = trims + rng.uniform(-1.0, 1.0, lanes) / (_TRAINING - 1)  # half of the way to the next
        near = trims + self._width * rng.standard_normal(lanes)
        kind = rng.random(lanes)
        tried = kind < self._anywhere + self._near
        trims = np.where(kind < self._anywhere, anywhere, np.where(tried, near, within))
        return np.clip(trims, -1.0, 1.0).astype(np.float32)[:, np.newaxis], ~tried, expected


def searched(critic: Critic, flights: Flights, landings: Landings, count: int) -> tuple[Floats, Floats]:
    """Return the trims that a critic rates best of evenly spaced ones, and what it expects of them, shapes (n,)."""
    trims = np.linspace(-1.0, 1.0, count, dtype=np.float32)
    ratings = critic.rate(flights, landings, trims)
    return trims[ratings.argmax(axis=1)], ratings.max(axis=1)


class Agent:
    """Does what its critic rates best of 41 trims."""

    def __init__(self, problem: Problem, critic: Critic) -> None:
        self._critic, self._flights = critic, Flights(problem)

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Ride and learn by turns, both at the same time: rides follow the critic of the turn before.

        The network that earns most on the validation contexts is kept.

        Parameters
        ----------
        problem : Problem
        settings : dict
            ``n_timesteps`` flights, ``n_steps`` a turn in each of ``n_lanes`` lanes; the shares of trims that are tried
            ``anywhere`` and ``near`` the best, these with a standard deviation of ``near_width``; the last ``memory``
            flights are learned from, each ``n_epochs`` times in the mean; ``batch_size``, ``learning_rate`` (falls to 0
            as a cosine), ``net_arch``, ``bins`` and ``checks``, how often the policy is validated.
        seed : int
            Of the network, the contexts and the trims; equal seeds give equal agents.
        folder : Path
            Where the weights and the learning curve are written.
        """
        torch.manual_seed(seed)
        torch.set_num_threads(1)  # the other cores ride
        flights = Flights(problem)
        critic = Critic(flights.width, flights.trim_width, settings["net_arch"], settings["bins"]).to(
            get_device("auto")
        )
        turns = max(2, math.ceil(settings["n_timesteps"] / (settings["n_lanes"] * settings["n_steps"])))
        rides, learner = Rides(problem, settings, seed), _Learner(critic, settings, turns, seed)
        curve, best, most = Curve(problem, folder), learner.averaged, -1.0
        with ThreadPoolExecutor(1) as pool:
            coming = pool.submit(rides.sample, None)
            for turn in range(turns):
                learner.add(coming.result())
                known = copy.deepcopy(learner.averaged)
                if turn % max(1, turns // settings["checks"]) == 0 or turn == turns - 1:  # while nobody else rides
                    check = curve.check(cls(problem, known), rides.descents)
                    if check.mean_reward > most:
                        best, most = known, check.mean_reward
                    if sys.stderr.isatty():
                        print(f"{learner.seen} flights: mean reward {check.mean_reward:.3f}", file=sys.stderr)
                if turn + 1 < turns:
                    coming = pool.submit(rides.sample, known if turn else None)
                    learner.learn()
        keep(best.cpu(), folder / _FILE)
        return cls.load(problem, folder)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the critic of a run; raises as :func:`sledenv.agents.classes.kept_weights`."""
        state = kept_weights(folder / _FILE)
        *layers, bins = (len(value) for name, value in state.items() if name.endswith("bias"))
        critic = Critic(state["flight.weight"].shape[1], state["trim.weight"].shape[1], layers, bins)
        critic.load_state_dict(state)
        return cls(problem, critic)

    def act(self, observations: Floats) -> Floats:
        """Return trims of shape (n, 1)."""
        return self._searched(observations)[0][:, np.newaxis]

    def expected(self, observations: Floats) -> Floats:
        """Return what it expects to earn from flights on, shape (n,)."""
        return self._searched(observations)[1]

    def _searched(self, observations: Floats) -> tuple[Floats, Floats]:
        parts = np.array_split(observations, math.ceil(len(observations) / _BLOCK))
        found = [searched(self._critic, self._flights, self._flights.land(part), _ACTING) for part in parts]
        trims, expected = zip(*found, strict=True)
        return np.concatenate(trims), np.concatenate(expected)


class _Learner:
    """Fits a critic to the last flights; ``turns`` is how many samples will have been added in the end."""

    def __init__(self, critic: Critic, settings: dict[str, Any], turns: int, seed: int) -> None:
        self.seen = 0  # flights
        self._critic, self._rng = critic, np.random.default_rng([seed, 1])
        turn = settings["n_lanes"] * settings["n_steps"]
        self._batch, self._steps = settings["batch_size"], turn * settings["n_epochs"] // settings["batch_size"]
        rows = turn * max(1, min(turns, settings["memory"] // turn))
        self._device = critic.mean.device
        self._memory = tuple(
            torch.empty(shape, device=self._device)
            for shape in ((rows, critic.flight.in_features), (rows, 1, critic.trim.in_features), (rows,))
        )
        self._fit = Fit(critic, settings["learning_rate"], (turns - 1) * self._steps, _averaged)

    @property
    def averaged(self) -> Critic:
        """The critic with weights averaged over the last steps."""
        return cast(Critic, self._fit.averaged)

    def add(self, samples: Samples) -> None:
        """Remember samples in place of the oldest ones; the first give the scales of the inputs."""
        if not self.seen:
            for critic in (self._critic, self.averaged):
                critic.mean.copy_(torch.from_numpy(samples.flights.mean(axis=0)))
                critic.deviation.copy_(torch.from_numpy(samples.flights.std(axis=0) + 0.01))
        start = self.seen % len(self._memory[0])
        for kept, new in zip(self._memory, samples, strict=True):
            kept[start : start + len(new)] = torch.from_numpy(new)
        self.seen += len(samples.earned)

    def learn(self) -> None:
        """Take the gradient steps of one turn."""
        for _ in range(self._steps):
            drawn = self._rng.integers(0, min(self.seen, len(self._memory[0])), self._batch)
            rows = torch.from_numpy(drawn).to(self._device)
            flights, trims, earned = (part[rows] for part in self._memory)
            self._fit.step(self._critic.bins.loss(self._critic(flights, trims)[:, 0], earned))


@torch.no_grad()
def _averaged(means: Any, weights: Any, count: Any) -> None:
    """Move averaged weights towards those of a step; at first faster, so that the initial ones are soon forgotten."""
    kept = min(_AVERAGED, (1.0 + float(count)) / (10.0 + float(count)))
    for mean, weight in zip(means, weights, strict=True):
        mean.lerp_(weight, 1.0 - kept)
