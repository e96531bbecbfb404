"""Tables as :func:`sledenv.identify` reads them, of what was recorded or simulated; errors name column and row."""

from __future__ import annotations

import csv
import os
import reprlib
from collections.abc import Hashable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from sledenv.identification.fitting import Floats
from sledenv.machine.files import check_regular
from sledenv.machine.text_tables import check_quotes
from sledenv.pages.columns import rebound_columns, rebound_rows, trajectory_columns
from sledenv.simulation.bodies import Body, made_body
from sledenv.simulation.outcomes import Descent, DescentBatch
from sledenv.simulation.scene import State

RECORDING: Final = "recording"  # column that tells recordings apart
LARGEST: Final = 1e9  # of m, m/s, rad and rad/s: nothing is recorded beyond, and no square of it overflows
_HEADER: Final = 100_000  # characters of a first line, at most
_MOST_BYTES: Final = 2**30
_SHOWN: Final = 12  # names of columns in a message
_LINE: Final = "line"  # index of a table read from text: the lines of the file, which count its header and from 1
_ROW: Final = "row"  # of any other table: its rows, counted from 0


def read_table(place: str | os.PathLike[str]) -> pd.DataFrame:
    """Read a CSV or Parquet file, or raise OSError or ValueError."""
    if not isinstance(place, str | os.PathLike):
        raise TypeError(f"table = {place!r}: must be a DataFrame or the path of a file")
    file = Path(place)
    kind = file.suffix.lower()
    if kind not in (".csv", ".parquet"):
        raise ValueError(f"{file}: must end in .csv or .parquet")
    try:
        check_regular(file, _MOST_BYTES)
        return _read_csv(file) if kind == ".csv" else pd.read_parquet(file)
    except OSError as error:
        raise OSError(f"{file} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ValueError(f"{file} is no table: must be text in UTF-8, but byte {error.start + 1} is not") from error
    except ValueError as error:  # of pandas and of pyarrow, whose errors are this one as well
        raise ValueError(f"{file} is no table: {error}") from error


def _read_csv(file: Path) -> pd.DataFrame:
    with file.open("rb") as text:
        if len(text.readline(_HEADER + 1)) > _HEADER:
            raise ValueError(f"its first line has more than {_HEADER} characters: it must name the columns")
    named = 0
    with file.open(encoding="utf-8-sig") as lines:
        for number, line in enumerate(lines, 1):
            check_quotes(line, number)
            cells = len(next(csv.reader([line]))) if '"' in line else line.count(",") + 1
            named = named or cells
            if cells > named > 1:  # of which pandas would make an index
                raise ValueError(f"line {number}: has {cells} values: must have {named}, as many as its first line")
    table = pd.read_csv(file, skip_blank_lines=False, skipinitialspace=True)
    header = pd.read_csv(file, header=None, nrows=1, dtype=str, skip_blank_lines=False, skipinitialspace=True)
    if header.shape[1] == table.shape[1]:  # pandas numbers names that are there twice
        table.columns = header.iloc[0].fillna("").str.strip()
    if str(table.columns[0]).startswith("#"):
        raise ValueError(
            f"its first line is {str(table.columns[0])!r}: must name the columns; comments are not skipped"
        )
    if len(table.columns) == 1:  # as spreadsheets write them where the comma is the decimal sign
        for sign, name in ((";", "semicolons"), ("\t", "tabs")):
            if sign in str(table.columns[0]):
                raise ValueError(f"{name} separate its columns: commas must, and numbers have a decimal point")
    table.index = pd.RangeIndex(2, len(table) + 2, name=_LINE)
    return table.dropna(how="all")  # blank lines count as lines


def numbered(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose index tells where its rows are, whatever is taken of it afterwards: see :func:`place`."""
    return table if table.index.name == _LINE else table.reset_index(drop=True).rename_axis(_ROW)


def place(table: pd.DataFrame, row: int) -> str:
    """Return where a row of a numbered table is: "line 6" of a file, or "row 4" of other tables."""
    return f"{table.index.name} {table.index[row]}"


def recorded_names(table: pd.DataFrame) -> pd.Series | None:
    """Return the names of the recordings of the rows of a numbered table, None if there is no such column.

    Raises
    ------
    ValueError
        Naming the row where there is none, or something that is no name.
    """
    if RECORDING not in table:
        return None
    names = _only(table, RECORDING)
    for row, name in enumerate(names):
        if not isinstance(name, Hashable):
            raise ValueError(f"{RECORDING}, {place(table, row)}: is {name!r}, must be a text or a number")
        if pd.isna(name):
            raise ValueError(f"{RECORDING}, {place(table, row)}: there is no value, must name the recording")
    return names


def _only(table: pd.DataFrame, name: str) -> pd.Series:
    """Return the column of a name, or raise ValueError if it is there twice."""
    found = table.loc[:, table.columns == name]
    if found.shape[1] > 1:
        raise ValueError(f"{name}: there are {found.shape[1]} columns of this name, must be one")
    return found.iloc[:, 0]


def numbers(table: pd.DataFrame, name: str) -> Floats:
    """Return a column as floats of usual size, NaN where there is nothing, or raise ValueError naming row and value."""
    if name not in table:
        raise ValueError(f"{name}: there is no such column{_alike(name, table)}")
    column = _only(table, name)
    kinds = pd.api.types
    text = kinds.is_object_dtype(column) or kinds.is_string_dtype(column)
    found = pd.to_numeric(column, errors="coerce") if text else column
    if kinds.is_bool_dtype(found) or kinds.is_complex_dtype(found) or not kinds.is_numeric_dtype(found):
        raise ValueError(f"{name}: must be numbers, is of the type {found.dtype}")
    wrong = (found.isna() & column.notna()).to_numpy()
    if wrong.any():
        row = int(np.argmax(wrong))
        value = reprlib.repr(column.iloc[row])
        raise ValueError(f"{name}, {place(table, row)}: is {value}, must be a number, with a decimal point")
    floats: Floats = found.to_numpy(float, na_value=np.nan)
    beyond = np.abs(floats) > LARGEST
    if beyond.any():
        row = int(np.argmax(beyond))
        raise ValueError(f"{name}, {place(table, row)}: is {floats[row]:g}, must be in [-{LARGEST:g}, {LARGEST:g}]")
    return floats


def columns(table: pd.DataFrame, names: tuple[str, ...]) -> Floats:
    """Return columns as finite floats, shape (N, names), or raise ValueError naming column, row and value."""
    found = np.stack([numbers(table, name) for name in names], axis=-1)
    if np.isnan(found).any():
        row, column = np.argwhere(np.isnan(found))[0].tolist()
        raise ValueError(f"{names[column]}, {place(table, row)}: is nan, must be a finite number")
    return found


def _alike(name: str, table: pd.DataFrame) -> str:
    """Say what the table has in place of a column: the same quantity without its unit or in another one."""
    stem = name.removesuffix("_rad_s").removesuffix("_m_s").removesuffix("_rad").removesuffix("_m")
    near = [str(other) for other in table.columns if str(other) == stem or str(other).startswith(f"{stem}_")]
    if near:
        return f", but {near[0]}: a column is named with its unit, and this one must be in that of {name}"
    return f"; the table has {listed(table)}"


def listed(table: pd.DataFrame) -> str:
    """Return the names of the columns of a table, of many the first."""
    more = f" and {len(table.columns) - _SHOWN} more" if len(table.columns) > _SHOWN else ""
    return ", ".join(map(reprlib.repr, table.columns[:_SHOWN])) + more


def recorded_rebounds(
    found: Descent | Sequence[Descent] | DescentBatch, body: Body | None = None, launches: ArrayLike | None = None
) -> pd.DataFrame:
    """Return the table of the rebounds of what was simulated, which :func:`sledenv.identify` reads.

    It has the columns of ``sledenv simulate --rebounds-csv``, and ``recording``, the number of the descent. Contacts
    that last are in it, ``duration_s`` [s], and one in which a descent ended: leave these out of a fit of impacts.

    Parameters
    ----------
    found : Descent, sequence of Descent, or DescentBatch
        A batch must have been simulated with ``keep_rebounds=True``.
    body, launches : Body, array_like of shape (N, 6)
        What a batch was simulated with; a descent knows its own.

    Returns
    -------
    DataFrame
        One row a contact; ``to_csv(file, index=False)`` writes it.

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and what is allowed.
    """
    if isinstance(found, DescentBatch):
        return _joined(_of_batch(found, body, launches))
    if body is not None or launches is not None:
        name, value = ("body", body) if body is not None else ("launches", launches)
        raise ValueError(f"{name} = {value!r}: must be given with a batch only; a Descent knows its own")
    return _joined([rebound_columns(one) for one in _descents(found)])


def recorded_poses(found: Descent | Sequence[Descent]) -> pd.DataFrame:
    """Return the table of poses over time of what was simulated, which :func:`sledenv.identify` reads.

    It has the columns of ``sledenv simulate --csv``, and ``recording``, the number of the descent.

    Parameters
    ----------
    found : Descent or sequence of Descent
        Simulated with ``record="trajectory"``.

    Returns
    -------
    DataFrame
        One row a sample; ``to_csv(file, index=False)`` writes it.

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and what is allowed.
    """
    descents = _descents(found)
    for number, one in enumerate(descents):
        if not len(one.trajectory):
            raise ValueError(f'found, descent {number}: has no trajectory: simulate it with record="trajectory"')
    return _joined([trajectory_columns(one) for one in descents])


def _descents(found: Descent | Sequence[Descent]) -> Sequence[Descent]:
    several = [found] if isinstance(found, Descent) else found
    if not isinstance(several, Sequence) or not all(isinstance(one, Descent) for one in several):
        raise TypeError(f"found is of the type {type(found).__name__}: must be a Descent or a sequence of them")
    if not several:
        raise ValueError(f"found = {found!r}: must hold at least one Descent")
    return several


def _of_batch(batch: DescentBatch, body: Body | None, launches: ArrayLike | None) -> list[dict[str, list[Any]]]:
    if body is None or launches is None:
        raise ValueError(
            f"{'body' if body is None else 'launches'}: must be given with a batch, which does not keep it"
        )
    body = made_body(body)
    lanes, given = len(batch.outcomes), np.asarray(launches, float)
    if given.shape != (lanes, len(State._fields)):
        raise ValueError(
            f"launches: is of shape {given.shape}, must be that of the batch, {(lanes, len(State._fields))}"
        )
    if batch.rebounds.shape[0] != lanes:
        raise ValueError("found: has no rebounds: simulate the batch with keep_rebounds=True")
    counts, phi = batch.outcomes["rebounds"], given[:, State._fields.index("phi")]
    return [rebound_rows(batch.rebounds[k, : counts[k]], body, float(phi[k])) for k in range(lanes)]


def _joined(parts: list[dict[str, list[Any]]]) -> pd.DataFrame:
    """One table of all, with the numbers of the recordings; a column that only some have is empty in the others."""
    lengths = [len(next(iter(part.values()))) for part in parts]
    names = max(parts, key=len)
    whole = {
        name: [cell for part, length in zip(parts, lengths, strict=True) for cell in part.get(name, [None] * length)]
        for name in names
    }
    return pd.DataFrame({RECORDING: np.repeat(np.arange(len(parts)), lengths), **whole})
