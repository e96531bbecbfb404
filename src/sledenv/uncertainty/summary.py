"""What many launches say: shares with their confidence, quantiles, envelopes along the slope and Sobol's indices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from SALib.analyze import sobol
from scipy import stats

from sledenv.machine.text_tables import aligned
from sledenv.simulation.jam import DescentJam
from sledenv.simulation.records import LOSSES, Status

QUANTILES: Final = (0.05, 0.25, 0.5, 0.75, 0.95)
NAMES: Final = tuple(f"q{100 * share:02.0f}" for share in QUANTILES)
OUTPUTS: Final = (  # numbers that each descent ends with
    *("stop_m", "time_s", "rebounds", "speed_m_s", "kinetic_j", *DescentJam._fields),
    *(f"lost_{name}_j" for name in LOSSES),
)
ENDS: Final = (Status.FINISH, Status.JAMMED, Status.TUMBLED)  # every other status is a limit that was met
LEFT_BACKWARDS: Final = "left_backwards"  # the status of who leaves a section of terrain behind its start
# Outputs with Sobol indices, and whether each of ENDS.
_ANALYSED: Final = ("stop_m", "time_s", "kinetic_j", "reward")
_SHOWN: Final = ("bounce_m", "speed_m_s", "kinetic_j")  # by place over a hillside
_STOPS: Final = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)
_MIDDLE: Final = (0.005, 0.995)
_SURE: Final = float(stats.norm.ppf(0.975))  # standard deviations to each side of an interval of 95 %


def interval(hits: NDArray[np.bool_], group: int) -> tuple[float, float, float]:
    """Return a share and its interval of 95 %, Wilson's for as many launches as groups are worth.

    Launches of a group of Saltelli's scheme share draws, so it is the means of groups that are independent. Sobol's
    sequence makes them vary less than at random, which the interval does not count on.
    """
    share, worth = float(hits.mean()), _worth(hits, group)
    square = _SURE**2 / worth
    centre = (share + 0.5 * square) / (1.0 + square)
    width = _SURE * np.sqrt(share * (1.0 - share) / worth + 0.25 * square / worth) / (1.0 + square)
    return share, max(float(centre - width), 0.0), min(float(centre + width), 1.0)


def _worth(hits: NDArray[np.bool_], group: int) -> float:
    """Return how many independent launches would make a share scatter as groups do."""
    means = hits.reshape(-1, group).mean(axis=1)
    share, scatter = float(means.mean()), float(means.var())
    return share * (1.0 - share) / scatter * len(means) if scatter > 0.0 else float(len(means))


def shares(status: pd.Series, group: int) -> pd.DataFrame:
    """Return how often descents end in each way, for the ways of ``ENDS`` and all others that occur."""
    others = [LEFT_BACKWARDS, *(str(one) for one in Status if one not in ENDS)]
    names = [*map(str, ENDS), *(name for name in others if (status == name).any())]
    rows = [(name, *interval((status == name).to_numpy(), group)) for name in names]
    return pd.DataFrame(rows, columns=["status", "share", "low", "high"])


def quantiles(ends: pd.DataFrame) -> pd.DataFrame:
    """Return mean and quantiles of each of ``OUTPUTS``."""
    values = ends[list(OUTPUTS)].to_numpy(np.float64)
    found = np.quantile(values, QUANTILES, axis=0)
    return pd.DataFrame({"output": OUTPUTS, "mean": values.mean(axis=0), **dict(zip(NAMES, found, strict=True))})


def stops(places: pd.Series, group: int) -> pd.DataFrame:
    """Return up to which place [m] shares of all bodies end, with intervals of 95 % by order statistics.

    Of as many launches as groups are worth, the number that end up to a quantile is binomial; an interval that needs
    more of them than there are is open. The last row is the largest place that was found.
    """
    values = places.to_numpy()
    rows = []
    for share in _STOPS:
        place = float(np.quantile(values, share, method="inverted_cdf"))
        worth = round(_worth(values <= place, group))
        low, high = stats.binom.ppf((0.025, 0.975), worth, share) + np.array([0.0, 1.0])
        ends = (np.quantile(values, min(rank / worth, 1.0), method="inverted_cdf") for rank in (low, high))
        below, above = (float(end) for end in ends)
        rows.append((share, place, below if low >= 1.0 else -np.inf, above if high <= worth else np.inf))
    rows.append((1.0, float(values.max()), np.nan, np.nan))
    return pd.DataFrame(rows, columns=["share", "x_m", "low_m", "high_m"])


def envelope(
    x: float, ends: pd.DataFrame, passing: pd.DataFrame, group: int, heights: Sequence[float]
) -> dict[str, float]:
    """Return a row of the envelopes, but for its place.

    Parameters
    ----------
    x : float
        Distance along the slope [m].
    ends : DataFrame
        Status and outputs of N launches.
    passing : DataFrame
        Speed [m/s], kinetic energy [J] and over a hillside heights where they first come to the distance, NaN if never.
    group : int
        Launches in a group of Saltelli's scheme.
    heights : sequence of float
        Of barriers [m]: the shares that pass with their lowest point above them are told.
    """
    status, there = ends["status"], passing["speed_m_s"].notna().to_numpy()
    finished = ((status == Status.FINISH) & (ends["stop_m"] <= x)).to_numpy()
    stopped = ~there & ~finished
    ways = {"moving": there & ~finished, "finished": finished}
    names = [*map(str, ENDS[1:]), *([LEFT_BACKWARDS] if LEFT_BACKWARDS in status.cat.categories else [])]
    ways |= {name: stopped & (status == name).to_numpy() for name in names}
    ways["other"] = stopped & ~status.isin([str(ENDS[0]), *names]).to_numpy()
    ways |= {f"over_{height:g}_m": (passing["bounce_m"] > height).to_numpy() for height in heights}
    row: dict[str, float] = {}
    for name, hits in ways.items():
        row |= dict(zip((name, f"{name}_low", f"{name}_high"), interval(hits, group), strict=True))
    for name, column in passing.items():
        values = column[there].to_numpy()
        found = np.quantile(values, (*QUANTILES, 1.0)) if there.any() else np.full(len(QUANTILES) + 1, np.nan)
        row |= {f"{name}_{which}": float(value) for which, value in zip((*NAMES, "most"), found, strict=True)}
    return row


def analysed(ends: pd.DataFrame) -> dict[str, NDArray[np.float64]]:
    """Return the outputs that have Sobol indices: not those that are the same in 99 % of all launches.

    A few launches would make up all of their variance.
    """
    outputs = {name: ends[name].to_numpy(np.float64) for name in _ANALYSED}
    outputs |= {str(one): (ends["status"] == one).to_numpy(np.float64) for one in (*ENDS, LEFT_BACKWARDS)}
    middle = {name: np.quantile(output, _MIDDLE) for name, output in outputs.items()}
    return {name: output for name, output in outputs.items() if middle[name][0] < middle[name][1]}


def indices(name: str, output: NDArray[np.float64], parameters: tuple[str, ...], seed: int) -> pd.DataFrame:
    """Return Sobol's indices of an output: SALib's estimates and its bootstrap."""
    problem = {"num_vars": len(parameters), "names": list(parameters)}
    found = sobol.analyze(problem, output, calc_second_order=False, seed=seed + 1)  # a seed of 0 is none for SALib
    columns = {"first": "S1", "first_conf": "S1_conf", "total": "ST", "total_conf": "ST_conf"}
    return pd.DataFrame({"output": name, "parameter": parameters} | {key: found[of] for key, of in columns.items()})


def no_indices() -> pd.DataFrame:
    """Return a table of no indices, with its columns."""
    columns: dict[str, Any] = {"output": "object", "parameter": "object"}
    columns |= dict.fromkeys(("first", "first_conf", "total", "total_conf"), "float64")
    return pd.DataFrame({name: pd.Series(dtype=kind) for name, kind in columns.items()})


def words(
    ends: pd.DataFrame, outputs: pd.DataFrame, places: pd.DataFrame, along: pd.DataFrame, sensitivity: pd.DataFrame
) -> str:
    """Return tables for a reader, lines of at most 120 characters."""
    ways = [(f"  {row.status}", f"{row.share:.4f}", f"[{row.low:.4f}, {row.high:.4f}]") for row in ends.itertuples()]
    values = [(f"  {row[0]}", *(f"{value:.4g}" for value in row[1:])) for row in outputs.itertuples(index=False)]
    lines = ["how descents end, with intervals of 95 %", *aligned(ways, ("<14", ">6", "<")), ""]
    lines += [*aligned([("quantiles", "mean", *NAMES), *values], ("<22", ">10")), ""]
    reached = [(f"  {row[0]:.0%}", *(f"{x:.4g}" for x in row[1:])) for row in places.itertuples(index=False)]
    lines += [*aligned([("share that ends", "up to x_m", "low_m", "high_m"), *reached], ("<22", ">10")), ""]
    if f"{_SHOWN[0]}_most" in along:
        lines += [*_by_place(along), ""]
    lines.append("Sobol indices, first order / total, +- half of the interval of 95 %")
    for output, found in sensitivity.groupby("output", sort=False):
        rows = [
            (f"    {row.parameter}", _spread(row.first, row.first_conf), _spread(row.total, row.total_conf))
            for row in found.sort_values("total", ascending=False).itertuples()
        ]
        lines += [f"  {output}", *aligned(rows, ("<34", ">15", ">16"))]
    return "\n".join(lines)


def _by_place(along: pd.DataFrame) -> list[str]:
    """Return by place which share of launches comes there, and how high, fast and energetic those pass."""
    shown = [f"{name}_{quantile}" for name in _SHOWN for quantile in ("q50", "q95", "most")]
    rows = [
        (
            *(f"  {row['x_m']:g}", f"{row['z_m']:.5g}", f"{row['moving'] + row['finished']:.3f}"),
            *(f"{row[name]:.4g}" for name in shown),
        )
        for row in along.to_dict("records")
    ]
    names = ["by place", "", "", *(name for each in _SHOWN for name in (each, "", ""))]
    head = ["  x_m", "z_m", "comes", *("median", "95 %", "most") * len(_SHOWN)]
    return aligned([names, head, *rows], ("<8", ">7", ">7", ">9"), " ")


def _spread(index: float, half: float) -> str:
    return f"{index:6.3f} +-{half:6.3f}"
