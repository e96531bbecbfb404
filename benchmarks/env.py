"""Environment steps a second on brake_mat: the bare simulator, gym.make, SyncVectorEnv, native vector env, SB3 adapter.

An episode of SledLaunch has one step, so a step is a whole descent and includes the reset that follows it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

import sledenv
from benchmarks.harness import (
    BLUE,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    Competitor,
    bars,
    drawing,
    figure_of,
    interleave,
    ratio,
    save,
    spread,
    table,
)

ROUNDS = 9
ID, SCENARIO = "sledenv/SledLaunch-v0", "brake_mat"
LANES = (64, 1024, 16384)
SYNC_LANES = 64
SINGLE = 64  # steps of a scalar environment in one turn
SIMULATE, MAKE, SYNC = "simulate()", "gym.make", f"SyncVectorEnv, {SYNC_LANES} lanes"


def _bare_name(lanes: int) -> str:
    return f"simulate_batch, {lanes:,} lanes"


def _native_name(lanes: int) -> str:
    return f"native vector env, {lanes:,} lanes"


def _sb3_name(lanes: int) -> str:
    return f"SB3 adapter, {lanes:,} lanes"


def _bare(lanes: int) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """Return runs that simulate the launches of as many contexts, one by one and as a batch."""
    scenario = sledenv.load_scenario(SCENARIO)
    rng = np.random.default_rng(0)
    body, limits = scenario.body(), scenario.limits
    contexts = [scenario.sample(rng) for _ in range(lanes)]
    laws = [scenario.law(context) for context in contexts]
    slopes = [scenario.slope(context) for context in contexts]
    states = [scenario.launch(context) for context in contexts]
    options: dict[str, Any] = {"max_time": limits.max_time_s, "max_rebounds": limits.max_rebounds}

    def singly() -> None:
        for law, slope, state in zip(laws, slopes, states, strict=True):
            sledenv.simulate(body, law, slope, state, **options)

    return singly, lambda: sledenv.simulate_batch(body, laws, slopes, states, **options)


def _scalar() -> Callable[[], Any]:
    env = gym.make(ID, scenario=SCENARIO)
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(SINGLE)]

    def run() -> None:
        for action in actions:
            env.step(action)
            env.reset()

    return run


def _vector(lanes: int, mode: str) -> Callable[[], Any]:
    """Return a run of one step of all lanes, the next episode begun in the same step."""
    options: dict[str, Any] = (
        {"vector_kwargs": {"autoreset_mode": AutoresetMode.SAME_STEP}}
        if mode == "sync"
        else {"autoreset_mode": AutoresetMode.SAME_STEP.value}
    )
    env: Any = gym.make_vec(ID, num_envs=lanes, vectorization_mode=mode, scenario=SCENARIO, **options)
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = env.action_space.sample()
    return lambda: env.step(actions)


def _sb3(lanes: int) -> Callable[[], Any]:
    from sledenv.envs.sb3 import make_vec_env

    env = make_vec_env(ID, lanes, seed=0, env_kwargs={"scenario": SCENARIO})
    env.reset()
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (lanes, *(env.action_space.shape or ()))).astype(np.float32)
    return lambda: env.step(actions)


def main(rounds: int = ROUNDS, sizes: tuple[int, ...] = LANES) -> None:
    """Measure, write and draw."""
    competitors = [
        Competitor(SIMULATE, _bare(SINGLE)[0], SINGLE),
        Competitor(MAKE, _scalar(), SINGLE),
        Competitor(SYNC, _vector(SYNC_LANES, "sync"), SYNC_LANES),
    ]
    for lanes in sizes:
        competitors += [
            Competitor(_bare_name(lanes), _bare(lanes)[1], lanes),
            Competitor(_native_name(lanes), _vector(lanes, "vector_entry_point"), lanes),
            Competitor(_sb3_name(lanes), _sb3(lanes), lanes),
        ]
    times = interleave(competitors, rounds)
    rows = []
    for name, found in times.items():
        lanes_text = name.rpartition(", ")[2]
        bare = f"simulate_batch, {lanes_text}" if lanes_text != name and name != SYNC else SIMULATE
        rows.append(
            {
                "name": name,
                "steps_per_s": spread(1.0 / found),
                "of_bare": ratio(times[bare], found),
                "bare": bare,
                "times_make": ratio(times[MAKE], found),
            }
        )
    result = {"rounds": rounds, "scenario": SCENARIO, "rows": rows}
    save("env", result)
    draw(result)


def draw(result: dict[str, Any]) -> None:
    """Bars of steps a second."""
    looks = {"simulate": GREY, "native": BLUE, "SB3": PURPLE, "gym": ORANGE, "Sync": SKY}
    names = [row["name"] for row in result["rows"]]
    colours = [next(colour for start, colour in looks.items() if name.startswith(start)) for name in names]
    with drawing("env", (9.0, 5.4)) as (_, ax):
        bars(ax, names, [row["steps_per_s"] for row in result["rows"]], colours, "steps a second (higher is better)")
        ax.set_title(f"SledLaunch on {result['scenario']}: a step is a whole descent", loc="left")


def tables(result: dict[str, Any]) -> str:
    """Return the table of docs/performance.md."""
    rows = [
        (
            row["name"],
            f"{row['steps_per_s']['median']:,.0f}",
            f"{100.0 * row['of_bare']['median']:.0f} % of {row['bare']}" if row["bare"] != row["name"] else "-",
            figure_of(row["times_make"]["median"]),
        )
        for row in result["rows"]
    ]
    return table(("how", "steps/s", "of the bare simulator", "times gym.make"), rows)


if __name__ == "__main__":
    main()
