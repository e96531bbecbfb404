"""Statistics of many launches: shares with their confidence, quantiles, envelopes along the slope, Sobol's indices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from SALib.analyze import sobol
from scipy import stats

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
_INDICES: Final = {"first": "S1", "first_conf": "S1_conf", "total": "ST", "total_conf": "ST_conf"}
_SHOWN: Final = ("bounce_m", "speed_m_s", "kinetic_j")  # by place over a hillside
_STOPS: Final = (0.05, 0.1, 0.25, 0.5, 0.75, 0.9, 0.95, 0.99)
_MIDDLE: Final = (0.005, 0.995)
_SURE: Final = float(stats.norm.ppf(0.975))  # standard deviations to each side of an interval of 95 %


def interval(hits: NDArray[np.bool_], group: int) -> tuple[float, float, float]:
    """Return a share and its interval of 95 %, Wilson's for as many launches as groups are worth.

    Launches of a group of Saltelli's scheme share draws, so it is the means of groups that are independent. Sobol's
    sequence makes them vary less than at random, which the interval does not count on.
    """
    share, worth = float(hits.mean()), _worth(hits, group)  # scipy's binomtest takes whole numbers of launches alone
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
    return {name: output for name, output in outputs.items() if np.less(*np.quantile(output, _MIDDLE))}


def indices(outputs: dict[str, NDArray[np.float64]], parameters: Sequence[str], seed: int) -> pd.DataFrame:
    """Return Sobol's indices of outputs: SALib's estimates and its bootstrap."""
    problem = {"num_vars": len(parameters), "names": list(parameters)}
    rows = []
    for name, output in outputs.items():
        found = sobol.analyze(problem, output, calc_second_order=False, seed=seed + 1)  # a seed of 0 is none for SALib
        columns = (found[of].tolist() for of in _INDICES.values())
        rows += [(name, *row) for row in zip(parameters, *columns, strict=True)]
    kinds = {"output": "object", "parameter": "object"} | dict.fromkeys(_INDICES, "float64")
    return pd.DataFrame(rows, columns=list(kinds)).astype(kinds)


def answer(ends: pd.DataFrame, places: pd.DataFrame) -> str:
    """Return the answer in a line: how descents end, and within which place."""
    ways = [f"{100.0 * row.share:.3g} % {row.status}" for row in ends.itertuples() if row.share > 0.0]
    half, most = (places.set_index("share")["x_m"][share] for share in (0.5, 0.95))
    return f"{', '.join(ways)}; half end within {half:.4g} m, 95 % within {most:.4g} m"


def words(
    ends: pd.DataFrame, outputs: pd.DataFrame, places: pd.DataFrame, along: pd.DataFrame, sensitivity: pd.DataFrame
) -> str:
    """Return tables for a reader, lines of at most 120 characters."""
    tables = {
        "how descents end, with intervals of 95 %": ends.set_index("status"),
        "numbers that descents end with": outputs.set_index("output"),
        "up to where shares of all bodies end, with intervals of 95 %": places.set_index("share"),
    }
    if f"{_SHOWN[0]}_most" in along:
        tables["by place: the share that comes there, and how high, fast and energetic it passes"] = _by_place(along)
    ranked = sensitivity.sort_values(["output", "total"], ascending=[True, False])
    tables["Sobol indices, with half-widths of intervals of 95 %"] = ranked.set_index(["output", "parameter"])
    return "\n\n".join(f"{head}\n{_text(table)}" for head, table in tables.items())


def _text(table: pd.DataFrame) -> str:
    return str(table.rename_axis([None] * table.index.nlevels).to_string(float_format="{:.4g}".format))


def _by_place(along: pd.DataFrame) -> pd.DataFrame:
    """Return by place which share of launches comes there, and how high, fast and energetic those pass."""
    names = {("", "z_m"): along["z_m"], ("", "comes"): along["moving"] + along["finished"]}
    names |= {(name, which): along[f"{name}_{which}"] for name in _SHOWN for which in ("q50", "q95", "most")}
    return pd.DataFrame(names).set_index(along["x_m"])
