"""Tables of what was recorded: read from a file, their columns as numbers; errors name column, row and value."""

from __future__ import annotations

import os
import reprlib
from collections.abc import Hashable
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd

from sledenv.identification.objective import Floats

RECORDING: Final = "recording"  # column that tells recordings apart
LARGEST: Final = 1e9  # of m, m/s, rad and rad/s: nothing is recorded beyond, and no square of it overflows
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
        return _read_csv(file) if kind == ".csv" else pd.read_parquet(file)
    except OSError as error:
        raise OSError(f"{file} cannot be read: {error.strerror or error}") from error
    except ValueError as error:  # of pandas and of pyarrow, whose errors are this one as well
        raise ValueError(f"{file} is no table: {error}") from error


def _read_csv(file: Path) -> pd.DataFrame:
    table = pd.read_csv(file, skip_blank_lines=False)
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
    """Return what the rows of a numbered table say which recording they are of, None if there is no such column.

    Raises
    ------
    ValueError
        Naming the row where there is none, or something that is no name.
    """
    if RECORDING not in table:
        return None
    names = table[RECORDING]
    for row, name in enumerate(names):
        if not isinstance(name, Hashable):
            raise ValueError(f"{RECORDING}, {place(table, row)}: is {name!r}, must be a text or a number")
        if pd.isna(name):
            raise ValueError(f"{RECORDING}, {place(table, row)}: there is no value, must name the recording")
    return names


def numbers(table: pd.DataFrame, name: str) -> Floats:
    """Return a column as floats of usual size, NaN where there is nothing, or raise ValueError naming row and value."""
    column = table[name]
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
    beyond = np.isfinite(floats) & (np.abs(floats) > LARGEST)
    if beyond.any():
        row = int(np.argmax(beyond))
        raise ValueError(f"{name}, {place(table, row)}: is {floats[row]:g}, must be in [-{LARGEST:g}, {LARGEST:g}]")
    return floats


def columns(table: pd.DataFrame, names: tuple[str, ...]) -> Floats:
    """Return columns as finite floats, shape (N, names), or raise ValueError naming column, row and value."""
    for name in names:
        if name not in table:
            raise ValueError(f"{name}: there is no such column{_alike(name, table)}")
    found = np.stack([numbers(table, name) for name in names], axis=-1)
    if not np.isfinite(found).all():
        row, column = (int(place[0]) for place in np.nonzero(~np.isfinite(found)))
        where = f"{names[column]}, {place(table, row)}"
        raise ValueError(f"{where}: is {found[row, column]}, must be a finite number")
    return found


def _alike(name: str, table: pd.DataFrame) -> str:
    """What the table has in place of a column: the same quantity without its unit or in another one."""
    stem = name.removesuffix("_rad_s").removesuffix("_m_s").removesuffix("_rad").removesuffix("_m")
    near = [str(other) for other in table.columns if str(other) == stem or str(other).startswith(f"{stem}_")]
    if near:
        return f", but {near[0]}: a column is named with its unit, and this one must be in that of {name}"
    return f"; the table has {', '.join(map(str, table.columns))}"
