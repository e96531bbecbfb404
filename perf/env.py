"""Environment steps a second on brake_mat: the bare simulator, gym.make, SyncVectorEnv, native vector env, SB3 adapter.

A step of SledLaunch is a whole descent and includes the reset that follows it; one of SledDescent is a hop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

import sledenv
from perf.harness import (
    Competitor,
    figure_of,
    interleave,
    ratio,
    save,
    spread,
    table,
)
from perf.reference import settings
from sledenv.kernel.records import RUNNING

ROUNDS = 9
IDS = {"SledLaunch": "sledenv/SledLaunch-v0", "SledDescent": "sledenv/SledDescent-v0"}
SCENARIO = "brake_mat"
LANES = (64, 1024, 16384)
SYNC_LANES = 64
SINGLE = 64  # steps of a scalar environment in one turn
ALONE = {"SledLaunch": "simulate()", "SledDescent": "Ride"}
BATCH = {"SledLaunch": "simulate_batch", "SledDescent": "RideBatch"}
MAKE, SYNC = "gym.make", f"SyncVectorEnv, {SYNC_LANES} lanes"


def _bare_name(kind: str, lanes: int) -> str:
    return f"{BATCH[kind]}, {lanes:,} lanes"


def _native_name(lanes: int) -> str:
    return f"native vector env, {lanes:,} lanes"


def _sb3_name(lanes: int) -> str:
    return f"SB3 adapter, {lanes:,} lanes"


def _bare(kind: str, lanes: int) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """Return runs of one step in the launches of as many contexts, one by one and as a batch."""
    scenario = sledenv.load_scenario(SCENARIO)
    contexts = scenario.contexts(np.random.default_rng(0).random((lanes, len(sledenv.Context._fields))))
    body, limits = scenario.body(), scenario.limits
    laws, slopes, states = scenario.laws(contexts), scenario.slopes(contexts), scenario.launches(contexts)
    problems = [
        (body, sledenv.ContactLaw(*law), sledenv.Slope(*slope), sledenv.State(*state))
        for law, slope, state in zip(laws.tolist(), slopes.tolist(), states.tolist(), strict=True)
    ]
    fields: dict[str, Any] = {
        "max_time": limits.max_time_s,
        "max_rebounds": limits.max_rebounds,
        "end_on_chord": scenario.ends.on_chord,
    }

    options = settings(**fields)

    def simulate_singly() -> None:
        for problem in problems:
            sledenv.simulate(*problem, **fields)

    if kind == "SledLaunch":
        return simulate_singly, lambda: sledenv.simulate_batch(body, laws, slopes, states, **options)
    rides = [sledenv.Ride(*problem, **options) for problem in problems[:SINGLE]]
    batch = sledenv.RideBatch(body, laws, slopes, states, **options)
    still = np.zeros(lanes)

    def hop_singly() -> None:
        for i, ride in enumerate(rides):
            if ride.hop() != sledenv.Status.RUNNING:
                rides[i] = sledenv.Ride(*problems[i], **options)

    def hop() -> None:
        batch.hop(still)
        ended = np.flatnonzero(batch.outcomes()["status"] != RUNNING)
        if ended.size:
            batch.launch(ended, laws[ended], slopes[ended], states[ended])

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


def _vector(kind: str, lanes: int, mode: str) -> Callable[[], Any]:
    """Return a run of one step of all lanes, the next episode begun in the same step."""
    options: dict[str, Any] = (
        {"vector_kwargs": {"autoreset_mode": AutoresetMode.SAME_STEP}}
        if mode == "sync"
        else {"autoreset_mode": AutoresetMode.SAME_STEP.value}
    )
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


def _measure(kind: str, rounds: int, sizes: tuple[int, ...]) -> list[dict[str, Any]]:
    """Return a row for each way to step one kind of environment."""
    competitors = [
        Competitor(ALONE[kind], _bare(kind, SINGLE)[0], SINGLE),
        Competitor(MAKE, _scalar(kind), SINGLE),
        Competitor(SYNC, _vector(kind, SYNC_LANES, "sync"), SYNC_LANES),
    ]
    for lanes in sizes:
        competitors += [
            Competitor(_bare_name(kind, lanes), _bare(kind, lanes)[1], lanes),
            Competitor(_native_name(lanes), _vector(kind, lanes, "vector_entry_point"), lanes),
            Competitor(_sb3_name(lanes), _sb3(kind, lanes), lanes),
        ]
    times = interleave(competitors, rounds)
    rows = []
    for name, found in times.items():
        lanes_text = name.rpartition(", ")[2]
        bare = f"{BATCH[kind]}, {lanes_text}" if lanes_text != name and name != SYNC else ALONE[kind]
        rows.append(
            {
                "env": kind,
                "name": name,
                "steps_per_s": spread(1.0 / found),
                "of_bare": ratio(times[bare], found),
                "bare": bare,
                "times_make": ratio(times[MAKE], found),
            }
        )
    return rows


def main(rounds: int = ROUNDS, sizes: tuple[int, ...] = LANES) -> None:
    """Measure and write."""
    rows = [row for kind in IDS for row in _measure(kind, rounds, sizes)]
    result = {"rounds": rounds, "scenario": SCENARIO, "rows": rows}
    save("env", result)


def tables(result: dict[str, Any]) -> str:
    """Return the table of docs/performance.md."""
    rows = [
        (
            row["env"],
            row["name"],
            f"{row['steps_per_s']['median']:,.0f}",
            f"{100.0 * row['of_bare']['median']:.0f} % of {row['bare']}" if row["bare"] != row["name"] else "-",
            figure_of(row["times_make"]["median"]),
        )
        for row in result["rows"]
    ]
    return table(("environment", "how", "steps/s", "of the bare simulator", "times gym.make"), rows)


if __name__ == "__main__":
    main()
