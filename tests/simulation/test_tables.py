"""Tables that users give: columns by name, and what is refused. Oracle: the rows that they were made of, the docs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pytest

import sledenv
from sledenv.simulation.rules import checked_table
from sledenv.simulation.scene import ContactLaw, Slope, State

BODY, LAW, SLOPE = sledenv.segment(1.0, 0.1, 0.05, 0.0075, 2.0), ContactLaw(1e5, 0.5, 0.1, 1e-3), Slope(0.2, 20.0)
LAUNCHES = np.array([[0.0, 0.5, 0.1, 6.0, -1.0, 0.5], [0.0, 0.6, 0.2, 5.0, -2.0, 0.0], [1.0, 0.7, 0.3, 4.0, 0.0, 1.0]])
FRAME = pd.DataFrame(LAUNCHES, columns=State._fields)
OTHER = ["u", "omega", "y", "x", "v", "phi"]


class Mixed(NamedTuple):
    """A launch whose fields stand in another order."""

    y: float
    x: float
    phi: float
    u: float
    v: float
    omega: float


def test_columns_of_a_frame_are_taken_by_name() -> None:
    """Oracle: the array that the frame was made of, whatever the order of its columns."""
    assert checked_table("launches", FRAME[OTHER], State._fields).tobytes() == LAUNCHES.tobytes()
    assert checked_table("launches", FRAME[OTHER].iloc[1], State._fields).tolist() == [LAUNCHES[1].tolist()]
    batch = sledenv.simulate_batch(BODY, LAW, SLOPE, FRAME[OTHER])
    assert batch.outcomes.tobytes() == sledenv.simulate_batch(BODY, LAW, SLOPE, LAUNCHES).outcomes.tobytes()


def test_laws_slopes_and_bodies_may_be_frames_too() -> None:
    """Oracle: the same rows as arrays."""
    laws, slopes = np.tile(LAW, (3, 1)), np.tile([*SLOPE[:3], 0.0, 5.0, 0.2, 1e-3, 0.0, np.nan, np.nan], (3, 1))
    bodies = np.tile([1.0, 0.1, 0.05, 0.0075, 2.0], (3, 1))
    zone = [f"zones[0].{name}" for name in sledenv.Zone._fields]
    columns = sledenv.Segment.fields[:-1], ContactLaw._fields, (*Slope._fields[:3], *zone)
    frames = [
        pd.DataFrame(rows, columns=names).iloc[:, ::-1]
        for rows, names in zip((bodies, laws, slopes), columns, strict=True)
    ]
    one, other = (sledenv.simulate_batch(*given, LAUNCHES) for given in ((bodies, laws, slopes), frames))
    assert one.outcomes.tobytes() == other.outcomes.tobytes()


def test_arrays_may_lie_in_memory_as_they_like_and_stay_as_they_are(tmp_path: Path) -> None:
    """As reported in https://github.com/sktime/sktime/issues/3582, of the read-only arrays that joblib hands out."""
    launches = LAUNCHES + np.array([0.0, 0.0, 2.0 * np.pi, 0.0, 0.0, 0.0])  # whole turns are taken off, in a copy
    np.save(tmp_path / "launches.npy", launches)
    laws = np.tile(LAW, (3, 1))
    sealed = launches.copy()
    sealed.setflags(write=False)
    expected = sledenv.simulate_batch(BODY, LAW, SLOPE, launches.tolist()).outcomes.tobytes()
    for given in (
        *(launches, sealed, np.load(tmp_path / "launches.npy", mmap_mode="r"), np.asfortranarray(launches)),
        *(np.repeat(launches, 2, axis=0)[::2], launches[::-1].copy()[::-1], launches.astype(">f8")),
    ):
        assert sledenv.simulate_batch(BODY, laws, SLOPE, given).outcomes.tobytes() == expected
        rides = sledenv.RideBatch(BODY, laws, SLOPE, given)
        rides.launch(np.array([0, 1]), LAW._replace(friction=0.5), SLOPE, given[1:])
        assert (given == launches).all()
        assert (laws == LAW).all()


def test_a_masked_number_is_no_number() -> None:
    """Oracle: the documented error, as for NaN."""
    for masked in (np.ma.masked, np.ma.array(3.0, mask=True)):
        with pytest.raises(TypeError, match=r"(?s)^State\.u = masked.*: must be a number, a finite number$"):
            State(0.0, 0.5, 0.1, masked)


@pytest.mark.parametrize(
    ("launches", "error", "message"),
    [
        (FRAME.rename(columns={"u": "speed"}), ValueError, "launches has the column 'speed': must have the columns x,"),
        (FRAME[OTHER[:5]], ValueError, "launches has no column 'phi': must have the columns x, y, phi"),
        (FRAME[[*OTHER, "u"]], ValueError, "launches has the column 'u' more than once"),
        (FRAME.astype({"v": str}), TypeError, "launches.v holds "),
        (FRAME.assign(v=FRAME["v"] > -1.0), TypeError, "launches.v holds True or False: must hold numbers"),
        (FRAME.assign(v=[0.0, np.nan, 0.0]), ValueError, "launches[1].v = nan: must be a finite number"),
        ([row for _, row in FRAME.iterrows()], TypeError, "launches holds a Series: must be one DataFrame"),
        ([Mixed(0.5, 0.0, 0.1, 6.0, -1.0, 0.5)], TypeError, "launches holds a Mixed of y, x, phi, u, v, omega: must"),
        (np.ma.masked_less(LAUNCHES, -1.5), TypeError, "launches is a masked array, or holds one"),
        ([np.ma.masked_less(row, -1.5) for row in LAUNCHES], TypeError, "launches is a masked array, or holds one"),
        ([[0.0, 0.5, 0.1, np.ma.masked, 0.0, 0.0]], TypeError, "launches is a masked array, or holds one"),
        (np.where(LAUNCHES == 5.0, np.inf, LAUNCHES), ValueError, "launches[1].u = inf: must be a finite number"),
    ],
)
def test_what_is_no_table_of_launches_is_refused_by_name(launches: Any, error: type[Exception], message: str) -> None:
    """Oracle: the documented errors."""
    with pytest.raises(error, match=re.escape(message)):
        sledenv.simulate_batch(BODY, LAW, SLOPE, launches)
