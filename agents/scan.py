"""Scan of what a scenario of rides asks of an agent: ``python -m sledenv.agents.scan SCENARIO``."""

from __future__ import annotations

import sys
from typing import Annotated, Any, Final

import numpy as np
from cyclopts import Parameter
from cyclopts.validators import Number
from numpy.typing import NDArray

from sledenv.benchmark.evaluation import Evaluation
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.scores import mean_interval, share_interval, told
from sledenv.command.arguments import POSITIVE, ScenarioName, integer
from sledenv.command.running import app, run
from sledenv.envs.inputs import Contexts
from sledenv.machine.text_tables import aligned
from sledenv.scenarios.scenario import Scenario, Split, load_scenario
from sledenv.simulation.records import RUNNING

from .clairvoyant import LONGEST, follow_plans
from .land_parallel import Agent as LandParallel
from .replan import Agent as Replan
from .zero import Agent as Zero

Floats = NDArray[np.float64]

CONTEXTS: Final = 400
SPINS: Final = (33, 5)  # that the planner tries in the next flight and in the one behind it
CONSTANTS: Final = np.linspace(-1.0, 1.0, 21)
SHOTS: Final = 256  # rides with random trims, where neither the planner nor a constant finishes
NEAR: Final = 0.01  # of a reward
FIRST: Final = np.linspace(-1.0, 1.0, 1001)  # trims along which jumps are counted,
JUMPY: Final = 40  # in so many contexts
HARD: Final = 45.0  # weights of the body

_Factor = Annotated[float, POSITIVE]


class _Trying:
    """Tries given trims in the first flight, and lands parallel behind it."""

    def __init__(self, problem: Problem, first: Floats) -> None:
        self._rule, self._first = LandParallel(problem), first

    def plan(self, scenes: Any, flights: Any) -> NDArray[np.float32]:
        """Return trims: those that are tried once, then those of the rule."""
        first, self._first = self._first, np.empty(0)
        if not first.size:
            return self._rule.plan(scenes, flights)
        # A ride that has ended before its first flight has done so with all trims.
        return np.resize(first, (len(scenes.rows), 1)).astype(np.float32)


def changed(scenario: Scenario, factor: float, faster: float, stiffness: float | None, noise: float | None) -> Scenario:
    """Return a scenario with higher bumps and faster launches, of another stiffness, with another error of trims."""
    content = scenario.model_dump(by_alias=True)
    content["launch"]["speed_m_s"] = [faster * speed for speed in content["launch"]["speed_m_s"]]
    if content["slope"]["bumps"] is not None:
        content["slope"]["bumps"]["height_m"] = [factor * height for height in content["slope"]["bumps"]["height_m"]]
    if stiffness is not None:
        content["contact"]["stiffness_n_m"] = stiffness
    if noise is not None:
        content["rider"]["noise_rad_s"] = noise
    return Scenario.model_validate(content)


def scored(problem: Problem, agent: Any, scenes: Contexts, name: str) -> tuple[Evaluation, Floats]:
    """Return how an agent does in scenes, and its trims."""
    batch, trims = problem.ride(agent, scenes)
    return Evaluation(name, problem.scenario.id, batch.jam.reward, batch.status[:, np.newaxis]), trims


def constants(problem: Problem, scenes: Contexts) -> tuple[Floats, NDArray[np.bool_]]:
    """Return what each constant trim earns in each scene and whether it finishes, shapes (n, 21)."""
    many = len(CONSTANTS)
    plans = np.tile(np.repeat(CONSTANTS[:, np.newaxis], LONGEST, axis=1), (len(scenes), 1))
    batch = follow_plans(problem, np.repeat(scenes, many, axis=0), plans)
    return batch.jam.reward.reshape(-1, many), (batch.status == "finish").reshape(-1, many)


def finished_by_chance(problem: Problem, scenes: Contexts) -> NDArray[np.bool_]:
    """Return in which scenes one of so many rides with random trims finishes."""
    shots = np.random.default_rng(0).uniform(-1.0, 1.0, (SHOTS, LONGEST))
    batch = follow_plans(problem, np.repeat(scenes, SHOTS, axis=0), np.tile(shots, (len(scenes), 1)))
    return np.asarray((batch.status == "finish").reshape(-1, SHOTS).any(axis=1))


def forces(problem: Problem, scenes: Contexts, trims: Floats) -> Floats:
    """Return the largest force of the ride of trims of shape (n, d) in each scene, in weights of its body."""
    task = problem.task
    rides = task.simulator(task.scenes(scenes), keep_rebounds=True)
    rides.wait()
    flight = 0
    while (rides.flights["status"] == RUNNING).any():  # as the rides whose trims these are
        asked = np.nan_to_num(trims[:, [flight]])
        rides.hop(task.spins(rides.scenes, asked, np.full(len(scenes), flight)))
        flight += 1
    weights = rides.scenes.of_body("mass") * problem.scenario.slope_section.gravity_m_s2
    return np.asarray(rides.descents().rebounds["peak_force"].max(axis=1, initial=0.0) / weights)


def jumps(scenario: Scenario, scenes: Contexts) -> NDArray[np.int64]:
    """Count the jumps of the reward along the first trim of rides without errors, in each scene."""
    steady = Problem(changed(scenario, 1.0, 1.0, None, 0.0), "descent")
    agent: Any = _Trying(steady, FIRST)
    batch, _ = steady.ride(agent, np.repeat(scenes, len(FIRST), axis=0))
    rewards = batch.jam.reward.reshape(-1, len(FIRST))
    return np.asarray((np.abs(np.diff(rewards, axis=1)) > NEAR).sum(axis=1))


def table(scenario: Scenario, split: Split, contexts: int, spins: list[int], jumpy: int) -> str:
    """Return what a scenario asks as text."""
    problem = Problem(scenario, "descent")
    scenes = problem.drawn(problem.contexts(split, contexts), split)
    planner, trims = scored(problem, Replan(problem, spins), scenes, "planner")
    rule, _ = scored(problem, LandParallel(problem), scenes, "rule")
    zero, _ = scored(problem, Zero(problem), scenes, "no trim")
    earned, finished = constants(problem, scenes)

    rows = [["agent", "mean reward [95 %]", "behind the planner [95 %]", "less", "falls [95 %]", "finished"]]
    for one in (planner, rule, zero):
        gap = planner.rewards - one.rewards
        behind = [told(float(gap.mean()), mean_interval(gap), ".3f"), f"{1.0 - one.mean / planner.mean:.1%}"]
        falls = told(one.falls, one.falls_interval, ".1%")
        rows.append([one.policy, told(one.mean, one.interval, ".3f"), *behind, falls, f"{one.finished:.1%}"])
    lines = aligned(rows, ["<10", "<"])

    near = planner.rewards - NEAR
    alone = np.flatnonzero(~((planner.status[:, 0] == "finish") | finished.any(axis=1)))
    hopeless = np.zeros(contexts)
    hopeless[alone] = ~finished_by_chance(problem, scenes[alone]) if alone.size else 0.0
    force = forces(problem, scenes, trims)
    found = [
        [f"no trim within {NEAR} of the planner", _share(zero.rewards >= near)],
        ["the best constant trim is", _share(earned.max(axis=1) >= near)],
        ["nothing finishes", f"{int(hopeless.sum())} contexts"],
        ["largest force, weights", f"median {np.median(force):.0f}, above {HARD:.0f} in {(force > HARD).mean():.0%}"],
    ]
    if jumpy:
        counts = jumps(scenario, scenes[:jumpy])
        low, middle, high = np.quantile(counts, [0.25, 0.5, 0.75])
        ends = f"quarters {low:.0f} and {high:.0f} ({jumpy} contexts)"
        found.append(["jumps along the first trim", f"median {middle:.0f}, {ends}"])
    head = f"{scenario.id}, hash {problem.scenario.hash}, {contexts} contexts of {split}, planner {spins}"
    return "\n".join([head, *lines, "", *aligned(found, ["<36", "<"])])


def _share(these: NDArray[np.bool_]) -> str:
    """Write in which share of contexts something holds, with its interval."""
    return told(float(these.mean()), share_interval(these), ".1%")


command = app("python -m sledenv.agents.scan", "Tell what a scenario of rides asks of an agent.")


@command.default
def _scan(
    scenario: Annotated[ScenarioName, Parameter(required=True)],
    /,
    *,
    contexts: Annotated[int, integer(2)] = CONTEXTS,
    split: Split = "test",
    factor: _Factor = 1.0,
    faster: _Factor = 1.0,
    stiffness: Annotated[float | None, POSITIVE] = None,
    noise: Annotated[float | None, Parameter(validator=Number(gte=0, lte=10))] = None,
    spins: Annotated[tuple[int, ...], integer(2, several=True)] = SPINS,
    jumpy: Annotated[int, integer(0)] = JUMPY,
) -> None:
    """Compare a planner with a rule, no trim and constant trims, look for what nothing finishes, and measure forces.

    Parameters
    ----------
    contexts
        Number of contexts.
    split
        Whose contexts: choose with those of validation, confirm with those of test.
    factor, faster
        By which bumps are higher and launches are faster than the scenario says.
    stiffness, noise
        Of the contact [N/m] and of the trims [rad/s], in place of those of the scenario.
    spins
        That the planner tries in the next flight, in the one behind it, and so on.
    jumpy
        Contexts in which jumps of the reward are counted, of rides without errors.
    """
    given = changed(load_scenario(scenario), factor, faster, stiffness, noise)
    print(table(given, split, contexts, list(spins), min(jumpy, contexts)))


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return run(command, arguments)


if __name__ == "__main__":
    sys.exit(main())
