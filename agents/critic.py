"""A critic that knows the distribution of the reward of every landing, and no actor: what it rates best is done."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple, Self, cast

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from sledenv.benchmark.landing import Landing
from sledenv.benchmark.problem import Problem
from sledenv.envs.inputs import Contexts
from sledenv.machine.extras import needs

from .classes import Bins, Fit, keep, kept_weights
from .curve import Curve
from .touch import Touch

with needs("agents", __name__):
    import torch
    from torch import nn
    from torch.optim.swa_utils import get_ema_multi_avg_fn


Floats = NDArray[np.float32]

_FILE: Final = "critic.npz"
_RANGE: Final = (-0.1, 1.1)  # of the bins: a reward lies in [0, 1], and its smeared target within these
_AVERAGED: Final = 0.995  # of the averaged weights, how much is kept in a step
_BLOCK: Final = 1 << 16  # landings that are rated at a time


class Critic(nn.Module):
    """Classifies the reward of a landing into bins, each a class: the expected class is the expected reward.

    A regression smooths cliffs, and the optimum lies beside one. Probabilities of classes jump there without effort.

    Parameters
    ----------
    touch : Touch
        Makes the inputs.
    layers : sequence of int
        Units of the hidden layers.
    bins : int
    half : bool
        Whether the hidden layers work in bfloat16, on some processors three times as fast. Directions and rewards do
        not: they need the digits.
    """

    middles: torch.Tensor
    edges: torch.Tensor

    def __init__(self, touch: Touch, layers: list[int], bins: int, half: bool = False) -> None:
        super().__init__()
        self.touch = touch
        widths = [touch.width, *layers]
        hidden = [(nn.Linear(a, b), nn.SiLU()) for a, b in pairwise(widths)]
        self.first = nn.Sequential(*hidden[0])
        self.hidden = nn.Sequential(*(part for pair in hidden[1:] for part in pair))
        self.last = nn.Linear(widths[-1], bins)
        self._half = half
        self.bins = Bins(*_RANGE, bins)

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Return logits of the bins."""
        values = self.first(inputs)
        with torch.autocast("cpu", torch.bfloat16, enabled=self._half):
            values = self.hidden(values)
        logits: torch.Tensor = self.last(values.float())
        return logits

    @torch.no_grad()
    def rate(self, observations: Floats, landings: Floats) -> Floats:
        """Return the expected rewards of landings of shape (n, m, k) in contexts seen, shape (n, 11); shape (n, m)."""
        many = landings.shape[1]
        inputs = self.touch.inputs(np.repeat(observations, many, axis=0), landings.reshape(-1, landings.shape[2]))
        parts = [self.bins.expected(self(part)) for part in torch.split(torch.from_numpy(inputs), _BLOCK)]
        return np.asarray(torch.cat(parts).numpy().reshape(-1, many))


class Search(NamedTuple):
    """How thoroughly the best landing is looked for."""

    anywhere: int  # landings all over the box
    starts: int  # the best of these are refined
    around: int  # landings around each start, once for each of the widths
    widths: tuple[float, ...]  # standard deviations, where the box is 2 wide


TRAINING: Final = Search(128, 4, 8, (0.06, 0.02))
ACTING: Final = Search(1024, 8, 32, (0.04, 0.02, 0.01, 0.005))


class Samples(NamedTuple):
    """Labelled landings."""

    inputs: Floats  # (n, d)
    rewards: Floats  # (n,)


class Sampler:
    """Draws training contexts and simulates landings in them: mostly near those that a critic rates best.

    In each context it tries the peaks of the critic, some landings around them and some anywhere, and then around the
    best of all these: errors of the critic where it matters are what it learns from next. Without a critic, everything
    but the last is anywhere.

    Parameters
    ----------
    problem : Problem
    settings : dict
    rng : numpy.random.Generator
    """

    def __init__(self, problem: Problem, settings: dict[str, Any], rng: np.random.Generator) -> None:
        self._problem = problem
        self._landing = Landing(problem)
        self._contexts, self._tries = settings["n_contexts"], settings["n_tries"]
        self._noise = problem.noise
        self._rng = rng

    def sample(self, critic: Critic, guided: bool) -> Samples:
        """Label ``n_contexts * n_tries`` landings."""
        problem, half = self._problem, self._tries // 2
        contexts = problem.scenario.contexts(self._rng.random((self._contexts, problem.scenario.draws)), "train")
        seen = problem.task.observe(problem.task.scenes(contexts))
        first = self._anywhere(half)
        if guided:
            peaks, _ = searched(problem, critic, seen, self._anywhere(TRAINING.anywhere), TRAINING, self._normal)
            near = self._near(peaks, 2)
            first = np.concatenate([peaks, near, first], axis=1)[:, :half]
        rewards = self._earned(contexts, first)
        best = np.take_along_axis(first, rewards.argmax(axis=1)[:, None, None], axis=1)
        second = self._near(best, self._tries - half)
        landings = np.concatenate([first, second], axis=1).astype(np.float32)
        inputs = critic.touch.inputs(np.repeat(seen, self._tries, axis=0), landings.reshape(-1, problem.actions))
        rewards = np.concatenate([rewards, self._earned(contexts, second)], axis=1)
        return Samples(inputs, rewards.astype(np.float32).ravel())

    def _normal(self, *shape: int) -> NDArray[np.float64]:
        return self._rng.standard_normal((*shape, self._problem.actions))

    def _anywhere(self, count: int) -> NDArray[np.float64]:
        """Return quasi-random landings, shifted from context to context."""
        shift = self._rng.random((self._contexts, 1, self._problem.actions))
        return 2.0 * ((_sobol(self._problem.actions, count) + shift) % 1.0) - 1.0

    def _near(self, landings: NDArray[np.float64], count: int) -> NDArray[np.float64]:
        """Return landings around others, at distances of .003 to .1: ridges are as narrow as that or as wide."""
        lanes, starts, width = landings.shape
        widths = np.exp(self._rng.uniform(np.log(0.003), np.log(0.1), (lanes, starts, count, 1)))
        around = landings[:, :, None] + widths * self._normal(lanes, starts, count)
        return self._problem.inside(around).reshape(lanes, -1, width)

    def _earned(self, contexts: Contexts, landings: NDArray[np.float64]) -> NDArray[np.float64]:
        """Simulate landings of shape (n, m, k), each with a noise of its own; rewards of shape (n, m)."""
        problem = self._problem
        rows, flat = np.repeat(contexts, landings.shape[1], axis=0), landings.reshape(-1, problem.actions)
        launches = self._landing.launches(rows, flat)
        if self._noise.any():
            rows = np.hstack([rows, self._noise * self._rng.standard_normal((len(rows), 2))])
        rewards: NDArray[np.float64] = problem.descend(rows, launches).jam.reward
        return rewards.reshape(landings.shape[:2])


def searched(
    problem: Problem,
    critic: Critic,
    observations: Floats,
    anywhere: NDArray[np.float64],
    search: Search,
    normal: Callable[[int, int, int], NDArray[np.float64]],
) -> tuple[NDArray[np.float64], Floats]:
    """Look for the landings that a critic rates best.

    Parameters
    ----------
    problem : Problem
    critic : Critic
    observations : ndarray, shape (n, 11)
    anywhere : ndarray, shape (n, m, k)
        Landings to begin with.
    search : Search
    normal : callable
        Normal deviates of shape (i, j, l, k) for i, j and l.

    Returns
    -------
    ndarray, shape (n, starts, k)
        The best first.
    ndarray, shape (n, starts)
        How they are rated.
    """

    def best_of(landings: NDArray[np.float64], count: int) -> tuple[NDArray[np.float64], Floats]:
        rated = critic.rate(observations, landings.astype(np.float32))
        best = np.argsort(-rated, axis=1, kind="stable")[:, :count]
        return np.take_along_axis(landings, best[..., None], axis=1), np.take_along_axis(rated, best, axis=1)

    points, heights = best_of(anywhere, search.starts)
    lanes, starts, width = points.shape
    for deviation in search.widths:
        offsets = deviation * normal(lanes, starts, search.around)
        around = problem.inside(points[:, :, None] + offsets)
        rated = critic.rate(observations, around.reshape(lanes, -1, width).astype(np.float32)).reshape(
            lanes, starts, -1
        )
        nearby = np.take_along_axis(around, rated.argmax(axis=2)[..., None, None], axis=2)[:, :, 0]
        points = np.where((rated.max(axis=2) > heights)[..., None], nearby, points)
        heights = np.maximum(heights, rated.max(axis=2))
    order = np.argsort(-heights, axis=1, kind="stable")
    return np.take_along_axis(points, order[..., None], axis=1), np.take_along_axis(heights, order, axis=1)


class Agent:
    """Does what its critic rates best; the search is the same every time, so that it is a function of what it sees."""

    def __init__(self, problem: Problem, critic: Critic) -> None:
        self._problem, self._critic = problem, critic
        self._landing = Landing(problem)
        self._box = 2.0 * _sobol(problem.actions, ACTING.anywhere) - 1.0
        self._cloud = qmc.MultivariateNormalQMC(np.zeros(problem.actions), rng=np.random.default_rng(0)).random(
            ACTING.around
        )

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Sample and learn by turns, both at the same time: landings are sought by the critic of the turn before.

        The network that earns most on the validation contexts is kept.

        Parameters
        ----------
        problem : Problem
        settings : dict
            ``n_timesteps`` descents, ``n_contexts`` contexts a turn with ``n_tries`` landings each, ``warmup`` turns
            without guidance, ``gradient_steps`` a turn, ``batch_size``, ``learning_rate`` (falls to 0 as a cosine),
            ``net_arch``, ``bins``, ``bfloat16`` and ``checks``, how often the policy is
            validated.
        seed : int
            Of the network, the contexts and the landings; equal seeds give equal agents.
        folder : Path
            Where the weights and the learning curve are written.
        """
        torch.manual_seed(seed)
        torch.set_num_threads(1)  # the other cores simulate
        critic = Critic(Touch(problem), settings["net_arch"], settings["bins"], settings["bfloat16"])
        sampling, shuffling = (np.random.default_rng([seed, i]) for i in range(2))
        turns = math.ceil(settings["n_timesteps"] / (settings["n_contexts"] * settings["n_tries"]))
        learner = _Learner(critic, settings, turns, shuffling)
        sampler = Sampler(problem, settings, sampling)
        curve, best, most = Curve(problem, folder), learner.averaged, -1.0
        with ThreadPoolExecutor(1) as pool:
            coming = pool.submit(sampler.sample, critic, False)
            for turn in range(turns):
                learner.add(coming.result())
                if turn % max(1, turns // settings["checks"]) == 0:  # while nothing else is simulated
                    reward = curve.check(cls(problem, learner.averaged), learner.size).mean_reward
                    if reward > most:
                        best, most = copy.deepcopy(learner.averaged), reward
                if turn + 1 < turns:
                    known = copy.deepcopy(learner.averaged)
                    coming = pool.submit(sampler.sample, known, turn + 1 >= settings["warmup"])
                learner.learn()
        if curve.check(cls(problem, learner.averaged), learner.size).mean_reward >= most:
            best = learner.averaged
        keep(best, folder / _FILE)
        return cls.load(problem, folder)

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the critic of a run."""
        return cls(problem, kept(problem, folder / _FILE))

    def act(self, observations: Floats) -> Floats:
        """Return launches of shape (n, k)."""
        parts = [self._landings(part) for part in np.array_split(observations, math.ceil(len(observations) / 64))]
        return self._landing.actions(observations, np.concatenate(parts).astype(np.float32))

    def _landings(self, observations: Floats) -> NDArray[np.float64]:
        anywhere = np.broadcast_to(self._box, (len(observations), *self._box.shape))
        cloud = np.broadcast_to(self._cloud, (len(observations), ACTING.starts, *self._cloud.shape))
        peaks, _ = searched(self._problem, self._critic, observations, anywhere, ACTING, lambda *_: cloud)
        return peaks[:, 0]


class _Learner:
    """Fits a critic to all landings labelled so far.

    Parameters
    ----------
    critic : Critic
    settings : dict
    turns : int
        How often it is going to learn.
    rng : numpy.random.Generator
    """

    def __init__(self, critic: Critic, settings: dict[str, Any], turns: int, rng: np.random.Generator) -> None:
        self.size = 0
        self._critic, self._rng = critic, rng
        self._steps, self._batch = settings["gradient_steps"], settings["batch_size"]
        rows = turns * settings["n_contexts"] * settings["n_tries"]
        self._inputs = np.empty((rows, critic.touch.width), np.float32)
        self._rewards = np.empty(rows, np.float32)
        average = get_ema_multi_avg_fn(_AVERAGED)  # type: ignore[no-untyped-call]
        self._fit = Fit(critic, settings["learning_rate"], turns * self._steps, average)

    @property
    def averaged(self) -> Critic:
        """The critic with weights averaged over the last steps."""
        return cast(Critic, self._fit.averaged)

    def add(self, samples: Samples) -> None:
        """Remember labelled landings."""
        rows = slice(self.size, self.size + len(samples.rewards))
        self._inputs[rows], self._rewards[rows] = samples
        self.size = rows.stop

    def learn(self) -> None:
        """Take the gradient steps of one turn."""
        for _ in range(self._steps):
            rows = self._rng.integers(0, self.size, self._batch)
            inputs, rewards = torch.from_numpy(self._inputs[rows]), torch.from_numpy(self._rewards[rows])
            self._fit.step(self._critic.bins.loss(self._critic(inputs), rewards))


def kept(problem: Problem, path: Path) -> Critic:
    """Return the critic that is kept in a file; raises as :func:`kept_weights`."""
    state = kept_weights(path)
    *layers, bins = (len(value) for name, value in state.items() if name.endswith("bias"))
    critic = Critic(Touch(problem), layers, bins)
    critic.load_state_dict(state)
    return critic


def _sobol(width: int, count: int) -> NDArray[np.float64]:
    """Return the first points of a Sobol sequence, shape (count, width)."""
    points: NDArray[np.float64] = qmc.Sobol(width, rng=np.random.default_rng(0)).random_base2((count - 1).bit_length())
    return points[:count]
