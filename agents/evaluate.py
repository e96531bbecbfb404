"""Judge trained agents on the same held-out contexts: ``python -m sledenv.agents.evaluate RUN [RUN ...]``."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from json import dumps
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from cyclopts import Parameter

from sledenv.benchmark.evaluation import Evaluation, evaluation_of
from sledenv.benchmark.problem import HeldOut
from sledenv.benchmark.runs import agent_name, load_run
from sledenv.benchmark.scores import mean_interval, told
from sledenv.command.arguments import integer
from sledenv.command.running import app, run, taken
from sledenv.machine.files import replacing
from sledenv.machine.text_tables import aligned

CONTEXTS: Final = 1000


def table(scores: list[Evaluation]) -> str:
    """Return the scores as text, most reward first, with what the words in it mean."""
    first, *others = sorted(scores, key=lambda score: -score.mean)
    lower, knowing = first.lower, first.clairvoyant
    names = ["agent", *(["ratio [95 %]"] if lower is not None else []), "mean reward [95 %]", "falls [95 %]"]
    rows = [[*names, "finished", *([f"behind {first.policy} [95 %]"] if others else [])]]
    for score in (first, *others):
        row = [score.policy, *([told(score.ratio, score.ratio_interval, ".3f")] if lower is not None else [])]
        row += [told(score.mean, score.interval, ".3f"), told(score.falls, score.falls_interval, ".1%")]
        row.append(f"{score.finished:.1%}")
        if others:  # context by context
            behind = first.rewards - score.rewards
            row.append("-" if score is first else told(float(behind.mean()), mean_interval(behind), ".3f"))
        rows.append(row)
    header, *lines = aligned(rows, ["<12", "<"])
    words = [f"Reward: from 0 to 1, over {first.where} that no training has seen."]
    if lower is not None:
        known = ~np.isnan(lower)
        where = "" if known.all() else f" in the first {known.sum()} contexts"
        words.append(f"Ratio: to the mean reward of {first.reference}, {lower[known].mean():.3f}{where}.")
    if knowing is not None and not np.isnan(knowing).all():
        known = ~np.isnan(knowing)
        of = f"the first {known.sum()} contexts"
        words.append(f"  A search that knows the errors beforehand earns {knowing[known].mean():.3f} in {of}.")
    words += ["Falls: share of the descents in which a part touches the ground that must not, such as the rider."]
    words += ["Brackets: 95 % intervals, of the mean over all such contexts."]
    return "\n".join([header, "-" * len(header), *lines, "", *words])


def track_table(scores: list[Evaluation]) -> str:
    """Return mean reward and share of falls on each track made by hand as text, the agent of most reward first."""
    ranked = sorted(scores, key=lambda score: -score.mean)
    places = np.array(scores[0].places)
    rows = [["track", "contexts", *(score.policy for score in ranked)]]
    for place in np.unique(places):
        on = places == place
        cells = (f"{score.rewards[on].mean():.3f}, {score.fallen[on].mean():.1%} fall" for score in ranked)
        rows.append([str(place), str(on.sum()), *cells])
    header, *lines = aligned(rows, ["<12", ">", "<"])
    return "\n".join([header, "-" * len(header), *lines, "", "On each track: mean reward and share of falls."])


def as_json(scores: list[Evaluation]) -> list[dict[str, Any]]:
    """Return the scores as plain data."""
    found = []
    for one in scores:
        plain: dict[str, Any] = {"agent": one.policy, "mean": one.mean, "interval": one.interval}
        if one.lower is not None:
            plain |= {"ratio": one.ratio, "ratio_interval": one.ratio_interval}
        plain |= {"falls": one.falls, "falls_interval": one.falls_interval, "rewards": one.rewards.tolist()}
        found.append(plain | ({} if one.places is None else {"tracks": one.places}))
    return found


command = app("python -m sledenv.agents.evaluate", "Judge trained agents on the same held-out contexts.")


@command.default
def _evaluate(
    runs: Annotated[list[Path], Parameter(name="RUN", required=True)],
    /,
    *,
    contexts: Annotated[int, integer(2)] = CONTEXTS,
    shifted: bool = False,
    tracks: bool = False,
    json: Path | None = None,
) -> None:
    """Judge trained agents.

    Judge only runs that you trust: the module that a run names is imported, and a model.zip may hold pickles.

    Parameters
    ----------
    runs
        Folders written by sledenv.agents.train, or names of runs that ship: sled_mat-launch-spin-critic-s0.
    contexts
        Number of held-out contexts.
    shifted
        Judge in contexts of a kind that no one trains on: launches a quarter faster, over bumps a quarter higher.
    tracks
        Judge rides on the tracks made by hand, on which no one trains, and tell how each goes.
    json
        Also write the numbers to this file.
    """
    loaded = [load_run(folder) for folder in runs]
    asked = [(one.scenario.hash, one.environment, one.control, *one.noise.tolist()) for one, _, _ in loaded]
    if len(set(asked)) > 1:
        raise ValueError("the runs have different scenarios, controls or launch noise: judge them apart")
    if shifted and tracks:
        raise ValueError("--tracks and --shifted are contexts of two kinds: give one of them")
    held_out: HeldOut = "tracks" if tracks else "shifted" if shifted else "test"
    with ExitStack() as places:
        file = json and taken(places, "--json", replacing(json, ".json"))
        scores = [
            evaluation_of(problem, agent, contexts, agent_name(config["agent"]), held_out)
            for problem, agent, config in loaded
        ]
        print(table(scores) + (f"\n\n{track_table(scores)}" if tracks else ""))
        if file:
            file.write_text(dumps(as_json(scores)), encoding="utf-8")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line."""
    return run(command, arguments)


if __name__ == "__main__":
    sys.exit(main())
