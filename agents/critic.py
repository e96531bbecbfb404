"""A critic that knows the distribution of what every action still earns, and no actor: what it rates best is done."""

from __future__ import annotations

import copy
import math
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple, Self, cast
from zipfile import BadZipFile

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from scipy.stats import qmc

from sledenv.benchmark.problem import Problem
from sledenv.envs.vector import SledDescentVector, SledLaunchVector
from sledenv.machine.extras import needs

from .curve import Curve
from .features import Features, features_of

with needs("agents", __name__):
    import torch
    from torch import nn
    from torch.optim.swa_utils import AveragedModel

Floats = NDArray[np.float32]

_FILE: Final = "critic.npz"
_RANGE: Final = (-0.05, 1.05)  # of the bins: what is still earned lies in [0, 1]
_SMEAR: Final = 0.75  # standard deviation of a target, in bins: Farebrother et al., "Stop Regressing", 2024
_AVERAGED: Final = 0.998  # of the averaged weights, how much is kept in a step
_BLOCK: Final = 256  # observations that are rated at a time
_TRAINING, _ACTING = (1.6, 256), (0.8, 2048)  # spacing of the actions that are rated, over the blur; how many at most


class Critic(nn.Module):
    """Classifies what is still earned after an action into bins, each a class: a regression would smooth the cliffs.

    Parameters
    ----------
    width, action_width : int
        Numbers of inputs of an observation and of an action, see :mod:`sledenv.agents.features`.
    layers : sequence of int
        Units of the hidden layers. The first adds up what observations and actions contribute, so that the part of an
        observation is computed once for all of its actions.
    bins : int
    blur : float
        Standard deviation of the actions over which a rating is averaged: a narrow peak is a doubtful one.
    """

    mean: torch.Tensor
    deviation: torch.Tensor
    blur: torch.Tensor
    edges: torch.Tensor

    def __init__(self, width: int, action_width: int, layers: list[int], bins: int, blur: float) -> None:
        super().__init__()
        self.seen, self.action = nn.Linear(width, layers[0]), nn.Linear(action_width, layers[0], bias=False)
        hidden = [(nn.Linear(a, b), nn.SiLU()) for a, b in pairwise(layers)]
        self.hidden = nn.Sequential(nn.SiLU(), *(part for pair in hidden for part in pair))
        self.last = nn.Linear(layers[-1], bins)
        self.register_buffer("mean", torch.zeros(width + action_width))
        self.register_buffer("deviation", torch.ones(width + action_width))
        self.register_buffer("blur", torch.tensor(blur))
        self.register_buffer("edges", torch.linspace(*_RANGE, bins + 1), persistent=False)

    def forward(self, seen: torch.Tensor, actions: torch.Tensor) -> torch.Tensor:
        """Return logits of the bins, (n, m, bins), for observations (n, width) and actions (n, m, action_width)."""
        width = seen.shape[-1]
        first = self.seen((seen - self.mean[:width]) / self.deviation[:width])[:, None]
        values = first + self.action((actions - self.mean[width:]) / self.deviation[width:])
        logits: torch.Tensor = self.last(self.hidden(values))
        return logits

    def loss(self, seen: torch.Tensor, actions: torch.Tensor, earned: torch.Tensor) -> torch.Tensor:
        """Return the mean cross-entropy against what was earned, (n,), each a narrow normal distribution (HL-Gauss)."""
        deviation = _SMEAR * (self.edges[1] - self.edges[0])
        below = torch.special.ndtr((self.edges - earned[:, None]) / deviation)
        return nn.functional.cross_entropy(self(seen, actions)[:, 0], below.diff(dim=1))

    @torch.no_grad()
    def rate(self, features: Features, observations: Floats, actions: Floats) -> Floats:
        """Return what is expected of the same actions, shape (m, k), in each observation; shape (n, m)."""
        inputs = features.of_actions(observations, np.broadcast_to(actions, (len(observations), *actions.shape)))
        logits = self(torch.from_numpy(observations), torch.from_numpy(inputs))
        expected = logits.softmax(dim=-1) @ (0.5 * (self.edges[1:] + self.edges[:-1]))
        return np.asarray(expected.numpy())


class Search:
    """Seeks the actions that a critic rates best among always the same ones, spread evenly.

    Parameters
    ----------
    problem : Problem
    blur : float
        Standard deviation of the actions over which ratings are averaged, beside that with which an action is missed.
    spacing : float
        Of the actions, over the standard deviation of both.
    most : int
        How many actions there may be.
    """

    def __init__(self, problem: Problem, blur: float, spacing: float, most: int) -> None:
        self.features, width = features_of(problem), problem.actions
        off = math.hypot(blur, self.features.error)
        count = min(round((2.0 / (spacing * off)) ** width), most)
        if width == 1:
            step = 2.0 / (count - 1)
            beyond = math.ceil(2.0 * off / step) if self.features.error else 0  # what is done may lie outside
            rated = step * np.arange(-beyond, count + beyond)[:, np.newaxis] - 1.0
            asked = rated[beyond : beyond + count]
        else:
            rated = asked = 2.0 * qmc.Sobol(width, rng=np.random.default_rng(0)).random(count) - 1.0
        self.actions: Floats = asked.astype(np.float32)
        self._rated = rated.astype(np.float32)
        apart = np.square(rated[:, np.newaxis] - asked).sum(axis=-1)
        near = np.exp(-0.5 * apart / off**2)
        self._near = (near / near.sum(axis=0)).astype(np.float32)

    def best(self, critics: Sequence[Critic], observations: Floats) -> tuple[Floats, Floats]:
        """Return the best actions and what critics expect of them in the mean, shapes (n, k) and (n,)."""
        parts = np.array_split(observations, max(1, math.ceil(len(observations) / _BLOCK)))
        ratings = np.concatenate([self._ratings(critics, part) for part in parts])
        return self.actions[ratings.argmax(axis=1)], ratings.max(axis=1)

    def _ratings(self, critics: Sequence[Critic], observations: Floats) -> Floats:
        rated = sum(critic.rate(self.features, observations, self._rated) for critic in critics)
        averaged: Floats = rated @ self._near / np.float32(len(critics))
        return averaged


class Samples(NamedTuple):
    """Actions, each with what was earned from it on."""

    seen: Floats  # (n, width)
    actions: Floats  # (n, 1, action_width)
    earned: Floats  # (n,)


class Episodes:
    """Goes on acting in many lanes, mostly as a critic rates best.

    Some actions are drawn from anywhere and some near the best, or nothing would be learned of others. Learned from is
    the action that was done, where that can be seen, and not the one that was asked for. What it earned is known if all
    that follow are the best ones; else it is the reward up to the next trial, and from there on what the critic expects
    of the best.

    Parameters
    ----------
    problem : Problem
    settings : dict
    seed : int
    """

    def __init__(self, problem: Problem, settings: dict[str, Any], seed: int) -> None:
        self.ended = 0
        self._lanes, self._steps = settings["n_envs"], settings["n_steps"]
        self._anywhere, self._near, self._width = settings["anywhere"], settings["near"], settings["near_width"]
        self._rng = np.random.default_rng(seed)
        self._search = Search(problem, settings["blur"], *_TRAINING)
        self._spacing = 2.0 / len(self._search.actions) ** (1.0 / problem.actions)
        kind = SledDescentVector if problem.environment == "descent" else SledLaunchVector
        kwargs = problem.env_kwargs | {"split": "train", "info": (), "autoreset_mode": AutoresetMode.SAME_STEP}
        self._env = kind(self._lanes, **kwargs)
        # No two seeds share a lane's stream of contexts.
        self._seen, _ = self._env.reset(seed=seed * self._lanes)

    def sample(self, critic: Critic | None) -> Samples:
        """Act ``n_steps`` times in each lane, without a critic anyhow."""
        steps, lanes, features = self._steps, self._lanes, self._search.features
        rewards, expected = np.zeros((steps, lanes), np.float32), np.zeros((steps + 1, lanes), np.float32)
        ended, best = np.zeros((steps, lanes), bool), np.zeros((steps + 1, lanes), bool)
        told = []
        for step in range(steps + 1):
            if step == steps and ended[-1].all():
                break
            actions, best[step], expected[step] = self._chosen(critic)
            if step == steps:
                break
            before = self._seen
            self._seen, rewards[step], ended[step], _, info = self._env.step(actions)
            after = self._seen.copy()
            if ended[step].any():
                after[ended[step]] = np.stack(info["final_obs"][ended[step]])
            done = features.done(actions, after)
            told.append((before, features.of_actions(before, done[:, np.newaxis])))
        self.ended += int(ended.sum())
        earned, after = np.zeros_like(rewards), expected[-1]
        for step in reversed(range(steps)):
            earned[step] = rewards[step] + np.where(ended[step], 0.0, after)
            after = np.where(best[step] | (critic is None), earned[step], expected[step])
        seen, inputs = (np.concatenate(part) for part in zip(*told, strict=True))
        return Samples(seen, inputs, earned.ravel())

    def _chosen(self, critic: Critic | None) -> tuple[Floats, NDArray[np.bool_], Floats]:
        """Return actions of shape (n, k), whether each is the best, and what is expected of the best."""
        rng, shape = self._rng, (self._lanes, self._search.actions.shape[1])
        anywhere = rng.uniform(-1.0, 1.0, shape)
        if critic is None:
            return anywhere.astype(np.float32), np.zeros(self._lanes, bool), np.zeros(self._lanes, np.float32)
        actions, expected = self._search.best([critic], self._seen)
        within = actions + 0.5 * self._spacing * rng.uniform(-1.0, 1.0, shape)  # half of the way to the next
        near = actions + self._width * rng.standard_normal(shape)
        kind = rng.random((self._lanes, 1))
        tried = kind < self._anywhere + self._near
        actions = np.where(kind < self._anywhere, anywhere, np.where(tried, near, within))
        return np.clip(actions, -1.0, 1.0).astype(np.float32), ~tried[:, 0], expected


class Agent:
    """Does what its critics rate best in the mean, of always the same actions: it is a function of what it sees."""

    def __init__(self, problem: Problem, critics: Sequence[Critic]) -> None:
        self._critics, self._search = critics, Search(problem, float(critics[0].blur), *_ACTING)

    @classmethod
    def train(cls, problem: Problem, settings: dict[str, Any], seed: int, folder: Path) -> Self:
        """Train critics, each in lanes of its own: what one overrates by chance the others do not.

        A critic acts and learns by turns, both at the same time: actions follow the network of the turn before. The
        network that earns most on the validation contexts is kept.

        Parameters
        ----------
        problem : Problem
        settings : dict
            ``n_timesteps`` steps, shared by so many ``critics``; ``n_steps`` a turn in each of ``n_envs`` lanes; the
            shares of actions that are tried ``anywhere`` and ``near`` the best, these with a standard deviation of
            ``near_width``; the last ``memory`` steps are learned from, each ``n_epochs`` times in the mean;
            ``batch_size``, ``learning_rate`` (falls to 0 as a cosine), ``net_arch``, ``bins``, ``blur`` and ``checks``,
            how often each critic is validated.
        seed : int
            Of the networks, the contexts and the actions; equal seeds give equal agents.
        folder : Path
            Where the weights and the learning curve are written.
        """
        torch.set_num_threads(1)  # the other cores simulate
        curve, count = Curve(problem, folder), settings["critics"]
        steps = math.ceil(settings["n_timesteps"] / count)
        critics = [cls._trained(problem, settings, steps, seed * count + i, curve) for i in range(count)]
        _write(critics, folder / _FILE)
        return cls.load(problem, folder)

    @classmethod
    def _trained(cls, problem: Problem, settings: dict[str, Any], steps: int, seed: int, curve: Curve) -> Critic:
        torch.manual_seed(seed)
        width = problem.task.observation_space.shape[0]
        layers, bins, blur = settings["net_arch"], settings["bins"], settings["blur"]
        critic = Critic(width, features_of(problem).width, layers, bins, blur)
        turns = max(2, math.ceil(steps / (settings["n_envs"] * settings["n_steps"])))
        episodes, learner = Episodes(problem, settings, seed), _Learner(critic, settings, turns, seed)
        best, most, before = learner.averaged, -1.0, curve.descents  # those of the critics before
        with ThreadPoolExecutor(1) as pool:
            coming = pool.submit(episodes.sample, None)
            for turn in range(turns):
                learner.add(coming.result())
                known = copy.deepcopy(learner.averaged)
                if turn % max(1, turns // settings["checks"]) == 0 or turn == turns - 1:  # while nothing else runs
                    check = curve.check(cls(problem, [known]), before + episodes.ended)
                    if check.mean_reward > most:
                        best, most = known, check.mean_reward
                    if sys.stderr.isatty():
                        print(f"{learner.known} steps: mean reward {check.mean_reward:.3f}", file=sys.stderr)
                if turn + 1 < turns:
                    coming = pool.submit(episodes.sample, known if turn else None)
                    learner.learn()
        return best

    @classmethod
    def load(cls, problem: Problem, folder: Path) -> Self:
        """Read the critics of a run.

        Raises
        ------
        ValueError
            If its file cannot be read, or a weight is no finite number: whatever is rated by it would be tried first.
        """
        critics = []
        for state in _read(folder / _FILE):
            *layers, bins = (len(value) for name, value in state.items() if name.endswith("bias"))
            critic = Critic(state["seen.weight"].shape[1], state["action.weight"].shape[1], layers, bins, 0.0)
            critic.load_state_dict(state)
            critics.append(critic)
        return cls(problem, critics)

    def act(self, observations: Floats) -> Floats:
        """Return actions of shape (n, k)."""
        return self._search.best(self._critics, observations)[0]

    def expected(self, observations: Floats) -> Floats:
        """Return what they expect to earn from now on, shape (n,)."""
        return self._search.best(self._critics, observations)[1]


class _Learner:
    """Fits a critic to the last samples; ``turns`` is how many will have been added in the end."""

    def __init__(self, critic: Critic, settings: dict[str, Any], turns: int, seed: int) -> None:
        self.known = 0  # steps
        self._critic, self._rng = critic, np.random.default_rng([seed, 1])
        turn = settings["n_envs"] * settings["n_steps"]
        self._batch, self._steps = settings["batch_size"], turn * settings["n_epochs"] // settings["batch_size"]
        rows = turn * max(1, min(turns, settings["memory"] // turn))
        shapes = (rows, critic.seen.in_features), (rows, 1, critic.action.in_features), (rows,)
        self._memory = Samples(*(np.empty(shape, np.float32) for shape in shapes))
        self._optimiser = torch.optim.AdamW(
            critic.parameters(), settings["learning_rate"], weight_decay=1e-4, fused=True
        )
        self._schedule = torch.optim.lr_scheduler.CosineAnnealingLR(self._optimiser, (turns - 1) * self._steps)
        self._average = AveragedModel(critic, multi_avg_fn=_averaged)

    @property
    def averaged(self) -> Critic:
        """The critic with weights averaged over the last steps."""
        return cast(Critic, self._average.module)

    def add(self, samples: Samples) -> None:
        """Remember samples in place of the oldest ones; the first give the scales of the inputs."""
        if not self.known:
            inputs = np.hstack([samples.seen, samples.actions[:, 0]])
            for critic in (self._critic, self.averaged):
                critic.mean.copy_(torch.from_numpy(inputs.mean(axis=0)))
                critic.deviation.copy_(torch.from_numpy(inputs.std(axis=0) + 0.01))
        start = self.known % len(self._memory.earned)
        for kept, new in zip(self._memory, samples, strict=True):
            kept[start : start + len(new)] = new
        self.known += len(samples.earned)

    def learn(self) -> None:
        """Take the gradient steps of one turn."""
        for _ in range(self._steps):
            rows = self._rng.integers(0, min(self.known, len(self._memory.earned)), self._batch)
            loss = self._critic.loss(*(torch.from_numpy(part[rows]) for part in self._memory))
            self._optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            self._optimiser.step()
            self._schedule.step()
            self._average.update_parameters(self._critic)


@torch.no_grad()
def _averaged(means: Any, weights: Any, count: Any) -> None:
    """Move averaged weights towards those of a step; at first faster, so that the initial ones are soon forgotten."""
    kept = min(_AVERAGED, (1.0 + float(count)) / (10.0 + float(count)))
    for mean, weight in zip(means, weights, strict=True):
        mean.lerp_(weight, 1.0 - kept)


def _write(critics: Sequence[Critic], path: Path) -> None:
    """Write critics as plain arrays of half precision: nothing that could run when it is read."""
    states = enumerate(critic.state_dict() for critic in critics)
    arrays = {f"{i}.{name}": value.numpy() for i, state in states for name, value in state.items()}
    np.savez_compressed(path, **{name: one.astype(np.float16) if one.ndim else one for name, one in arrays.items()})


def _read(path: Path) -> list[dict[str, torch.Tensor]]:
    """Return the weights of each critic."""
    states: dict[str, dict[str, torch.Tensor]] = {}
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            for name in arrays.files:
                number, _, part = name.partition(".")
                states.setdefault(number, {})[part] = torch.from_numpy(arrays[name].astype(np.float32))
    except (OSError, EOFError, ValueError, BadZipFile) as error:
        raise ValueError(f"{path} cannot be read: {error}") from error
    for number, state in states.items():
        wrong = [name for name, value in state.items() if not value.isfinite().all()]
        if wrong:
            raise ValueError(f"{path}: {number}.{wrong[0]} has weights that are no finite numbers")
    return list(states.values())
