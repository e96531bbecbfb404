"""What ``sledenv identify`` writes into a folder: tables of the fit and of its residuals, and figures."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pandas as pd

from sledenv.identification.comparison import Comparison
from sledenv.identification.figures import plot_errors, plot_profiles, plot_residuals, plot_track_residuals
from sledenv.identification.rebound_fit import Identification
from sledenv.identification.rebounds import AFTER, ARMS, BEFORE
from sledenv.identification.tracks import TrackFit
from sledenv.pages.columns import TRAJECTORY_COLUMNS
from sledenv.pages.replay import replay_page
from sledenv.simulation.scene import State

FILES: Final = ("parameters.csv", "starts.csv", "balance.csv", "rebounds.csv", "residuals.png", "profiles.png")
COMPARED: Final = ("errors.csv", "models.csv", "differences.csv", "models.png")

LAUNCH: Final = [TRAJECTORY_COLUMNS[name] for name in State._fields]

_DPI = 150


def rebound_table(found: Identification) -> pd.DataFrame:
    """Return one row a rebound: recording by number, arms, velocities before, after and as fitted, residuals, error.

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
    found.used.to_csv(folder / "recordings.csv")
    found.residuals.to_csv(folder / "residuals.csv", index=False)
    launches = pd.DataFrame(found.launches.values(), pd.Index(found.launches, name="recording"), LAUNCH)
    launches.to_csv(folder / "launches.csv")
    for k, one in enumerate(found.recordings):
        title = f"Recorded and simulated: {one.name}"
        page = replay_page(found.descent(one.name), title, found.ghost(one.name))
        (folder / f"motion_{k}.html").write_text(page, encoding="utf-8")
        plot_track_residuals(found, one.name).savefig(folder / f"residuals_{k}.png", dpi=_DPI)
