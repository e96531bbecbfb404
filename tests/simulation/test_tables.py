"""Tables that users give: columns by name, and what is refused. Oracle: the rows that they were made of, the docs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

import sledenv
from sledenv.simulation.rules import checked_table
from sledenv.simulation.scene import ContactLaw, Slope, State

BODY, LAW, SLOPE = sledenv.segment(1.0, 0.1, 0.05, 0.0075, 2.0), ContactLaw(1e5, 0.5, 0.1, 1e-3), Slope(0.2, 20.0)
LAUNCHES = np.array([[0.0, 0.5, 0.1, 6.0, -1.0, 0.5], [0.0, 0.6, 0.2, 5.0, -2.0, 0.0], [1.0, 0.7, 0.3, 4.0, 0.0, 1.0]])
FRAME = pd.DataFrame(LAUNCHES, columns=State._fields)
OTHER = ["u", "omega", "y", "x", "v", "phi"]


def test_columns_of_a_frame_are_taken_by_name() -> None:
    """Oracle: the array that the frame was made of, whatever the order of its columns."""
    assert checked_table("launches", FRAME[OTHER], State._fields).tobytes() == LAUNCHES.tobytes()
    assert checked_table("launches", FRAME[OTHER].iloc[1], State._fields).tolist() == [LAUNCHES[1].tolist()]


def test_laws_slopes_bodies_and_launches_may_be_frames() -> None:
    """Oracle: the same rows as arrays."""
    laws, slopes = np.tile(LAW, (3, 1)), np.tile([*SLOPE[:3], 0.0, 5.0, 0.2, 1e-3, 0.0, np.nan, np.nan], (3, 1))
    tables = np.tile([1.0, 0.1, 0.05, 0.0075, 2.0], (3, 1)), laws, slopes, LAUNCHES
    zone = [f"zones[0].{name}" for name in sledenv.Zone._fields]
    names = sledenv.bodies.Segment.fields[:-1], ContactLaw._fields, (*Slope._fields[:3], *zone), State._fields
    frames = [pd.DataFrame(*given).iloc[:, ::-1] for given in zip(tables, [None] * 4, names, strict=True)]
    one, other = (sledenv.simulate_batch(*given) for given in (tables, frames))
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
        rides = sledenv.simulation.RideBatch(BODY, laws, SLOPE, given)
        rides.launch(np.array([0, 1]), LAW._replace(friction=0.5), SLOPE, given[1:])
        assert (given == launches).all()
        assert (laws == LAW).all()
