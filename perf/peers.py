"""Time and velocity error a hop on the reference descent: sledenv, the paper's Euler method and physics engines."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

import sledenv
from perf import engines, show
from perf.harness import Floats, spread, take_turns, timed
from perf.reference import BODY, FEW, LAUNCH, LAW, MANY, SLOPE, settings, worst
from perf.scalar_loop import scalar_loop
from sledenv.reproduce.euler import euler_descent

ROUNDS = 15
LOOPED, LANES = 64, 1024  # copies of the reference descent in a compiled loop and in a batch
BASE = "sledenv compliant, compiled loop"

SAME, RIGID, OTHER = "the reference's", "rigid surfaces", "the engine's own"
_COLOURS = {SAME: show.SKY, RIGID: show.PURPLE, OTHER: show.ORANGE}


class Peer(NamedTuple):
    """A method: whose contact law it solves, how it is run and what it answers."""

    name: str
    law: str
    run: Callable[[], Any]
    answer: Callable[[], Floats]  # velocities after each rebound
    copies: int = 1  # of the descent that one run simulates


def called(name: str, law: str, rebounds: int, **options: Any) -> Peer:
    """One call of simulate()."""
    run = functools.partial(sledenv.simulate, BODY, LAW, SLOPE, LAUNCH, max_rebounds=rebounds, **options)
    return Peer(name, law, run, lambda: _velocities(run().rebounds))


def _velocities(rebounds: np.ndarray) -> Floats:
    return np.stack([rebounds[name] for name in ("u_after", "v_after", "omega_after")], axis=-1)


def _by_euler(rebounds: int) -> Peer:
    run = functools.partial(euler_descent, BODY, LAW, SLOPE, LAUNCH, step=2.5e-7, max_rebounds=rebounds)
    return Peer("explicit Euler 2.5e-7, sledenv", SAME, run, lambda: _velocities(run().rebounds))


def _looped(name: str, law: str, rebounds: int, solver: Any) -> Peer:
    run = scalar_loop(BODY, LAW, SLOPE, np.tile(LAUNCH, (LOOPED, 1)), solver=solver, max_rebounds=rebounds)
    return Peer(name, law, run, called(name, law, rebounds, solver=solver).answer, LOOPED)


def _batch(name: str, law: str, rebounds: int, solver: Any) -> Peer:
    options = settings(solver=solver, max_rebounds=rebounds) | {"keep_rebounds": True}
    run = functools.partial(sledenv.simulate_batch, BODY, LAW, SLOPE, np.tile(LAUNCH, (LANES, 1)), **options)
    return Peer(name, law, run, lambda: _velocities(run().rebounds[-1]), LANES)


def engine(label: str, name: str, dt: float) -> Peer:
    """Time the steps alone, without reading the state after each; building the scene is not timed either."""
    scene = engines.build(name, dt)

    def run() -> None:
        scene.reset()
        scene.advance(engines.steps_of(dt))

    return Peer(label, OTHER, run, lambda: engines.velocities(engines.build(name, dt), dt))


def methods(rebounds: int) -> list[Peer]:
    """Methods that solve the reference's law, settled rolling included, and all others for the first rebounds."""
    found = [
        _looped(BASE, SAME, rebounds, "compliant"),
        _batch("sledenv compliant, simulate_batch", SAME, rebounds, "compliant"),
        called("sledenv compliant, simulate()", SAME, rebounds),
        _by_euler(rebounds),
    ]
    if rebounds > FEW:
        return found
    return [
        *found,
        called("sledenv compliant, tolerance 1e-8", SAME, FEW, tolerance=1e-8),
        called("sledenv compliant, tolerance 1e-18", SAME, FEW, tolerance=1e-18),
        _looped("sledenv rigid, compiled loop", RIGID, FEW, "rigid"),
        _batch("sledenv rigid, simulate_batch", RIGID, FEW, "rigid"),
        called("sledenv rigid, simulate()", RIGID, FEW, solver="rigid"),
        engine("MuJoCo 1e-4", "mujoco", 1e-4),
        engine("MuJoCo 2e-3", "mujoco", 2e-3),
        engine("pymunk 1e-3", "pymunk", 1e-3),
        engine("Box2D 1e-3", "box2d", 1e-3),
    ]


def rows(peers: Sequence[Peer], rebounds: int, rounds: int) -> list[dict[str, Any]]:
    """Largest errors of some methods, and their times [µs] a hop."""
    os.environ["NUMBA_NUM_THREADS"] = "1"
    errors = [worst(peer.answer(), rebounds) for peer in peers]
    times = take_turns({i: timed(peer.run, peer.copies * rebounds) for i, peer in enumerate(peers)}, rounds)
    found = zip(peers, errors, times.values(), strict=True)
    return [
        {"name": peer.name, "law": peer.law, "error": error, "us_per_hop": spread(1e6 * own)}
        for peer, error, own in found
    ]


def measure(rounds: int = ROUNDS) -> dict[str, Any]:
    """Measure for five rebounds, and for twenty those methods that follow the reference so far."""
    tuned = [{"engine": name, "step": dt, "settings": list(given)} for (name, dt), given in engines.TUNED.items()]
    few, many = (rows(methods(count), count, turns) for count, turns in ((FEW, rounds), (MANY, max(5, rounds // 2))))
    return {"rounds": rounds, "few": few, "many": many, "tuned": tuned}


def _parts(result: dict[str, Any]) -> list[tuple[str, list[dict[str, Any]]]]:
    """Titles and rows, the fastest first."""
    parts = (f"first {FEW} rebounds", result["few"]), (f"{MANY} rebounds", result["many"])
    return [(title, sorted(rows, key=lambda row: float(row["us_per_hop"]["median"]))) for title, rows in parts]


def draw(result: dict[str, Any]) -> None:
    """Bars of the time a hop for both numbers of rebounds, with quartiles, the number and the error beside each."""
    parts = _parts(result)
    with show.drawing("peers", (9.0, 9.5), (2, 1)) as (figure, axes):
        axes[0].get_gridspec().set_height_ratios([len(rows) for _, rows in parts])
        for ax, (title, rows) in zip(axes, parts, strict=True):
            stats, names = [row["us_per_hop"] for row in rows], [f"{row['name']}  ({row['error']:.0e})" for row in rows]
            colours = [show.BLUE if row["name"] == BASE else _COLOURS[row["law"]] for row in rows]
            medians = [stat["median"] for stat in stats]
            ax.barh(names, medians, xerr=show.errors(stats), color=colours, height=0.7, ecolor=show.INK)
            for place, stat in enumerate(stats):
                ax.text(stat["high"] * 1.12, place, show.median(stat), va="center", fontsize=9.5)
            ax.set(xscale="log", xlim=(0.05, 1e5), xlabel="time a hop [µs], one core (lower is better)")
            ax.invert_yaxis()
            ax.grid(axis="y", visible=False)
            ax.set_title(f"{title.capitalize()} (largest velocity error in brackets)", loc="right")
        from matplotlib.patches import Patch

        keys = [Patch(color=colour, label=f"contact law: {law}") for law, colour in _COLOURS.items()]
        figure.legend(handles=keys, loc="outside lower center", ncols=3)


def tables(result: dict[str, Any]) -> str:
    """Return the tables of docs/performance.md."""
    columns: show.Columns = {
        "µs a hop": lambda row: show.median(row["us_per_hop"]),
        "velocity error": lambda row: f"{row['error']:.1e}",
    }
    parts = [show.table(rows, {title: lambda row: row["name"], **columns}) for title, rows in _parts(result)]
    return "\n\n".join(parts)
