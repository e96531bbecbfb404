"""Time and velocity error a hop on the reference descent: sledenv, integrators and physics engines, one core."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numba
import numpy as np

import sledenv
from perf import engines
from perf.contact_model import START
from perf.harness import (
    BLUE,
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
    with_quartiles,
)
from perf.methods import Heyoka, dop853, euler, rk4, sled, velocities
from perf.reference import BODY, FEW, LAUNCH, LAW, MANY, SLOPE, Floats, settings, worst
from perf.scalar_loop import scalar_loop

ROUNDS = 15
LOOPED, LANES = 64, 1024  # copies of the reference descent in a compiled loop and in a batch
BASE = "sledenv compliant, compiled loop"
BATCH = "sledenv compliant, simulate_batch"
EULER = "explicit Euler 2.5e-7, bare loop"

# The loosest tolerances that bring a method to errors of the order of 1e-10, heyoka also to its best, DOP853 to 1e-5.
# Found by trying; what each reaches is measured and stands beside it.
HEYOKA = {FEW: (1e-7, 1e-14), MANY: (1e-10, 1e-14)}
DOP853 = {FEW: (1e-10,), MANY: (1e-6, 1e-12)}

SAME, RIGID, OTHER = "the reference's", "rigid surfaces", "the engine's own"
_COLOURS = {SAME: SKY, RIGID: PURPLE, OTHER: ORANGE}


class Peer(NamedTuple):
    """A method: how it is run, what it answers, and whose contact law it solves."""

    name: str
    law: str
    run: Callable[[], Any]
    answer: Callable[[], Floats]  # velocities after each rebound
    copies: int = 1  # of the descent that one run simulates


def _sled(name: str, law: str, rebounds: int, **options: Any) -> Peer:
    run = functools.partial(sled, rebounds, **options)
    return Peer(name, law, run, lambda: velocities(run()))


def _method(name: str, run: Callable[[], Floats]) -> Peer:
    return Peer(name, SAME, run, run)


def _loop(name: str, law: str, solver: Any, rebounds: int) -> Peer:
    launches = np.tile(LAUNCH, (LOOPED, 1))
    run = scalar_loop(BODY, LAW, SLOPE, launches, solver=solver, max_rebounds=rebounds)
    return Peer(name, law, run, lambda: velocities(sled(rebounds, solver=solver)), LOOPED)


def _batch(name: str, law: str, solver: Any, rebounds: int) -> Peer:
    launches = np.tile(LAUNCH, (LANES, 1))
    options = settings(solver=solver, max_rebounds=rebounds) | {"keep_rebounds": True}
    run = functools.partial(sledenv.simulate_batch, BODY, LAW, SLOPE, launches, **options)

    def answer() -> Floats:
        rows = run().rebounds[-1]
        return np.stack([rows[name] for name in ("u_after", "v_after", "omega_after")], axis=-1)

    return Peer(name, law, run, answer, LANES)


def _engine(label: str, name: str, dt: float) -> Peer:
    """Time the steps alone, without reading the state after each; building the scene is not timed either."""
    scene = engines.build(name, dt)

    def run() -> None:
        scene.reset()
        scene.advance(engines.steps_of(dt))

    return Peer(label, OTHER, run, lambda: engines.velocities(engines.build(name, dt), dt))


def few() -> list[Peer]:
    """All methods, for the first five rebounds."""
    return [
        *both(FEW),
        _sled("sledenv compliant, tolerance 1e-8", SAME, FEW, tolerance=1e-8),
        _sled("sledenv compliant, tolerance 1e-18", SAME, FEW, tolerance=1e-18),
        _loop("sledenv rigid, compiled loop", RIGID, "rigid", FEW),
        _batch("sledenv rigid, simulate_batch", RIGID, "rigid", FEW),
        _sled("sledenv rigid, simulate()", RIGID, FEW, solver="rigid"),
        _engine("MuJoCo 1e-4", "mujoco", 1e-4),
        _engine("MuJoCo 2e-3", "mujoco", 2e-3),
        _engine("pymunk 1e-3", "pymunk", 1e-3),
        _engine("Box2D 1e-3", "box2d", 1e-3),
    ]


def both(rebounds: int) -> list[Peer]:
    """The methods that solve the reference's law, settled rolling included."""
    return [
        _loop(BASE, SAME, "compliant", rebounds),
        _batch(BATCH, SAME, "compliant", rebounds),
        _sled("sledenv compliant, simulate()", SAME, rebounds),
        *(
            _method(f"heyoka (Taylor) {tol:.0e}, events in Python", functools.partial(Heyoka(tol), rebounds))
            for tol in HEYOKA[rebounds]
        ),
        *(
            _method(f"scipy DOP853 {tol:.0e}, events", functools.partial(dop853, rebounds, tol))
            for tol in DOP853[rebounds]
        ),
        _method("RK4 2.5e-5, compiled, no events", functools.partial(rk4, START, rebounds, 2.5e-5)),
        _method(EULER, functools.partial(euler, START, rebounds, 2.5e-7)),
        _sled("explicit Euler 2.5e-7, sledenv", SAME, rebounds, solver="euler"),
    ]


def measure(peers: Sequence[Peer], rebounds: int, rounds: int) -> list[dict[str, Any]]:
    """One row a peer."""
    answers = {peer.name: worst(peer.answer(), rebounds) for peer in peers}
    times = interleave([Competitor(p.name, p.run, p.copies * rebounds) for p in peers], rounds)
    return [
        {
            "name": peer.name,
            "law": peer.law,
            "error": answers[peer.name],
            "us_per_hop": spread(1e6 * times[peer.name]),
            "times_euler": ratio(times[EULER], times[peer.name]),
            "slower_than_base": ratio(times[peer.name], times[BASE]),
            "slower_than_batch": ratio(times[peer.name], times[BATCH]),
        }
        for peer in peers
    ]


def main(rounds: int = ROUNDS) -> None:
    """Measure, write and draw."""
    numba.set_num_threads(1)
    result = {
        "rounds": rounds,
        "few": measure(few(), FEW, rounds),
        "many": measure(both(MANY), MANY, max(5, rounds // 2)),
        "tuned": [{"engine": name, "step": dt, "settings": list(given)} for (name, dt), given in engines.TUNED.items()],
    }
    save("peers", result)
    draw(result)


def draw(result: dict[str, Any]) -> None:
    """Bars of the time a hop for both numbers of rebounds, with the error beside each name."""
    few_rows, many_rows = result["few"], result["many"]
    with drawing("peers", (9.0, 9.5), (2, 1)) as (figure, axes):
        axes[0].get_gridspec().set_height_ratios([len(few_rows), len(many_rows)])
        titles = (f"First {FEW} rebounds", f"{MANY} rebounds with settled rolling")
        for ax, rows, title in zip(axes, (few_rows, many_rows), titles, strict=True):
            rows = sorted(rows, key=lambda row: row["us_per_hop"]["median"])
            colours = [BLUE if row["name"] == BASE else _COLOURS[row["law"]] for row in rows]
            names = [f"{row['name']}  ({row['error']:.0e})" for row in rows]
            bars(ax, names, [row["us_per_hop"] for row in rows], colours, "time a hop [µs], one core (lower is better)")
            ax.set_xlim(0.05, 1e5)
            ax.set_title(f"{title} (largest velocity error in brackets)", loc="right")
        from matplotlib.patches import Patch

        keys = [Patch(color=colour, label=f"contact law: {law}") for law, colour in _COLOURS.items()]
        figure.legend(handles=keys, loc="outside lower center", ncols=3)


def tables(result: dict[str, Any]) -> str:
    """Return the tables of docs/performance.md."""
    head = (
        "first five rebounds",
        "µs a hop",
        "times Euler",
        "times slower than the compiled loop",
        "than the batch",
        "velocity error",
        "law",
    )
    parts = []
    for key, title in (("few", f"first {FEW} rebounds"), ("many", f"{MANY} rebounds")):
        rows = [
            (
                row["name"],
                with_quartiles(row["us_per_hop"]),
                figure_of(row["times_euler"]["median"]),
                figure_of(row["slower_than_base"]["median"]),
                figure_of(row["slower_than_batch"]["median"]),
                f"{row['error']:.1e}",
                row["law"],
            )
            for row in sorted(result[key], key=lambda row: row["us_per_hop"]["median"])
        ]
        parts.append(table((title, *head[1:]), rows))
    return "\n\n".join(parts)


if __name__ == "__main__":
    main()
