"""Runs a study: draws, blocks of descents by all cores or a cluster, and what is made of them; it can be resumed."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from SALib.sample import sobol
from tqdm import tqdm

from sledenv.machine.checksummed import read_checksummed, write_checksummed
from sledenv.machine.files import check_free, replacing
from sledenv.machine.workers import Call, Runner, runner
from sledenv.scenarios.configuration import write_yaml
from sledenv.simulation.lanes import check_room
from sledenv.simulation.records import LIBRARY, LOSSES, STATUS_OF_CODE
from sledenv.simulation.rules import checked_count, checked_flag
from sledenv.uncertainty import summary
from sledenv.uncertainty.descents import PASSING, descend_over, descend_past
from sledenv.uncertainty.distributions import EDGE
from sledenv.uncertainty.figures import plot_envelopes, plot_sobol
from sledenv.uncertainty.model import Study, StudyError, load_study
from sledenv.uncertainty.result import StudyResult, read_launches

_NUMBER: Final = 40  # bytes that each number of the draws takes while they are made
BLOCK: Final = 4096  # launches in a file, at most
_DPI: Final = 150
_LAUNCHES: Final = "launches"
_TABLES: Final = ("shares", "quantiles", "stops", "envelopes", "sobol")
_TABLE_FILES: Final = tuple(f"{name}{suffix}" for name in _TABLES for suffix in (".csv", ".parquet"))
FILES: Final = (_LAUNCHES, "study.yaml", "study.html", *_TABLE_FILES, "envelopes.png", "sobol.png")


def study(
    given: Study | str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    launches: int | None = None,
    workers: int | None = None,
    ray: str | None = None,
    progress: bool = True,
) -> StudyResult:
    """Draw what is uncertain, simulate a descent for each draw, and tell what follows.

    Blocks of launches are written in one move each, so a study that is stopped goes on where it was, and one with more
    launches goes on from one with less. A block that has been changed is simulated again, and a warning says so. The
    numbers depend neither on the number of workers nor on interruptions.

    Parameters
    ----------
    given : Study, str or path
        As for :func:`load_study`.
    out : str or path
        Folder of the results, see :class:`StudyResult`. It may hold a part of this very study, and nothing else.
    launches : int, optional
        At least so many; what the study says by default. Saltelli's scheme takes a power of two times the number of
        parameters plus two.
    workers : int, optional
        Processes, all cores by default; of a cluster all that it has.
    ray : str, optional
        Address of a Ray cluster whose nodes share the folder, "local" to start one here.
    progress : bool
        Show a bar on standard error.

    Raises
    ------
    StudyError
        If the study is not valid, or the folder holds launches of another; nothing is simulated then.
    OSError
        If the folder holds anything else or cannot be written.
    ImportError
        If Ray is asked for and missing.
    """
    one = given if isinstance(given, Study) else load_study(given)
    if not isinstance(out, str | os.PathLike):
        raise TypeError(f"out = {out!r}: must be the path of a folder")
    shown = checked_flag("progress", progress)
    if launches is not None:
        one = one.model_copy(update={"launches": checked_count("launches", launches)})
    run = runner(None if workers is None else checked_count("workers", workers), ray)
    folder = Path(out).resolve()  # a worker of a cluster may work elsewhere
    check_free(folder, os.fspath(out), {*FILES, *(entry.name for entry in folder.glob(".*"))})
    drawn = draws(one)
    one.check_bodies(one.values(drawn))
    files = _simulate(one, drawn, folder, out, run, shown)
    tables = _tables(one, files)
    result = StudyResult(one, folder, len(drawn), files, **tables)
    for name, table in tables.items():
        with replacing(folder / f"{name}.parquet", ".parquet") as part:
            table.to_parquet(part, index=False)
        with replacing(folder / f"{name}.csv", ".csv") as part:
            table.to_csv(part, index=False)
    pictures = {}
    for name, figure in (("envelopes", plot_envelopes(result)), ("sobol", plot_sobol(result))):
        with replacing(folder / f"{name}.png", ".png") as part:
            figure.savefig(part, dpi=_DPI, format="png")
            pictures[name] = part.read_bytes()
    with replacing(folder / "study.html", ".html") as part:
        part.write_text(result.page(pictures), encoding="utf-8")
    with replacing(folder / "study.yaml", ".yaml") as part:
        write_yaml(part, one.model_dump(mode="json"))
    return result


def launches_of(one: Study) -> int:
    """Return how many launches a study takes: at least as many as it says, a power of two of Saltelli's groups."""
    group = len(one.parameters) + 2
    return group << max((-(-one.launches // group) - 1).bit_length(), 0)


def draws(one: Study) -> NDArray[np.float64]:
    """Return the draws in (0, 1) of a study, shape (groups * (parameters + 2), parameters), by Saltelli's scheme.

    A group are a point of Sobol's scrambled sequence, another, and the first with each of its entries taken from the
    other. More launches are the same ones and others after them.
    """
    count, launches = len(one.parameters), launches_of(one)
    check_room(launches * count * _NUMBER, f"launches = {launches}: their draws", "take fewer")
    groups = launches // (count + 2)
    problem = {"num_vars": count, "names": list(one.parameters), "bounds": [[0.0, 1.0]] * count}
    sample = sobol.sample(problem, groups, calc_second_order=False, seed=one.seed)
    return np.asarray(sample + EDGE, dtype=np.float64)  # neither 0 nor 1


def _simulate(
    one: Study,
    drawn: NDArray[np.float64],
    folder: Path,
    out: str | os.PathLike[str],
    run: Runner,
    progress: bool,
) -> tuple[Path, ...]:
    """Simulate what has not been yet, and return the files of all blocks."""
    parts = [np.ascontiguousarray(part) for part in np.split(drawn, _cuts(len(drawn), len(one.parameters) + 2))]
    place = folder / _LAUNCHES
    files = tuple(place / f"{i:05d}-{_digest(one, part)}.parquet" for i, part in enumerate(parts))
    foreign = sorted({path.name for path in place.glob("[!.]*")} - {path.name for path in files})
    if foreign:
        raise StudyError(
            f"{out} holds {_LAUNCHES}/{foreign[0]}, which is of another study, of more launches or of other physics: "
            "choose another folder, or remove it"
        )
    place.mkdir(parents=True, exist_ok=True)
    missing = [
        (file, part) for file, part in zip(files, parts, strict=True) if read_checksummed(file, "simulating") is None
    ]
    LIBRARY.ready()  # made once, if it must be, and not by every worker
    calls: list[Call] = [(_write_block, (one, part, file)) for file, part in missing]
    done = len(drawn) - sum(len(part) for _, part in missing)
    bar = tqdm(total=len(drawn), initial=done, desc=one.id, unit=" launches", unit_scale=True, disable=not progress)
    with bar:
        for count in run(calls):
            bar.update(count)
    return files


def _cuts(launches: int, group: int) -> list[int]:
    """Return where all blocks but the last end: at powers of two of groups, until blocks are as large as they may be.

    Launches are a power of two of groups. So blocks of fewer launches are blocks of more.
    """
    cuts, most = [group], max(BLOCK, group)
    while cuts[-1] < launches:
        cuts.append(cuts[-1] + min(cuts[-1], group << ((most // group).bit_length() - 1)))
    return cuts[:-1]


def _digest(one: Study, part: NDArray[np.float64]) -> str:
    """Digest of all that the launches of a block depend on."""
    return hashlib.sha256(one.key.encode() + part.tobytes()).hexdigest()[:12]


def _write_block(one: Study, part: NDArray[np.float64], file: Path) -> int:
    write_checksummed(_frame(one, part), file)
    return len(part)


def _frame(one: Study, part: NDArray[np.float64]) -> pd.DataFrame:
    """Simulate a block; return a row per launch."""
    values = one.values(part)
    given = one.scenes(values), one.stations, one.base.settings(one.solver)
    found = descend_past(*given, one.base.all_bodies()) if one.terrain is None else descend_over(*given)
    outcomes = found.outcomes
    columns: dict[str, Any] = dict(zip(one.parameters, values.T, strict=True))
    statuses, codes, stops = [str(status) for status in STATUS_OF_CODE], outcomes["status"].astype(int), outcomes["x"]
    if one.terrain is not None:
        codes = np.where(found.left_backwards, len(statuses), codes)
        stops = np.where(found.left_backwards, 0.0, stops)
        statuses.append(summary.LEFT_BACKWARDS)
    columns["status"] = pd.Categorical.from_codes(codes, statuses)
    columns |= {"stop_m": stops, "time_s": outcomes["t"], "rebounds": outcomes["rebounds"]}
    columns |= {"speed_m_s": np.hypot(outcomes["u"], outcomes["v"]), "kinetic_j": outcomes["kinetic"]}
    columns |= found.jam._asdict() | {f"lost_{name}_j": outcomes[name] for name in LOSSES}
    for k in range(len(one.stations)):
        columns |= {f"{name}_{k}": passing[:, k] for name, passing in found.columns.items()}
    return pd.DataFrame(columns)


def _tables(one: Study, files: tuple[Path, ...]) -> dict[str, pd.DataFrame]:
    """Make the tables of a study out of its blocks; the names are those of ``_TABLES``."""
    group = len(one.parameters) + 2
    ends = read_launches(files, ["status", *summary.OUTPUTS])
    passing = PASSING if one.terrain is not None else PASSING[:2]
    envelopes = []
    for k, x in enumerate(one.stations.tolist()):
        there = read_launches(files, [f"{name}_{k}" for name in passing]).set_axis(passing, axis=1)
        row = summary.envelope(x, ends, there, group, one.heights_m)
        elevation = {} if one.terrain is None else {"z_m": float(np.interp(x, *one.terrain.points.T))}
        envelopes.append({"x_m": x} | elevation | row)
    return {
        "shares": summary.shares(ends["status"], group),
        "quantiles": summary.quantiles(ends),
        "stops": summary.stops(ends["stop_m"], group),
        "envelopes": pd.DataFrame(envelopes),
        "sobol": summary.indices(summary.analysed(ends), list(one.parameters), one.seed),
    }
