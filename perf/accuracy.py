"""Accuracy against work: every method at several steps or tolerances, on the first five rebounds of the reference."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numba

from perf import engines
from perf.contact_model import START
from perf.harness import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    RED,
    SKY,
    Competitor,
    drawing,
    figure_of,
    interleave,
    save,
    spread,
    table,
)
from perf.methods import Heyoka, dop853, euler, rk4, sled, velocities
from perf.reference import FEW, Floats, worst

ROUNDS = 5


class Setting(NamedTuple):
    """A method at one step [s] or tolerance."""

    method: str
    value: float
    run: Callable[[], Any]
    answer: Callable[[], Floats]


def _sled(tolerance: float) -> Setting:
    run = functools.partial(sled, FEW, tolerance=tolerance)
    return Setting("sledenv compliant", tolerance, run, lambda: velocities(run()))


def _rigid() -> Setting:
    run = functools.partial(sled, FEW, solver="rigid")
    return Setting("sledenv rigid", 0.0, run, lambda: velocities(run()))


def _integrator(method: str, value: float, run: Callable[[], Floats]) -> Setting:
    return Setting(method, value, run, run)


def _engine(method: str, name: str, dt: float) -> Setting:
    scene = engines.build(name, dt)

    def run() -> None:
        scene.reset()
        scene.advance(engines.steps_of(dt))

    return Setting(method, dt, run, lambda: engines.velocities(engines.build(name, dt), dt))


def settings() -> list[Setting]:
    """Everything that is measured."""
    names = {"mujoco": "MuJoCo", "pymunk": "pymunk", "box2d": "Box2D"}
    return [
        *(_sled(tolerance) for tolerance in (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-16)),
        _rigid(),
        *(
            _integrator("heyoka", tol, functools.partial(Heyoka(tol), FEW))
            for tol in (1e-5, 1e-7, 1e-9, 1e-12, 2.2e-16)
        ),
        *(
            _integrator("scipy DOP853", tol, functools.partial(dop853, FEW, tol))
            for tol in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
        ),
        *(
            _integrator("RK4, no events", dt, functools.partial(rk4, START, FEW, dt))
            for dt in (2e-4, 1e-4, 2.5e-5, 5e-6, 1e-6)
        ),
        *(
            _integrator("explicit Euler", dt, functools.partial(euler, START, FEW, dt))
            for dt in (2.5e-5, 5e-6, 1e-6, 2.5e-7)
        ),
        *(_engine(names[name], name, dt) for name, dt in engines.TUNED),
    ]


def main(rounds: int = ROUNDS) -> None:
    """Measure, write and draw."""
    numba.set_num_threads(1)
    found = settings()
    wrong = [worst(setting.answer(), FEW) for setting in found]
    times = interleave([Competitor(str(i), setting.run, FEW) for i, setting in enumerate(found)], rounds)
    result = {
        "rounds": rounds,
        "points": [
            {
                "method": setting.method,
                "setting": setting.value,
                "error": wrong[i],
                "us_per_hop": spread(1e6 * times[str(i)]),
            }
            for i, setting in enumerate(found)
        ],
    }
    save("accuracy", result)
    draw(result)


def draw(result: dict[str, Any]) -> None:
    """Error over time a hop, one line a method; engines and the rigid limit solve another law."""
    looks = {
        "sledenv compliant": (BLUE, "o", "-"),
        "sledenv rigid": (PURPLE, "D", ""),
        "heyoka": (GREEN, "s", "-"),
        "scipy DOP853": (RED, "^", "-"),
        "RK4, no events": (ORANGE, "v", "-"),
        "explicit Euler": (INK, "P", "-"),
        "MuJoCo": (GREY, "x", ":"),
        "pymunk": (SKY, "+", ":"),
        "Box2D": ("#8C6D46", "1", ":"),
    }
    with drawing("accuracy", (9.0, 6.4)) as (_, ax):
        for method, (colour, marker, line) in looks.items():
            points = [
                (point["us_per_hop"]["median"], max(point["error"], 1e-16))
                for point in result["points"]
                if point["method"] == method
            ]
            ax.loglog(*zip(*points, strict=True), color=colour, marker=marker, ls=line, ms=7.0, label=method)
        ax.set_xlabel("time a hop [µs], one core, called from Python")
        ax.set_ylabel("largest velocity error of five rebounds [-]")
        ax.set_title("Accuracy against work; dotted: an engine's own contact law, tuned to the answer", loc="left")
        ax.legend(ncols=2, loc="lower center")


def tables(result: dict[str, Any]) -> str:
    """Return the table of docs/performance.md."""
    rows = [
        (
            point["method"],
            f"{point['setting']:g}" if point["setting"] else "-",
            figure_of(point["us_per_hop"]["median"]),
            f"{point['error']:.1e}",
        )
        for point in result["points"]
    ]
    return table(("method", "tolerance or step [s]", "µs a hop", "velocity error"), rows)


if __name__ == "__main__":
    main()
