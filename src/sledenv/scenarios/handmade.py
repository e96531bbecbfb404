"""Tracks made by hand: ground with a name, on which any ride can be ridden and none is trained."""

from __future__ import annotations

import os
from typing import Annotated, ClassVar, Self

from pydantic import model_validator

from sledenv.scenarios.configuration import Document, Pair, Points, Quantity
from sledenv.scenarios.sections import check_vertices
from sledenv.simulation.bends import MOST_VERTICES


class TrackError(ValueError):
    """A track that does not exist or is not valid; one line of the message for each problem."""


class Track(Document):
    """Vertices over the plane of a slope, from its start to its finish; the ground is level before and behind them.

    The keys are those of the YAML file. :meth:`sledenv.scenarios.Scenario.on` puts a sled on it.
    """

    called: ClassVar[str] = "track"
    folder: ClassVar[str] = "tracks"
    error: ClassVar[type[ValueError]] = TrackError

    description: str  # what it is, and what it asks
    length_m: Annotated[float, Quantity("(0, inf) m")]
    profile_m: Annotated[tuple[Pair, ...], Points("(-inf, inf) m", 2, MOST_VERTICES)]

    @model_validator(mode="after")
    def _between_start_and_finish(self) -> Self:
        try:
            check_vertices(self.profile_m)
        except ValueError as problem:
            raise ValueError(f"profile_m: {problem}") from None
        for k in (0, -1):
            x = self.profile_m[k][0]
            if not 0.0 <= x <= self.length_m:
                vertex = k % len(self.profile_m)
                allowed = f"must be in [0, length_m] = [0, {self.length_m:g}] m"
                raise ValueError(f"profile_m: x of vertex {vertex} is {x:g}: {allowed}")
        return self


def track_names() -> tuple[str, ...]:
    """Return the names of the tracks that ship, sorted."""
    return Track.names()


def load_track(name_or_path: str | os.PathLike[str]) -> Track:
    """Read a track.

    Parameters
    ----------
    name_or_path : str or path
        A name out of ``track_names()``, or the path of a file that ends in ``.yaml``.

    Returns
    -------
    Track
        Validated.

    Raises
    ------
    TrackError
        If there is no such track, or naming every wrong key of the file, its value and what is allowed.

    Examples
    --------
    >>> from sledenv.scenarios import load_track, track_names
    >>> len(track_names())
    12
    >>> load_track("whoops")
    Track('whoops', 'Whoops')
    """
    return Track.load(name_or_path)
