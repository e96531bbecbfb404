"""Derivatives of a ride, beside that of its mean reward: ``python examples/gradients.py --out gradients.png``."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sledenv.benchmark.problem import Problem
from sledenv.machine.text_tables import markdown
from sledenv.plot.style import BLUE, INK, ORANGE, WIDTH, styled
from sledenv.simulation.lanes import new_logs
from sledenv.simulation.outlook import look_out
from sledenv.simulation.records import RUNNING
from sledenv.simulation.simulator import Simulator

Floats = NDArray[np.float64]

ERROR = 0.05  # [rad/s] standard deviation of what is lent, that of sled_rollers
CONTEXTS, RIDES, SHOWN = 20, 64, 8  # of the test split; of an estimate; the context of the figure
GRID = np.linspace(-1.2, 1.2, 4801)  # [rad/s] spins of the rides that tell the truth
COARSE = GRID[::2]  # those that path derivatives are taken at
TRIMS = GRID[600:-600:200]  # [rad/s] where gradients are compared: 19 from -0.9 to 0.9
STEP, JUMP, CLEAR = 1e-7, 0.01, 0.1  # [rad/s] of a difference; of a reward; derivatives [s/rad] whose signs count


def first_flights(count: int) -> Simulator:
    """Return rides in the first k test contexts, one a lane, each where its first trim is chosen."""
    problem = Problem("sled_rollers", "descent")
    return problem.task.rides(problem.task.scenes(problem.drawn(problem.contexts("test", count), "test")))


def land_parallel(rides: Simulator) -> Floats:
    """Return the spins [rad/s] of the rule of that name, shape (n,), not rounded to float32 as its trims are."""
    time, _, pitch, *_ = look_out(rides.scenes, rides.flights).landings.T
    turn, omega = pitch - rides.flights["phi"], rides.flights["omega"]
    wanted = (turn - 2.0 * np.pi * np.rint((turn - omega * time) / (2.0 * np.pi))) / time
    return np.asarray(np.clip(wanted - omega + rides.flights["trim_spin"], -1.0, 1.0))


def reward(begun: Simulator, spins: Floats) -> Floats:
    """Return what rides earn that lend spins [rad/s], then those of the rule without errors; of shape (k, ...)."""
    rides, left, earned = begun.take(np.indices(spins.shape)[0].ravel()), np.arange(spins.size), np.empty(spins.shape)
    rides.hop(spins.ravel())
    while left.size:
        on = rides.flights["status"] == RUNNING
        earned.flat[left[~on]] = rides.jam().reward[~on]
        rides, left = rides.take(np.flatnonzero(on)), left[on]
        rides.hop(land_parallel(rides))
    return earned


def impact(begun: Simulator, spins: Floats) -> NDArray[Any]:
    """Return records of the contacts that end flights in which spins [rad/s] are lent, all of shape (k, ...)."""
    rows, lanes = begun.flights["rebounds"], np.indices(spins.shape)[0].ravel()
    logs, limits = new_logs(len(rows), rows.max() + 1), begun.limits._replace(max_rebounds=int(rows.max()) + 1)
    flights = Simulator(begun.scenes, begun.rigid, limits, logs, begun.flights).take(lanes)
    flights.hop(spins.ravel())
    return np.asarray(flights.rebounds[np.arange(spins.size), rows[lanes]]).reshape(spins.shape)


def path_derivative(of: Callable[[Simulator, Floats], Floats], begun: Simulator, spins: Floats) -> Floats:
    """Return derivatives of outcomes by spins, shape (k, ...): the smaller one-sided difference, which has no jump."""
    here = of(begun, spins)
    ahead, behind = ((of(begun, spins + step) - here) / step for step in (STEP, -STEP))
    return np.where(np.abs(ahead) < np.abs(behind), ahead, behind)


def smoothed(values: Floats, spins: Floats, trims: Floats = TRIMS) -> tuple[Floats, Floats]:
    """Return means over the error and their derivatives by the trim, shape (k, t), of values at spins, (k, m)."""
    off = (spins[:, np.newaxis] - trims) / ERROR
    density = np.exp(-0.5 * off**2) * (spins[1] - spins[0]) / (np.sqrt(2.0 * np.pi) * ERROR)
    return values @ density, values @ (density * off / ERROR)


def estimates(earned: Floats, slopes: Floats, errors: Floats) -> dict[str, Floats]:
    """Return gradients, shape (...), from rewards, path derivatives and errors [rad/s] of rides, shape (..., n)."""
    count = errors.shape[-1]
    scores = (earned - earned.mean(axis=-1, keepdims=True)) * errors / ERROR**2 * count / (count - 1)
    ratio, path = scores.mean(axis=-1), slopes.mean(axis=-1)
    variance, other = (each.var(axis=-1, ddof=1) / count for each in (scores, slopes))
    share = variance / (variance + other)
    near = np.minimum(share, np.sqrt(variance) / np.abs(path - ratio))
    mixed, bounded = (part * path + (1.0 - part) * ratio for part in (share, near))
    return {"likelihood ratio": ratio, "pathwise": path, "mixed by variance": mixed, "mixed, bounded": bounded}


def draw(earned: Floats, slopes: Floats, panels: dict[str, tuple[Floats, Floats]]) -> Figure:
    """Draw a context, shapes (1, 4801) and (1, 2401), above truths and estimates, of shape (n,), by their titles."""
    with styled():
        fig, axes = plt.subplot_mosaic("RRR;DDD;123", figsize=(WIDTH, 9.0), layout="constrained")
        trims = GRID[400:-400:4]
        (mean, slope), (path, _) = smoothed(earned, GRID, trims), smoothed(slopes, COARSE, trims)
        axes["R"].plot(trims, earned[0, 400:-400:4], ".", ms=2.5, color=INK, label="of a ride without error")
        axes["R"].plot(trims, mean[0], color=BLUE, lw=2.2, label="mean over the error")
        axes["D"].plot(trims, path[0], color=ORANGE, label="mean of path derivatives")
        axes["D"].plot(trims, slope[0], color=BLUE, lw=2.2, label="derivative of the mean")
        for name, label in {"R": "reward", "D": "derivative [s/rad]"}.items():
            axes[name].set(xlabel="first trim [rad/s]", ylabel=label, xlim=(-1.0, 1.0))
            axes[name].legend(loc="lower right", ncols=2, bbox_to_anchor=(1, 1), borderaxespad=0.0, markerscale=3)
        for name, (title, (truth, guess)) in zip("123", panels.items(), strict=True):
            ends, ticks = 1.1 * np.abs(truth).max() * np.array([-1.0, 1.0]), [-4, -2, 0, 2, 4]
            axes[name].plot(ends, ends, color=INK, lw=0.8)
            axes[name].plot(truth, np.clip(guess, *ends), ".", ms=4, color=BLUE, clip_on=False)
            axes[name].set(xlim=ends, ylim=ends, xticks=ticks, yticks=ticks, aspect="equal", title=title)
            axes[name].set(xlabel="derivative of the mean", ylabel="estimate" if name == "1" else "")
    return fig


def main() -> None:
    """Print the table and save the figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("gradients.png"))
    out, begun = parser.parse_args().out, first_flights(CONTEXTS)
    grid, coarse = (np.tile(spins, (CONTEXTS, 1)) for spins in (GRID, COARSE))
    contacts, earned, slopes = impact(begun, grid), reward(begun, grid), path_derivative(reward, begun, coarse)
    turns = path_derivative(lambda *given: np.asarray(impact(*given)["omega_after"]), begun, coarse)
    steps, middles = np.diff(earned), 0.5 * (GRID[1:] + GRID[:-1])
    jumps = smoothed(np.where(np.abs(steps) > JUMP, steps, 0.0) / (GRID[1] - GRID[0]), middles)[0]
    errors = np.random.default_rng(0).normal(0.0, ERROR, (CONTEXTS, len(TRIMS), RIDES))
    spins = TRIMS[:, np.newaxis] + errors
    found = estimates(reward(begun, spins), path_derivative(reward, begun, spins), errors)
    spin, truth = smoothed(contacts["omega_after"], GRID)[1], smoothed(earned, GRID)[1]
    turn, path = smoothed(turns, COARSE)[0], smoothed(slopes, COARSE)[0]
    codes = np.stack([contacts[name] for name in ("feature", "ground", "sequence")])
    same = np.stack([np.ptp(codes[..., np.abs(GRID - a) < 3.0 * ERROR], axis=-1).max(axis=0) for a in TRIMS], 1) == 0
    cases = {"spin, same events": (spin[same], turn[same]), "spin": (spin, turn), "jumps": (truth, jumps)}
    cases |= {"one path": (truth, slopes[:, 300:-300:100]), "all paths": (truth, path)}
    cases |= {name: (truth, guess) for name, guess in found.items()}
    table = []
    for name, (true, guess) in cases.items():
        numbers = np.corrcoef(guess.ravel(), true.ravel())[0, 1], np.mean((guess * true > 0.0)[np.abs(true) > CLEAR])
        error = np.sqrt(np.mean((guess - true) ** 2) / np.mean(true**2))
        table.append([name, str(true.size), *(f"{number:.2f}" for number in (*numbers, error))])
    print(markdown(["derivative", "trims", "correlation", "right sign", "error"], table))
    print("jumps", (np.abs(np.diff(earned[:, 400:-400:4])) > JUMP).sum(axis=1), "clear", (np.abs(truth) > CLEAR).sum())
    print("path derivatives", np.quantile(np.abs(slopes), [0.5, 0.99, 0.999]), "truth", np.sqrt(np.mean(truth**2)))
    shown = ("spin, same events", "pathwise", "likelihood ratio")
    panels = {name: (cases[name][0].ravel(), cases[name][1].ravel()) for name in shown}
    draw(earned[[SHOWN]], slopes[[SHOWN]], panels).savefig(out, dpi=150)


if __name__ == "__main__":
    main()
