"""Stiff springs against rigid surfaces: how many descents end in which way, and where single ones part.

``python -m perf.limit`` writes results/limit.json and .png, which docs/physics.md, section 8.3, shows.
"""

from __future__ import annotations

import math
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perf.harness import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, RED, SKY, drawing, save
from perf.reference import settings
from sledenv.kernel.records import CHORD
from sledenv.scenarios.scenario import Scenario, load_scenario
from sledenv.simulation.simulate import simulate_blocks

SCENARIO = "ice_drop"
FRICTION = (0.05, 0.25)  # more than in the scenario, or all would reach the end of the slope
STIFFNESSES = tuple(10.0**k for k in range(5, 11))  # [N/m]
LANES = 10_000
SEED = 6
REBOUNDS = 12  # of which it is asked whether they are the same
HAPPENED = {"both corners have touched": "chord", "has lain on its chord": "lain"}
APART = 0.1  # of the speed of approach: rebounds that differ more are not the same


def launches(scenario: Scenario, count: int, seed: int) -> tuple[NDArray[np.float64], ...]:
    """Laws, slopes and states of random launches; what an agent may choose is random too."""
    rng = np.random.default_rng(seed)
    contexts = np.array([scenario.sample(rng) for _ in range(count)])
    names = list(type(scenario.sample(rng))._fields)
    for name, (low, high) in scenario.control_bounds.items():
        contexts[:, names.index(name)] = rng.uniform(low, high, count)
    contexts[:, names.index("friction")] = rng.uniform(*FRICTION, count)
    return scenario.laws(contexts), scenario.slopes(contexts), scenario.launches(contexts)


class Descents(NamedTuple):
    """What is kept of descents, arrays of N."""

    status: NDArray[np.str_]
    retention: NDArray[np.float64]
    lain: NDArray[np.bool_]  # whether they have lain settled on the chord
    chord: NDArray[np.bool_]  # whether both corners have touched at once
    rebounds: NDArray[Any]  # the first ones, (N, REBOUNDS)


def descents(stiffness: float, count: int, seed: int) -> Descents:
    """The same launches at some stiffness [N/m]; inf stands for rigid surfaces."""
    scenario = load_scenario(SCENARIO)
    laws, slopes, states = launches(scenario, count, seed)
    solver: Literal["compliant", "rigid"] = "rigid"
    if stiffness < math.inf:
        solver, laws[:, 0] = "compliant", stiffness
    limits = scenario.limits
    parts = [
        Descents(
            batch.status,
            batch.jam.retention,
            np.isfinite(batch.outcomes["t_on_chord"]),
            (batch.rebounds["feature"] == CHORD).any(axis=1),
            batch.rebounds[:, :REBOUNDS].copy(),
        )
        for batch in simulate_blocks(
            scenario.body(),
            laws,
            slopes,
            states,
            **settings(solver=solver, max_time=limits.max_time_s, max_rebounds=limits.max_rebounds),
        )
    ]
    return Descents(*map(np.concatenate, zip(*parts, strict=True)))


def parted(one: NDArray[Any], other: NDArray[Any], radius: float) -> NDArray[np.int64]:
    """Number of rebounds after which descents part, shape (N,): REBOUNDS if they are the same up to there."""
    scale = np.hypot(other["u_before"], other["v_before"]) + radius * np.abs(other["omega_before"])
    differs = one["feature"] != other["feature"]
    for name, unit in (("u_after", 1.0), ("v_after", 1.0), ("omega_after", radius)):
        differs |= ~(np.abs(one[name] - other[name]) * unit <= APART * scale)
    return np.where(differs.any(axis=1), differs.argmax(axis=1), REBOUNDS)


def _mean(values: NDArray[np.float64]) -> dict[str, float]:
    """Mean and half of its 95 % interval."""
    return {"mean": float(values.mean()), "half": float(1.96 * values.std(ddof=1) / math.sqrt(len(values)))}


def measure(count: int = LANES, seed: int = SEED) -> dict[str, Any]:
    """Simulate all, and count."""
    radius = load_scenario(SCENARIO).body().radius
    rigid = descents(math.inf, count, seed)
    found = []
    for stiffness in (*STIFFNESSES, math.inf):
        these = rigid if stiffness == math.inf else descents(stiffness, count, seed)
        at = parted(these.rebounds, rigid.rebounds, radius)
        found.append(
            {
                "stiffness": stiffness if stiffness < math.inf else "rigid",
                "status": {name: float((these.status == name).mean()) for name in np.unique(these.status).tolist()},
                "retention": _mean(these.retention),
                "more": _mean(these.retention - rigid.retention),
                "chord": float(these.chord.mean()),
                "lain": float(these.lain.mean()),
                "same": [float((at >= k).mean()) for k in range(REBOUNDS + 1)],
            }
        )
    return {"scenario": SCENARIO, "friction": FRICTION, "lanes": count, "seed": seed, "apart": APART, "points": found}


def draw(result: dict[str, Any]) -> None:
    """Shares over the stiffness; the mean beyond that of rigid surfaces; shares that have not parted from them."""
    *compliant, rigid = result["points"]
    stiffness = [point["stiffness"] for point in compliant]
    with drawing("limit", (12.0, 4.4), (1, 3)) as (_, (shares, mean, same)):
        looks = ((BLUE, "o"), (GREEN, "^"), (ORANGE, "v"), (RED, "s"))
        for name, (colour, marker) in zip(("finish", *HAPPENED, "jammed"), looks, strict=True):
            *values, limit = (share_of(point, name) for point in result["points"])
            error = [1.96 * math.sqrt(value * (1.0 - value) / result["lanes"]) for value in values]
            shares.errorbar(stiffness, values, error, color=colour, marker=marker, ls="", capsize=3.0, label=name)
            shares.axhline(limit, color=colour, ls="--", lw=1.2)
        shares.set_ylim(0.0, 1.0)
        shares.set_ylabel("share of descents [-]")
        shares.set_title("what happens; dashed: rigid", loc="left")
        shares.legend(loc="center left")
        more, half = ([1e3 * point["more"][name] for point in compliant] for name in ("mean", "half"))
        mean.errorbar(stiffness, more, half, color=BLUE, marker="o", ls="", capsize=3.0)
        mean.axhline(0.0, color=INK, ls="--", lw=1.2)
        mean.set_ylabel(f"mean retention beyond {rigid['retention']['mean']:.3f}, rigid [0.001]")
        mean.set_title("same launches, 95 % intervals", loc="left")
        for ax in (shares, mean):
            ax.set_xscale("log")
            ax.set_xlabel("stiffness [N/m]")
        for point, colour in zip(compliant, (GREY, SKY, GREEN, ORANGE, RED, PURPLE), strict=True):
            exponent = round(math.log10(point["stiffness"]))
            same.plot(range(REBOUNDS + 1), point["same"], color=colour, marker=".", label=f"$10^{{{exponent}}}$ N/m")
        same.set_xlabel("rebounds")
        same.set_ylabel("share of descents [-]")
        same.set_title("every rebound as on rigid surfaces", loc="left")
        same.set_ylim(0.0, 1.0)
        same.set_xlim(-0.5, 17.0)
        same.set_xticks(range(0, REBOUNDS + 1, 2))
        same.legend(loc="upper right", handlelength=1.0)


def share_of(point: dict[str, Any], name: str) -> float:
    """Share [-] of the descents that end in a way or to which something has happened."""
    return float(point[HAPPENED[name]] if name in HAPPENED else point["status"].get(name, 0.0))


def main() -> None:
    """Measure, write and draw."""
    result = measure()
    save("limit", result)
    draw(result)


if __name__ == "__main__":
    main()
