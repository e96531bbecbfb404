"""CPU time of environment steps on one thread, beside the bare simulator and two environments of others.

A step of SledLaunch is a whole descent, one of SledDescent a flight; resets are included.
"""

from __future__ import annotations

import importlib.util
import itertools
import os
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

import sledenv
from perf.harness import publish, spread, take_turns, timed

ROUNDS = 9
IDS = {"SledLaunch": "sledenv/SledLaunch-v0", "SledDescent": "sledenv/SledDescent-v0"}
PEERS: dict[str, tuple[str, int]] = {"BipedalWalker-v3": ("Box2D", 64), "highway-v0": ("highway_env", 8)}
LANES = (64, 1024)
SINGLE = 64  # steps of a scalar environment in one run
MAKE = "gym.make"
_BANK = 4096  # scenes that the bare simulator takes at random
_WARM = 16  # steps before the first turn: then lanes are no longer all in the same flight


def _bare(kind: str, lanes: int) -> Callable[[], None]:
    """Return a run of one step of the simulator alone, given scenes and actions as the environment draws them."""
    from sledenv.envs.inputs import read_options

    rng = np.random.default_rng(0)
    task = gym.make(IDS[kind]).unwrapped.task  # type: ignore[attr-defined]
    bank = task.begin(read_options(None, None, _BANK), lambda drawn: rng.random((len(drawn), task.draws)))
    actions = rng.uniform(-1.0, 1.0, (_BANK, *task.action_space.shape))
    if kind == "SledLaunch":
        aimed = task.aimed(bank, actions)
        return lambda: task.simulator(aimed.take(rng.integers(_BANK, size=lanes))).run()
    spins = task.spins(bank, actions, np.zeros(_BANK, np.int64))
    simulator = task.rides(bank.take(np.arange(lanes)))
    running = sledenv.simulation.STATUS_OF_CODE.index(sledenv.Status.RUNNING)

    def hop() -> None:
        simulator.hop(spins[rng.integers(_BANK, size=lanes)])
        ended = np.flatnonzero(simulator.flights["status"] != running)
        if ended.size:
            simulator.launch(ended, bank.take(rng.integers(_BANK, size=ended.size)))
            simulator.wait(ended)

    return hop


def scalar(env: Any, steps: int = SINGLE) -> Callable[[], None]:
    """Return a run of random steps of one environment."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(steps)]

    def run() -> None:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return run


def vector(kind: str, lanes: int, mode: str = "vector_entry_point", **given: Any) -> Callable[[], Any]:
    """Return a run of one step of all lanes, the next episode begun in the same step."""
    same = AutoresetMode.SAME_STEP
    if mode == "sb3":
        from sledenv.envs.sb3 import make_vec_env

        env: Any = make_vec_env(IDS[kind], lanes, seed=0)
        env.reset()
    else:
        options = {"vector_kwargs": {"autoreset_mode": same}} if mode == "sync" else {"autoreset_mode": same.value}
        env = gym.make_vec(IDS[kind], num_envs=lanes, vectorization_mode=mode, **options, **given)
        env.reset(seed=0)
    shape = 16, lanes, env.action_space.shape[-1]
    actions = itertools.cycle(np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32))
    for _ in range(_WARM):
        env.step(next(actions))
    return lambda: env.step(next(actions))


def ways(kind: str, sizes: tuple[int, ...] = LANES) -> dict[str, Callable[[], float]]:
    """Return what measures the CPU time [s] per step, by the name of the way to step."""
    found = {
        "bare simulator": timed(_bare(kind, 1), 1),
        MAKE: timed(scalar(gym.make(IDS[kind])), SINGLE),
        f"{MAKE}, info=()": timed(scalar(gym.make(IDS[kind], info=())), SINGLE),
        f"SyncVectorEnv, {sizes[0]} lanes": timed(vector(kind, sizes[0], "sync"), sizes[0]),
    }
    for lanes in sizes:
        found |= {
            f"bare simulator, {lanes:,} lanes": timed(_bare(kind, lanes), lanes),
            f"native vector env, {lanes:,} lanes": timed(vector(kind, lanes), lanes),
            f"native vector env, {lanes:,} lanes, info=()": timed(vector(kind, lanes, info=()), lanes),
            f"SB3 adapter, {lanes:,} lanes": timed(vector(kind, lanes, "sb3"), lanes),
        }
    return found


def rows(measures: dict[tuple[str, str], Callable[[], float]], rounds: int) -> list[dict[str, Any]]:
    """Take the measurements in turn; ratios are taken within each round."""
    times = take_turns(measures, rounds)
    return [
        {
            "environment": env,
            "how": how,
            "µs per step": spread(1e6 * own),
            "times gym.make": spread(times[env, MAKE] / own),
        }
        for (env, how), own in times.items()
    ]


def measure() -> None:
    """Measure steps of the environments, and show them in docs/performance.md."""
    os.environ["NUMBA_NUM_THREADS"] = "1"
    measures = {(env, how): way for env in IDS for how, way in ways(env).items()}
    for env, (module, steps) in PEERS.items():
        if importlib.util.find_spec(module) is None:
            print(f"{env} is skipped: there is no {module}")
        else:
            measures[env, MAKE] = timed(scalar(gym.make(f"{module}:{env}"), steps), steps)
    publish("env", rows(measures, ROUNDS))
