"""Contact laws of 1,718 recorded impacts of an ellipse: what they tell, and what they cannot tell apart.

The planar-impact-dataset of the MCube Lab (Fazeli et al., arXiv 1710.05947) has no licence and is not part of this
repository: download it and name the folder of its .mat files.

``python examples/planar_impacts.py FOLDER --out impacts``
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator
from scipy.io import loadmat
from scipy.spatial import KDTree

from sledenv.identification.comparison import Comparison, Predictor, compare, impact_models
from sledenv.identification.fitting import Floats, Parameter, Problem, profiled, solve
from sledenv.identification.law import ImpactModel
from sledenv.identification.plausibility import read_rebounds
from sledenv.identification.rebound_fit import Identification
from sledenv.identification.rebounds import AFTER, ARMS, BEFORE, Rebounds
from sledenv.identification.report import plot_errors, plot_residuals
from sledenv.machine.files import publish
from sledenv.plot.style import BLUE, DASHES, INK, ORANGE, RED, WIDTH, styled
from sledenv.simulation.rigid_impact import velocities_after

MASS, GYRATION_RADIUS = 0.0364, 0.0192  # [kg], [m]
PUBLISHED = ("Drumwright-Shell", "AP Poisson", "AP Newton", "Mirtich", "Wang-Mason", "Whittaker")
FITTED = 600  # impacts that laws are fitted to; the others are held out
GOAL = 0.234, 0.364  # mean and 90th percentile of held-out errors

_WORDS = {"told": "as told", "turned": "turned"}
FIGURES = ("impacts_balance.png", "impacts_models.png", "impacts_arm.png", "impacts_residuals.png")
TABLES = (
    *(
        f"{name}_{reading}.csv"
        for name in ("models", "differences", "rivals", "arms")
        for reading in ("told", "turned")
    ),
    "balances.csv",
    "slips.csv",
    "remains.csv",
)


class Recorded(NamedTuple):
    """Recorded impacts, as the files hold them."""

    table: pd.DataFrame  # as sledenv.identify takes it
    published: dict[str, Floats]  # velocities after that six models predict, shape (N, 3)
    torque: Floats  # moment [N m s] that the dataset says acted beside the impulses, shape (N,)


def read_impacts(folder: Path) -> Recorded:
    """Read the dataset; impacts that would create energy are left out, as no contact does."""
    data = loadmat(folder / "data_ellipse.mat")["data"][0, 0]
    before, after, normal, tangent = (np.asarray(data[name], float) for name in ("states_i", "states_f", "n", "d"))
    predicted = loadmat(folder / "v_models.mat")["v_models"].reshape(len(before), len(PUBLISHED), 3)
    wrench = np.asarray(loadmat(folder / "w_true_data.mat")["W"], float)
    columns = [-normal[:, 2:], tangent[:, 2:], before[:, 3:], after[:, 3:]]
    table = pd.DataFrame(np.hstack(columns), columns=[*ARMS, *BEFORE, *AFTER])
    scales = np.array([1.0, 1.0, GYRATION_RADIUS])
    energies = [np.sum((state[:, 3:] * scales) ** 2, axis=1) for state in (before, after)]
    kept = energies[1] <= energies[0]
    published = {name: predicted[kept, k] for k, name in enumerate(PUBLISHED)}
    return Recorded(table[kept].reset_index(drop=True), published, wrench[kept, 2])


def turned(rebounds: Rebounds) -> Rebounds:
    """Return the rebounds with the arm b of the other sign: spins counted against the sense of x and y."""
    return replace(rebounds, contacts=rebounds.contacts * np.array([1.0, -1.0, 1.0, 1.0, 1.0]))


# --- rival explanations ----------------------------------------------------------------------------------------------


def rival(parameter: Parameter, change: Callable[[Rebounds, float], Rebounds]) -> Predictor:
    """Return the law with restitution and friction, of a body that is told otherwise by one fitted number."""
    model = ImpactModel("energetic", {})
    e, friction, *_ = model.parameters(GYRATION_RADIUS)

    def velocities(rebounds: Rebounds, values: Floats) -> Floats:
        return model.velocities(change(rebounds, values[2]), np.array([values[0], values[1], 0.0, 0.0, 0.0]))

    return _predictor((e, friction, parameter), velocities)


def _predictor(parameters: tuple[Parameter, ...], velocities: Callable[[Rebounds, Floats], Floats]) -> Predictor:
    def predict(train: Rebounds, test: Rebounds) -> Floats:
        problem = Problem(parameters, lambda values: train.residuals(velocities(train, values)), loss_scale=0.1)
        fit = solve(problem, starts=16)
        print("   ", ", ".join(f"{name} {value:.4g}" for name, value in fit.values.items()), flush=True)
        return velocities(test, fit.vector)

    return predict


def _contacts(column: int, factor: float, shift: float = 0.0) -> Callable[[Rebounds, float], Rebounds]:
    """Return what multiplies a column of the contacts by ``1 + factor (x - 1)`` and adds ``shift x``."""

    def change(rebounds: Rebounds, value: float) -> Rebounds:
        contacts = rebounds.contacts.copy()
        contacts[:, column] = contacts[:, column] * (1.0 + factor * (value - 1.0)) + shift * value
        return replace(rebounds, contacts=contacts)

    return change


def _sided(rebounds: Rebounds, values: Floats) -> Floats:
    """Velocities with a friction for each side on which the body is hit."""
    laws = np.zeros((len(rebounds), 3))
    laws[:, 0], laws[:, 1] = values[0], np.where(rebounds.arms[:, 0] > 0.0, values[1], values[2])
    return velocities_after(rebounds.gyration_radius, rebounds.contacts, laws)


def rivals() -> dict[str, Predictor]:
    """Laws with at most three fitted numbers that might do what a rolling arm does."""
    smooth = {"corner_rolling_arm": 0.0, "softening": 0.0}
    e, friction, *_ = ImpactModel().parameters(GYRATION_RADIUS)
    scale, offset = Parameter("scale", "", -2.0, 2.0, 0.1), Parameter("offset", "m", -0.01, 0.01, 1e-3)
    radius = Parameter("radius", "m", 0.5 * GYRATION_RADIUS, 2.0 * GYRATION_RADIUS, 1e-3)
    return {
        "restitution, friction": ImpactModel("energetic", {**smooth, "rolling_arm": 0.0}),
        "restitution, rolling arm": ImpactModel("energetic", {**smooth, "friction": 0.0}),
        "restitution, friction, rolling arm": ImpactModel("energetic", smooth),
        "... scale of a": rival(scale, _contacts(0, 1.0)),
        "... scale of b": rival(scale, _contacts(1, 1.0)),
        "... offset of a": rival(offset, _contacts(0, 0.0, 1.0)),
        "... offset of b": rival(offset, _contacts(1, 0.0, 1.0)),
        "... radius of gyration": rival(radius, lambda rebounds, k: replace(rebounds, gyration_radius=k)),
        "... friction by side": _predictor(
            (e, friction._replace(name="right"), friction._replace(name="left")), _sided
        ),
        "... softening": ImpactModel("energetic", {"corner_rolling_arm": 0.0, "rolling_arm": 0.0}, 2.57),
    }


# --- what is told by parts of the data -------------------------------------------------------------------------------


def arms_by_part(rebounds: Rebounds, parts: int = 6) -> pd.DataFrame:
    """Rolling arm fitted to impacts with alike arms a, and alike approach speeds, with its intervals [m]."""
    model = ImpactModel("energetic", {"corner_rolling_arm": 0.0, "softening": 0.0})
    rows = []
    for by, values in (("a", rebounds.arms[:, 0]), ("approach", rebounds.approach)):
        ends = np.quantile(values, np.linspace(0.0, 1.0, parts + 1))
        for low, high in itertools.pairwise(ends):
            chosen = rebounds.rows((values >= low) & (values <= high))
            fit, intervals = profiled(model.fit(chosen))
            interval = intervals["rolling_arm"]
            middle = float(np.median(values[(values >= low) & (values <= high)]))
            rows.append((by, middle, len(chosen), fit.values["rolling_arm"], interval.low, interval.high))
    return pd.DataFrame(rows, columns=["by", "median", "impacts", "rolling_arm", "low", "high"])


def missing_moment(rebounds: Rebounds, after: Floats) -> Floats:
    """Moment [m^2/s] over the mass that the impulses at the arms leave over for a change of spin, shape (N,)."""
    change = after - rebounds.before
    given = rebounds.arms[:, 1] * change[:, 0] - rebounds.arms[:, 0] * change[:, 1]
    left: Floats = GYRATION_RADIUS**2 * change[:, 2] - given
    return left


def balances(readings: dict[str, Rebounds], recorded: Recorded) -> pd.Series:
    """Where a moment is missing, whatever the law, and in which reading the dataset's own numbers have none."""
    found = {}
    for name, rebounds in readings.items():
        left = missing_moment(rebounds, rebounds.after)
        arm = left / (rebounds.after - rebounds.before)[:, 1]  # moment over the normal impulse
        found[f"{name}: share of its variance that follows a"] = np.corrcoef(arm, rebounds.arms[:, 0])[0, 1] ** 2
        found[f"{name}: largest missing moment [N m s]"] = MASS * np.abs(left).max()
        found[f"{name}: largest difference from the dataset's torque"] = np.abs(MASS * left - recorded.torque).max()
        published = [missing_moment(rebounds, after) for after in recorded.published.values()]
        found[f"{name}: largest missing moment of the published predictions"] = MASS * np.abs(published).max()
    return pd.Series(found)


def slips(readings: dict[str, Rebounds], most: float = 0.002) -> pd.DataFrame:
    """Slip velocities [m/s] before and after impacts whose normal impulse hardly turns the body, |a| < ``most`` [m].

    There friction alone changes the slip, and it cannot speed it up.
    """
    rows = {}
    for name, rebounds in readings.items():
        near = rebounds.rows(np.abs(rebounds.arms[:, 0]) < most)
        for when, velocities in (("before", near.before), ("after", near.after)):
            slip = velocities[:, 0] + near.arms[:, 1] * velocities[:, 2]
            rows[name, when] = [len(near), *np.quantile(slip, [0.05, 0.5, 0.95])]
    columns = ["impacts", "5 %", "median", "95 %"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns).set_axis(
        pd.MultiIndex.from_tuples(rows, names=["arms", "slip"])
    )


def remains(found: Identification, held_out: NDArray[np.bool_]) -> pd.Series:
    """How small errors could be: of impacts that begin alike, and of a smooth correction of the law."""
    rebounds = found.rebounds
    start = np.hstack([rebounds.arms[:, :1], rebounds.before])
    start = (start - start.mean(axis=0)) / start.std(axis=0)
    distance, nearest = KDTree(start).query(start, k=2)
    alike = distance[:, 1] < 0.15
    change = (rebounds.after - rebounds.after[nearest[:, 1]]) * rebounds.scales / rebounds.speed[:, None]
    residuals = rebounds.residuals(found.velocities)
    smooth = RBFInterpolator(start[~held_out], residuals[~held_out], smoothing=10.0)(start[held_out])
    table = {
        "pairs that begin alike": np.count_nonzero(alike),
        "their difference over root 2, mean": np.mean(np.linalg.norm(change[alike], axis=1)) / np.sqrt(2.0),
        "law with a smooth correction, held out, mean": np.mean(np.linalg.norm(residuals[held_out] - smooth, axis=1)),
    }
    for name, values in (
        ("approach speed", rebounds.approach),
        ("u before", rebounds.before[:, 0]),
        ("|a|", np.abs(rebounds.arms[:, 0])),
    ):
        for k, component in enumerate(("u", "v", "omega")):
            table[f"correlation of the residual of {component} with {name}"] = np.corrcoef(values, residuals[:, k])[
                0, 1
            ]
    return pd.Series(table)


# --- figures ---------------------------------------------------------------------------------------------------------


def plot_balance(told: Rebounds) -> Figure:
    """Draw the change of spin over what the impulses at the arms give, for both signs of b."""
    with styled():
        figure = Figure((WIDTH, 4.0), layout="constrained")
        axes = figure.subplots(1, 2, sharex=True, sharey=True)
        titles = "b as told", "b turned"
        for ax, title, rebounds, colour in zip(axes, titles, (told, turned(told)), (RED, BLUE), strict=True):
            spin = GYRATION_RADIUS**2 * (rebounds.after - rebounds.before)[:, 2]
            given = spin - missing_moment(rebounds, rebounds.after)
            share = float(given @ spin / (given @ given))
            ax.axline((0.0, 0.0), slope=1.0, color=INK, lw=0.8, ls=DASHES)
            ax.scatter(1e3 * given, 1e3 * spin, 4, colour, alpha=0.5, lw=0)
            ax.set_title(f"{title}: slope {share:.2f}, correlation {np.corrcoef(given, spin)[0, 1]:.2f}")
            ax.set_xlabel("moment of the impulse, per mass [mm m/s]")
        axes[0].set_ylabel("change of spin times k$^2$ [mm m/s]")
        axes[0].set_ylim(-45.0, 45.0)
    return figure


def plot_arm(parts: dict[str, pd.DataFrame], maps: dict[str, tuple[Floats, Floats, Floats]]) -> Figure:
    """Draw the least errors over friction and rolling arm, and the arm fitted to parts of the data."""
    with styled():
        figure = Figure((WIDTH, 6.4), layout="constrained")
        axes = figure.subplots(2, 2)
        for ax, (title, (friction, arm, error)) in zip(axes[0], maps.items(), strict=True):
            filled = ax.contourf(friction, 1e3 * arm, error, 16, cmap="viridis")
            low = np.unravel_index(np.argmin(error), error.shape)
            ax.plot(friction[low[1]], 1e3 * arm[low[0]], "o", color=ORANGE, ms=8, mec="white", clip_on=False, zorder=3)
            ax.set_title(title)
            ax.set_xlabel("friction")
            figure.colorbar(filled, ax=ax, label="mean error, e fitted")
        axes[0, 0].set_ylabel("rolling arm [mm]")
        for ax, by, label in zip(axes[1], ("a", "approach"), ("arm a [mm]", "approach speed [m/s]"), strict=True):
            for (title, table), colour in zip(parts.items(), (RED, BLUE), strict=True):
                rows = table[table["by"] == by]
                values = 1e3 * rows["rolling_arm"]
                reach = np.maximum([values - 1e3 * rows["low"], 1e3 * rows["high"] - values], 0.0)
                places = rows["median"] * (1e3 if by == "a" else 1.0)
                ax.errorbar(places, values, reach, color=colour, fmt="o", ms=5, label=title)
            ax.set_xlabel(label)
            ax.set_ylim(bottom=-0.3)
        axes[1, 0].set_ylabel("fitted rolling arm [mm]")
        axes[1, 1].legend()
    return figure


def error_map(rebounds: Rebounds, points: int = 31) -> tuple[Floats, Floats, Floats]:
    """Mean error over friction and rolling arm [m], with the best restitution at each."""
    friction, arm = np.linspace(0.0, 0.45, points), np.linspace(0.0, 0.009, points)
    model = ImpactModel("energetic", {})
    error = np.empty((points, points))
    for i, delta in enumerate(arm):
        for k, f in enumerate(friction):
            tried = (
                rebounds.errors(model.velocities(rebounds, np.array([e, f, delta, 0.0, 0.0]))).mean()
                for e in np.linspace(0.5, 0.68, 10)
            )
            error[i, k] = min(tried)
    return friction, arm, error


# --- the study -------------------------------------------------------------------------------------------------------


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="of data_ellipse.mat, v_models.mat and w_true_data.mat")
    parser.add_argument("--out", type=Path, default=Path("impacts"), metavar="FOLDER", help="default: impacts")
    options = parser.parse_args()
    with publish(options.out, (*FIGURES, *TABLES)) as place:
        study(read_impacts(options.folder), place)
    print(f"wrote {options.out}")


def study(recorded: Recorded, folder: Path) -> dict[str, Comparison]:
    """Compare laws in both readings of the arm b, print what is found, and write tables and figures."""
    told = read_rebounds(recorded.table, gyration_radius=GYRATION_RADIUS)
    readings = {"told": told, "turned": turned(told)}
    held_out = np.ones(len(told), bool)
    held_out[np.random.default_rng(0).permutation(len(told))[:FITTED]] = False
    print(f"{len(told)} impacts, {np.count_nonzero(held_out)} held out; shares of the moments in the change of spin:")
    print(told.balance().round(3).to_string())
    _write(balances(readings, recorded).to_frame("value"), folder / "balances.csv", 7)
    _write(slips(readings), folder / "slips.csv")
    models = impact_models(float(np.median(told.approach)))
    comparisons, parts = {}, {}
    for name, rebounds in readings.items():
        print(f"\nb {_WORDS[name]}")
        comparisons[name] = compare(rebounds, models=models, predicted=recorded.published, held_out=held_out)
        differences = comparisons[name].differences()
        _write(comparisons[name].table, folder / f"models_{name}.csv")
        _write(differences, folder / f"differences_{name}.csv")
        compared = compare(rebounds, models=rivals(), held_out=held_out)
        _write(compared.table, folder / f"rivals_{name}.csv")
        parts[name] = arms_by_part(rebounds)
        _write(parts[name], folder / f"arms_{name}.csv")
    found = {name: _identified(rebounds, models["energetic, rolling"]) for name, rebounds in readings.items()}
    for name, one in found.items():
        print(f"\nall impacts, b {_WORDS[name]}: {one}")
    print(f"\nall impacts, b turned: {_identified(readings['turned'], models['energetic, speed'])}")
    _write(remains(found["turned"], held_out).to_frame("value"), folder / "remains.csv")
    maps = {f"b {_WORDS[name]}": error_map(rebounds) for name, rebounds in readings.items()}
    figures = (
        plot_balance(told),
        plot_errors(_together(comparisons)),
        plot_arm({f"b {_WORDS[name]}": table for name, table in parts.items()}, maps),
        plot_residuals(found["turned"]),
    )
    for name, figure in zip(FIGURES, figures, strict=True):
        figure.savefig(folder / name, dpi=130)
    return comparisons


def _identified(rebounds: Rebounds, model: ImpactModel) -> Identification:
    return Identification(*profiled(model.fit(rebounds)), rebounds, model)


def _together(comparisons: dict[str, Comparison]) -> Comparison:
    """Errors of some laws in both readings, and of the published models."""
    errors = comparisons["told"].errors[list(PUBLISHED)].add_prefix("published: ")
    for name, comparison in comparisons.items():
        some = comparison.errors[["energetic", "energetic, rolling", "newton", "poisson", "energetic, speed"]]
        errors = errors.join(some.add_suffix(f" (b {_WORDS[name]})"))
    return Comparison(errors, comparisons["told"].recordings)


def _write(table: pd.DataFrame, file: Path, digits: int = 4) -> None:
    print(f"\n{file.stem}\n{table.round(digits).to_string()}", flush=True)
    table.to_csv(file)


if __name__ == "__main__":
    main()
