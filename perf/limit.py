"""Stiff springs against rigid surfaces: how many descents end in which way, and where single ones part.

``python -m perf.limit`` writes results/limit.json and .png, which docs/physics.md, section 8.3, shows.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

import sledenv
from perf import show
from perf.harness import Floats, run
from perf.reference import problem, settings

SCENARIO = str(Path(__file__).parent / "cut_disc.yaml")  # an arc with corners
FRICTION = (0.05, 0.25)  # more than in the scenario, or all would reach the end of the slope
STIFFNESSES = tuple(10.0**k for k in range(5, 11))  # [N/m]
LANES = 10_000
SEED = 6
REBOUNDS = 12  # of which it is asked whether they are the same
HAPPENED = {"both corners have touched": "chord", "has lain on its chord": "lain"}
APART = 0.1  # of the speed of approach: rebounds that differ more are not the same


def descents(stiffness: float, count: int, seed: int) -> dict[str, np.ndarray]:
    """Ends and first rebounds of random launches, the same at every stiffness [N/m]; inf stands for rigid surfaces.

    And whether they have lain settled on the chord, and whether both corners have touched at once. What an agent may
    choose is random too; its orientations, in degrees, are taken for radians: all are as likely, after some turns.
    """
    scenario, names, rng = sledenv.load_scenario(SCENARIO), sledenv.Context._fields, np.random.default_rng(seed)
    drawn = scenario.contexts(rng.random((count + 1, len(names))))[:count]  # one more, as for the committed result
    for name, ends in {**scenario.control_bounds, "friction": FRICTION}.items():
        drawn[:, names.index(name)] = rng.uniform(*ends, count)
    (body, laws, slopes, states), fields = problem(SCENARIO, drawn)
    rigid = stiffness == math.inf
    if not rigid:
        laws[:, 0] = stiffness
    options = settings(**{**fields, "solver": "rigid" if rigid else "compliant"})
    parts = [
        {
            "status": batch.status,
            "retention": batch.jam.retention,
            "lain": np.isfinite(batch.outcomes["t_on_chord"]),
            "chord": (batch.rebounds["feature"] == sledenv.Feature.CHORD).any(axis=1),
            "rebounds": batch.rebounds[:, :REBOUNDS].copy(),
        }
        for batch in sledenv.simulate_blocks(body, laws, slopes, states, **options)
    ]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def parted(one: np.ndarray, other: np.ndarray, radius: float) -> np.ndarray:
    """Number of rebounds after which descents part, shape (N,): REBOUNDS if they are the same up to there."""
    scale = np.hypot(other["u_before"], other["v_before"]) + radius * np.abs(other["omega_before"])
    differs = one["feature"] != other["feature"]
    for name, unit in (("u_after", 1.0), ("v_after", 1.0), ("omega_after", radius)):
        differs |= ~(np.abs(one[name] - other[name]) * unit <= APART * scale)
    return np.where(differs.any(axis=1), differs.argmax(axis=1), REBOUNDS)


def _mean(values: Floats) -> dict[str, float]:
    """Mean and half of its 95 % interval."""
    return {"mean": float(values.mean()), "half": float(1.96 * values.std(ddof=1) / math.sqrt(len(values)))}


def measure(count: int = LANES, seed: int = SEED) -> dict[str, Any]:
    """Simulate all, and count."""
    body = sledenv.load_scenario(SCENARIO).body()
    assert isinstance(body, sledenv.Segment)
    rigid = descents(math.inf, count, seed)
    found = []
    for stiffness in (*STIFFNESSES, math.inf):
        these = rigid if stiffness == math.inf else descents(stiffness, count, seed)
        at = parted(these["rebounds"], rigid["rebounds"], body.radius)
        found.append(
            {
                "stiffness": stiffness if stiffness < math.inf else "rigid",
                "status": {
                    name: float(np.mean(these["status"] == name)) for name in sorted({*these["status"].tolist()})
                },
                "retention": _mean(these["retention"]),
                "more": _mean(these["retention"] - rigid["retention"]),
                "chord": float(these["chord"].mean()),
                "lain": float(these["lain"].mean()),
                "same": [float((at >= k).mean()) for k in range(REBOUNDS + 1)],
            }
        )
    return {
        "scenario": Path(SCENARIO).stem,
        "friction": FRICTION,
        "lanes": count,
        "seed": seed,
        "apart": APART,
        "points": found,
    }


def _share(point: dict[str, Any], name: str) -> float:
    """Share [-] of the descents that end in a way or to which something has happened."""
    return float(point[HAPPENED[name]] if name in HAPPENED else point["status"].get(name, 0.0))


def draw(result: dict[str, Any]) -> None:
    """Shares over the stiffness; the mean beyond that of rigid surfaces; shares that have not parted from them."""
    *compliant, rigid = result["points"]
    stiffness = [point["stiffness"] for point in compliant]
    with show.drawing("limit", (12.0, 4.4), (1, 3)) as (_, (shares, mean, same)):
        looks = ((show.BLUE, "o"), (show.GREEN, "^"), (show.ORANGE, "v"), (show.RED, "s"))
        for name, (colour, marker) in zip(("finish", *HAPPENED, "jammed"), looks, strict=True):
            values = [_share(point, name) for point in compliant]
            error = [1.96 * math.sqrt(value * (1.0 - value) / result["lanes"]) for value in values]
            shares.errorbar(stiffness, values, error, color=colour, marker=marker, ls="", capsize=3.0, label=name)
            shares.axhline(_share(rigid, name), color=colour, ls="--", lw=1.2)
        shares.set(ylim=(0.0, 1.0), ylabel="share of descents [-]")
        shares.set_title("what happens; dashed: rigid", loc="left")
        shares.legend(loc="center left")
        more, half = ([1e3 * point["more"][name] for point in compliant] for name in ("mean", "half"))
        mean.errorbar(stiffness, more, half, color=show.BLUE, marker="o", ls="", capsize=3.0)
        mean.axhline(0.0, color=show.INK, ls="--", lw=1.2)
        mean.set_ylabel(f"mean retention beyond {rigid['retention']['mean']:.3f}, rigid [0.001]")
        mean.set_title("same launches, 95 % intervals", loc="left")
        for ax in (shares, mean):
            ax.set(xscale="log", xlabel="stiffness [N/m]")
        colours = (show.GREY, show.SKY, show.GREEN, show.ORANGE, show.RED, show.PURPLE)
        for point, colour in zip(compliant, colours, strict=True):
            exponent = round(math.log10(point["stiffness"]))
            same.plot(range(REBOUNDS + 1), point["same"], color=colour, marker=".", label=f"$10^{{{exponent}}}$ N/m")
        same.set(xlabel="rebounds", ylabel="share of descents [-]", ylim=(0.0, 1.0), xlim=(-0.5, 17.0))
        same.set_title("every rebound as on rigid surfaces", loc="left")
        same.set_xticks(range(0, REBOUNDS + 1, 2))
        same.legend(loc="upper right", handlelength=1.0)


if __name__ == "__main__":
    run("limit")
