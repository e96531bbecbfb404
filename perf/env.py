"""Environment steps a second on sled_mat: the bare simulator, gym.make, SyncVectorEnv, native vector env, SB3 adapter.

A step of SledLaunch is a whole descent and includes the reset that follows it; one of SledDescent is a flight.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

import sledenv
from perf import show
from perf.harness import ratio, spread, take_turns, timed
from perf.reference import contexts, problem, settings

ROUNDS = 9
IDS = {"SledLaunch": "sledenv/SledLaunch-v0", "SledDescent": "sledenv/SledDescent-v0"}
SCENARIO = "sled_mat"
LANES = (64, 1024, 16384)
SINGLE = 64  # steps of a scalar environment in one turn, lanes of a SyncVectorEnv
ALONE = {"SledLaunch": "simulate()", "SledDescent": "Ride"}
BATCH = {"SledLaunch": "simulate_batch", "SledDescent": "RideBatch"}
MAKE = "gym.make"


def _bare(kind: str, lanes: int) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """Return runs of one step in the launches of as many contexts, one by one and as a batch."""
    scenario = sledenv.load_scenario(SCENARIO)
    low, high = (0.0, 0.0) if kind == "SledLaunch" else np.radians(scenario.control.orientation_deg).tolist()
    drawn = contexts(SCENARIO, lanes, orientation=(low, high))
    given, fields = problem(SCENARIO, drawn)
    each = [sledenv.Context(*row) for row in drawn.tolist()]
    problems: list[Any] = [(given[0], scenario.law(one), scenario.slope(one), scenario.launch(one)) for one in each]
    options = settings(**fields)

    def simulate_singly() -> None:
        for one in problems:
            sledenv.simulate(*one, **fields)

    if kind == "SledLaunch":
        return simulate_singly, lambda: sledenv.simulate_batch(*given, **options)
    rides = [sledenv.Ride(*problem, **options) for problem in problems[:SINGLE]]
    batch = sledenv.RideBatch(*given, **options)
    still, running = np.zeros(lanes), sledenv.STATUS_OF_CODE.index(sledenv.Status.RUNNING)

    def hop_singly() -> None:
        for i, ride in enumerate(rides):
            if ride.hop() != sledenv.Status.RUNNING:
                rides[i] = sledenv.Ride(*problems[i], **options)

    def hop() -> None:
        batch.hop(still)
        ended = np.flatnonzero(batch.outcomes()["status"] != running)
        if ended.size:
            batch.launch(ended, given[1][ended], scenario.slopes(drawn[ended]), given[3][ended])

    return hop_singly, hop


def _scalar(kind: str) -> Callable[[], Any]:
    env = gym.make(IDS[kind], scenario=SCENARIO)
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(SINGLE)]

    def run() -> None:
        for action in actions:
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return run


def vector(kind: str, lanes: int, mode: str = "vector_entry_point") -> Callable[[], Any]:
    """Return a run of one step of all lanes, the next episode begun in the same step."""
    same = AutoresetMode.SAME_STEP
    options = {"vector_kwargs": {"autoreset_mode": same}} if mode == "sync" else {"autoreset_mode": same.value}
    env: Any = gym.make_vec(IDS[kind], num_envs=lanes, vectorization_mode=mode, scenario=SCENARIO, **options)
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = env.action_space.sample()
    return lambda: env.step(actions)


def _sb3(kind: str, lanes: int) -> Callable[[], Any]:
    from sledenv.envs.sb3 import make_vec_env

    env = make_vec_env(IDS[kind], lanes, seed=0, env_kwargs={"scenario": SCENARIO})
    env.reset()
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (lanes, *(env.action_space.shape or ()))).astype(np.float32)
    return lambda: env.step(actions)


def _ways(kind: str, sizes: tuple[int, ...]) -> dict[str, tuple[str, Callable[[], Any], int]]:
    """Name of the bare simulator of as many lanes, run and steps of a run, by the name of the way to step."""
    alone = ALONE[kind]
    ways = {
        alone: (alone, _bare(kind, SINGLE)[0], SINGLE),
        MAKE: (alone, _scalar(kind), SINGLE),
        f"SyncVectorEnv, {SINGLE} lanes": (alone, vector(kind, SINGLE, "sync"), SINGLE),
    }
    for lanes in sizes:
        batch = f"{BATCH[kind]}, {lanes:,} lanes"
        ways[batch] = batch, _bare(kind, lanes)[1], lanes
        ways[f"native vector env, {lanes:,} lanes"] = batch, vector(kind, lanes), lanes
        ways[f"SB3 adapter, {lanes:,} lanes"] = batch, _sb3(kind, lanes), lanes
    return ways


def measure(rounds: int = ROUNDS, sizes: tuple[int, ...] = LANES) -> dict[str, Any]:
    """Measure both kinds of environments, one after the other."""
    rows = []
    for kind in IDS:
        ways = _ways(kind, sizes)
        times = take_turns({name: timed(run, steps) for name, (_, run, steps) in ways.items()}, rounds)
        rows += [
            {
                "env": kind,
                "name": name,
                "steps_per_s": spread(1.0 / times[name]),
                "of_bare": ratio(times[bare], times[name]),
                "bare": bare,
                "times_make": ratio(times[MAKE], times[name]),
            }
            for name, (bare, _, _) in ways.items()
        ]
    return {"rounds": rounds, "scenario": SCENARIO, "rows": rows}


def tables(result: dict[str, Any]) -> str:
    """Return the table of docs/performance.md, without the most lanes, which are no faster."""
    return show.table([row for row in result["rows"] if not row["name"].endswith(f" {LANES[-1]:,} lanes")], _COLUMNS)


_COLUMNS: show.Columns = {
    "environment": lambda row: row["env"],
    "how": lambda row: row["name"],
    "steps/s": lambda row: f"{row['steps_per_s']['median']:,.0f}",
    "of the bare simulator": lambda row: show.percent(row["of_bare"], 0) if row["bare"] != row["name"] else "-",
    "times gym.make": lambda row: show.median(row["times_make"]),
}
