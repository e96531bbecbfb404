"""Accuracy against work: every method at several steps or tolerances, on the first five rebounds of the reference."""

from __future__ import annotations

from typing import Any

from perf import engines, show
from perf.contact_model import START
from perf.methods import Heyoka, dop853, euler, rk4
from perf.peers import RIGID, SAME, Peer, called, engine, method, rows
from perf.reference import FEW

ROUNDS = 5
_LOOKS = {
    "sledenv compliant": (show.BLUE, "o", "-"),
    "sledenv rigid": (show.PURPLE, "D", ""),
    "heyoka": (show.GREEN, "s", "-"),
    "scipy DOP853": (show.RED, "^", "-"),
    "RK4, no events": (show.ORANGE, "v", "-"),
    "explicit Euler": (show.INK, "P", "-"),
    "MuJoCo": (show.GREY, "x", ":"),
    "pymunk": (show.SKY, "+", ":"),
    "Box2D": ("#8C6D46", "1", ":"),
}


def cases() -> list[tuple[float, Peer]]:
    """Methods at a tolerance or step [s], 0 for one that has none."""
    names = {"mujoco": "MuJoCo", "pymunk": "pymunk", "box2d": "Box2D"}
    own = (1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-16)
    return [
        *((tol, called("sledenv compliant", SAME, FEW, tolerance=tol)) for tol in own),
        (0.0, called("sledenv rigid", RIGID, FEW, solver="rigid")),
        *((tol, method("heyoka", Heyoka(tol), FEW)) for tol in (1e-5, 1e-7, 1e-9, 1e-12, 2.2e-16)),
        *((tol, method("scipy DOP853", dop853, FEW, tol)) for tol in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
        *((dt, method("RK4, no events", rk4, START, FEW, dt)) for dt in (2e-4, 1e-4, 2.5e-5, 5e-6, 1e-6)),
        *((dt, method("explicit Euler", euler, START, FEW, dt)) for dt in (2.5e-5, 5e-6, 1e-6, 2.5e-7)),
        *((dt, engine(names[name], name, dt)) for name, dt in engines.TUNED),
    ]


def measure(rounds: int = ROUNDS) -> dict[str, Any]:
    """Measure all settings in turn."""
    values, peers = zip(*cases(), strict=True)
    points = [
        {"method": row["name"], "setting": value, "error": row["error"], "us_per_hop": row["us_per_hop"]}
        for value, row in zip(values, rows(peers, FEW, rounds), strict=True)
    ]
    return {"rounds": rounds, "points": points}


def draw(result: dict[str, Any]) -> None:
    """Error over time a hop, one line a method; engines and the rigid limit solve another law."""
    with show.drawing("accuracy", (9.0, 6.4)) as (_, ax):
        for name, (colour, marker, line) in _LOOKS.items():
            points = [point for point in result["points"] if point["method"] == name]
            times = [point["us_per_hop"]["median"] for point in points]
            errors = [max(point["error"], 1e-16) for point in points]
            ax.loglog(times, errors, color=colour, marker=marker, ls=line, ms=7.0, label=name)
        ax.set_xlabel("time a hop [µs], one core, called from Python")
        ax.set_ylabel("largest velocity error of five rebounds [-]")
        ax.set_title("Accuracy against work; dotted: an engine's own contact law, tuned to the answer", loc="left")
        ax.legend(ncols=2, loc="lower center")
