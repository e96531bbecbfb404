"""Tables and figures of an identification, and what ``sledenv identify`` writes into a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from sledenv.identification.comparison import Comparison
from sledenv.identification.fitting import Floats
from sledenv.identification.rebound_fit import Identification
from sledenv.identification.rebounds import AFTER, ARMS, BEFORE
from sledenv.identification.recordings import POSE, TIME
from sledenv.identification.tables import RECORDING
from sledenv.identification.tracks import TrackFit
from sledenv.machine.files import no_formula
from sledenv.pages.columns import TRAJECTORY_COLUMNS
from sledenv.pages.replay import replay_page
from sledenv.plot.style import BLUE, DASHES, INK, ORANGE, WIDTH, styled
from sledenv.simulation.scene import State

_POSE_LABELS = ("x [mm]", "y [mm]", "phi [deg]")
_LABELS = ("u [m/s]", "v [m/s]", "omega [rad/s]")
FILES: Final = ("parameters.csv", "starts.csv", "balance.csv", "rebounds.csv", "residuals.png", "profiles.png")
COMPARED: Final = ("errors.csv", "models.csv", "differences.csv", "models.png")

LAUNCH: Final = [TRAJECTORY_COLUMNS[name] for name in State._fields]

_DPI = 150


def rebound_table(found: Identification) -> pd.DataFrame:
    """Return one row per rebound: recording by number, arms, velocities before, after and as fitted, residuals, error.

    Residuals are fitted less recorded velocities in the energy norm, relative to the speed before; the error is the
    length of the three.
    """
    rebounds = found.rebounds
    columns = {"recording": rebounds.recordings, "corner": rebounds.corner}
    for names, values in (
        (ARMS, rebounds.arms),
        (BEFORE, rebounds.before),
        (AFTER, rebounds.after),
        ([name.replace("after", "fitted") for name in AFTER], found.velocities),
        (("u_residual", "v_residual", "omega_residual"), rebounds.residuals(found.velocities)),
    ):
        columns |= dict(zip(names, values.T, strict=True))
    return pd.DataFrame(columns | {"error": found.errors}).rename_axis("row")


def write_identification(found: Identification, folder: Path, comparison: Comparison | None = None) -> None:
    """Write the tables and figures of a fit, and of a comparison of models if there is one, into an empty folder."""
    tables = {
        "parameters.csv": found.table,
        "starts.csv": found.fit.starts.rename_axis("rank"),
        "balance.csv": found.rebounds.balance().rename_axis("arm"),
        "rebounds.csv": rebound_table(found),
    }
    figures = {"residuals.png": plot_residuals(found), "profiles.png": plot_profiles(found)}
    if comparison is not None:
        tables |= {
            "errors.csv": comparison.errors,
            "models.csv": comparison.table,
            "differences.csv": comparison.differences(),
        }
        figures["models.png"] = plot_errors(comparison)
    for name, table in tables.items():
        table.to_csv(folder / name)
    for name, figure in figures.items():
        figure.savefig(folder / name, dpi=_DPI)


def track_files(recordings: int) -> list[str]:
    """Names of what :func:`write_tracks` writes."""
    numbered = [name for k in range(recordings) for name in (f"motion_{k}.html", f"residuals_{k}.png")]
    return ["parameters.csv", "recordings.csv", "launches.csv", "residuals.csv", *numbered]


def write_tracks(found: TrackFit, folder: Path) -> None:
    """Write the tables of a fit to tracks, and of each recording a page that shows it beside the simulated motion."""
    found.table.to_csv(folder / "parameters.csv")
    found.used.rename(index=no_formula).to_csv(folder / "recordings.csv")
    names = found.residuals[RECORDING].map(no_formula)
    found.residuals.assign(**{RECORDING: names}).to_csv(folder / "residuals.csv", index=False)
    launches = pd.DataFrame(found.launches.values(), pd.Index(found.launches, name=RECORDING), LAUNCH)
    launches.rename(index=no_formula).to_csv(folder / "launches.csv")
    for k, one in enumerate(found.recordings):
        title = f"Recorded and simulated: {one.name}"
        page = replay_page(found.descent(one.name), title, found.ghost(one.name))
        (folder / f"motion_{k}.html").write_text(page, encoding="utf-8")
        plot_track_residuals(found, one.name).savefig(folder / f"residuals_{k}.png", dpi=_DPI)


def plot_residuals(found: Identification) -> Figure:
    """Draw velocities after, recorded over fitted, and residuals over the arm a of the contact point.

    A law that leaves nothing out has residuals that lie about zero wherever the body is hit.
    """
    with styled():
        figure = Figure((WIDTH, 5.6), layout="constrained")
        axes = figure.subplots(2, 3)
        residuals = found.rebounds.residuals(found.velocities)
        size = float(np.clip(60.0 / np.sqrt(len(found.rebounds)), 2.0, 20.0))
        for k, label in enumerate(_LABELS):
            fitted, recorded = found.velocities[:, k], found.rebounds.after[:, k]
            above, below = axes[:, k]
            above.axline((fitted[0], fitted[0]), slope=1.0, color=INK, lw=0.8, ls=DASHES)
            above.scatter(fitted, recorded, size, BLUE, alpha=0.5, lw=0)
            above.set_title(label)
            above.set_xlabel("fitted")
            below.axhline(0.0, color=INK, lw=0.8, ls=DASHES)
            below.scatter(1e3 * found.rebounds.arms[:, 0], residuals[:, k], size, BLUE, alpha=0.5, lw=0)
            below.set_xlabel("arm a of the contact [mm]")
            below.sharey(axes[1, 0])
            below.label_outer()
        axes[0, 0].set_ylabel("recorded after the impact")
        axes[1, 0].set_ylabel("fitted - recorded,\nover the speed before")
    return figure


def plot_track_residuals(found: TrackFit, name: str | None = None) -> Figure:
    """Draw recorded less simulated poses of a recording over time, with two standard deviations of its noise.

    Frames that are not used are grey; wrong poses that would hide the others are drawn at the edge.
    """
    name = name or found.recordings[0].name
    rows = found.residuals[found.residuals[RECORDING] == name]
    noise = next(one.noise for one in found.recordings if one.name == name)
    with styled():
        figure = Figure((WIDTH, 4.8), layout="constrained")
        axes = figure.subplots(3, 1, sharex=True)
        hits = found.descent(name).rebounds["t"] + float(rows[TIME].iloc[0])
        factors = (1e3, 1e3, np.degrees(1.0))
        sizes = (noise.position, noise.position, noise.angle)
        for axis, column, label, factor, size in zip(axes, POSE, _POSE_LABELS, factors, sizes, strict=True):
            values = factor * rows[column].to_numpy()
            edge = max(1.6 * float(np.quantile(np.abs(values[rows["used"]]), 0.9)), 4.0 * factor * size)
            axis.axhspan(-2.0 * factor * size, 2.0 * factor * size, color=BLUE, alpha=0.1, lw=0)
            axis.vlines(hits, -edge, edge, color=INK, lw=0.5, alpha=0.4)
            for used, colour in ((False, "0.75"), (True, BLUE)):
                chosen = rows["used"].to_numpy() == used
                axis.plot(rows[TIME].to_numpy()[chosen], np.clip(values[chosen], -edge, edge), ".", color=colour, ms=3)
            axis.axhline(0.0, color=INK, lw=0.8, ls=DASHES)
            axis.set_ylim(-1.03 * edge, 1.03 * edge)
            axis.set_ylabel(label)
        axes[0].set_title("recorded - simulated; band: twice the noise; lines: rebounds")
        axes[-1].set_xlabel("time [s]")
    return figure


def plot_errors(comparison: Comparison) -> Figure:
    """Draw mean and 90th percentile of the held-out errors of each model, with their intervals, the best on top."""
    table = comparison.table[::-1]
    places = np.arange(len(table))
    with styled():
        figure = Figure((WIDTH, 1.2 + 0.3 * len(table)), layout="constrained")
        ax = figure.subplots()
        for name, label, colour, marker in (("mean", "mean", BLUE, "o"), ("p90", "90th percentile", ORANGE, "s")):
            values = table[name].to_numpy()
            reach = np.stack([values - table[f"{name}_low"], table[f"{name}_high"] - values])
            ax.errorbar(
                values, places, xerr=np.maximum(reach, 0.0), color=colour, fmt=marker, ms=5, lw=1.4, label=label
            )
        ax.set_yticks(places, table.index)
        ax.set_xlim(left=0.0)
        ax.grid(axis="x", color="#E3E7EC")
        ax.set_axisbelow(True)
        ax.set_xlabel("distance from the recorded velocities in the energy norm, over the speed before")
        figure.legend(loc="outside upper right", ncols=2)
    return figure


def plot_profiles(found: Identification, points: int = 15) -> Figure:
    """Draw how the least cost rises as each fitted parameter is held beside its value, with its interval shaded."""
    names = found.fit.problem.free
    with styled():
        figure = Figure((WIDTH, 2.9), layout="constrained")
        axes = figure.subplots(1, len(names), squeeze=False, sharey=True)[0]
        for ax, name in zip(axes, names, strict=True):
            one, interval = found.fit.problem.parameter(name), found.intervals[name]
            unit, factor = ("mm", 1e3) if one.unit == "m" else (one.unit, 1.0)
            reach = 0.5 * max(interval.high - interval.low, 1e-3 * one.scale)
            values = np.linspace(max(interval.low - reach, one.low), min(interval.high + reach, one.high), points)
            ax.plot(factor * values, _rises(found, name, values), color=BLUE)
            ax.axvspan(factor * interval.low, factor * interval.high, color=BLUE, alpha=0.12, lw=0)
            ax.axvline(factor * found.values[name], color=INK, lw=0.8, ls=DASHES)
            ax.xaxis.set_major_locator(MaxNLocator(4))
            ax.set_xlabel(f"{name.replace('_', ' ')}{f' [{unit}]' if unit else ''}")
        axes[0].set_ylabel("rise of the least cost")
    return figure


def _rises(found: Identification, name: str, values: Floats) -> list[float]:
    return [found.fit.held(**{name: value})[0] - found.fit.cost for value in values.tolist()]
