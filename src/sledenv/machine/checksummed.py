"""Tables kept as Parquet files that tell whether they are as they were left: each has a digest of all that it holds."""

from __future__ import annotations

import hashlib
import json
import logging
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sledenv.machine.files import replacing

if TYPE_CHECKING:
    import pandas as pd

_DIGEST: Final = "digest"
_log = logging.getLogger("sledenv")


def write_checksummed(table: pd.DataFrame, file: Path) -> None:
    """Write a table in one move, with a digest of its columns, of ``table.attrs`` and of the name of the file.

    Parameters
    ----------
    table : DataFrame
        Columns of numbers, flags and texts; its index is not kept. ``attrs`` is what JSON can hold.
    file : Path
        That ends in .parquet.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    checksummed = table.copy(deep=False)
    checksummed.attrs = table.attrs | {_DIGEST: _digest(table, file.name)}
    with replacing(file, ".parquet") as part:
        checksummed.to_parquet(part, index=False)


def read_checksummed(file: Path, doing: str) -> pd.DataFrame | None:
    """Read a table that :func:`write_checksummed` has written.

    Parameters
    ----------
    file : Path
    doing : str
        What is done again where this returns None, such as "judging": a warning says so where there is a file.

    Returns
    -------
    DataFrame or None
        None if there is no such file, or if it is not as it was left: damaged, edited or renamed.
    """
    import pandas as pd

    try:
        table = pd.read_parquet(file)
        digest = table.attrs.pop(_DIGEST, None)
        if digest == _digest(table, file.name):
            return table
    except FileNotFoundError:
        return None
    except Exception:  # damage can raise whatever pyarrow and pandas know, KeyError and TypeError too
        pass
    _log.warning("sledenv: %s again, because it is not as it was left: %s", doing, file)
    return None


def _digest(table: pd.DataFrame, name: str) -> str:
    """Return a digest of the values of a table, whatever Parquet makes of its types."""
    from pandas.util import hash_pandas_object

    found = hashlib.sha256(json.dumps([name, table.attrs, list(table.columns)], sort_keys=True).encode())
    # Parquet keeps no sign of a NaN, which pandas 2.2 hashes.
    plain = {name: table[name].where(table[name].notna()) for name in table.select_dtypes("floating")}
    found.update(hash_pandas_object(table.assign(**plain), index=False).to_numpy().tobytes())
    return found.hexdigest()
