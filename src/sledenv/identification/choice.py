"""A contact law from a table of rebounds or from tracks, whichever it is: :func:`identify`."""

from __future__ import annotations

import os
from typing import Any

import pandas as pd

from sledenv.identification.rebound_fit import Identification
from sledenv.identification.rebound_fit import identify as identify_rebounds
from sledenv.identification.rebounds import AFTER, ARMS, BEFORE, TOUCHDOWN
from sledenv.identification.recordings import POSE, TIME
from sledenv.identification.tables import listed, read_table
from sledenv.identification.tracks import TrackFit, identify_tracks
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import Slope


def holds_tracks(table: pd.DataFrame) -> bool:
    """Whether a table holds poses over time, by its columns; of rebounds otherwise.

    Raises
    ------
    ValueError
        If it has some of the columns of poses only, and none of rebounds.
    """
    missing = [name for name in (TIME, *POSE) if name not in table.columns]
    begun = any(name in table.columns for name in (TIME, *POSE[:2]))
    if missing and begun and not any(name in table.columns for name in (*BEFORE, *AFTER, *ARMS, TOUCHDOWN)):
        raise ValueError(
            f"{missing[0]}: there is no such column; poses over time need {', '.join((TIME, *POSE))}, and the table "
            f"has {listed(table)}"
        )
    return not missing


def identify(
    table: pd.DataFrame | str | os.PathLike[str], body: Body | None = None, slope: Slope | None = None, **settings: Any
) -> Identification | TrackFit:
    """Fit a contact law to what was recorded of one body: to its rebounds, or to its poses over time.

    Parameters
    ----------
    table : DataFrame or path
        A CSV or Parquet file if a path. With the columns ``t_s``, ``x_m``, ``y_m`` and ``phi_rad`` it holds poses over
        time, see :func:`sledenv.identification.tracks.identify_tracks`; otherwise velocities before and after
        rebounds, one a row, see :func:`sledenv.identification.rebound_fit.identify`.
    body : Body
        What was recorded; a table of rebounds may be told by arms and a ``gyration_radius`` instead.
    slope : Slope
        Where poses were recorded; velocities before and after rebounds do not need it.
    **settings
        Those of the function named above.

    Returns
    -------
    Identification or TrackFit

    Raises
    ------
    TypeError, ValueError
        Naming the column, row or argument, its value and what is allowed.
    OSError
        If the file cannot be read.
    """
    if not isinstance(table, pd.DataFrame):
        table = read_table(table)
    if not holds_tracks(table):
        if slope is not None:
            needed = ", ".join((TIME, *POSE))
            raise ValueError(f"slope = {slope!r}: a table of rebounds does not need it; poses over time need {needed}")
        return identify_rebounds(table, body, **settings)
    if body is None or slope is None:
        raise ValueError(f"{'body' if body is None else 'slope'}: poses over time need it")
    return identify_tracks(table, body, slope, **settings)
