"""The result of a study: its tables, and the files that its launches are read from."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from html import escape
from pathlib import Path

import pandas as pd

from sledenv.pages.html import filled
from sledenv.uncertainty import summary
from sledenv.uncertainty.model import Study


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Findings of a study; all of it is also in its folder.

    Attributes
    ----------
    study : Study
    folder : Path
    launches : int
        How many there are.
    files : tuple of Path
        A Parquet file per block, in order: a row per launch.
    shares : DataFrame
        How descents end: ``status``, ``share`` and its interval of 95 %, ``low`` and ``high``.
    quantiles : DataFrame
        Of each output of a descent: ``mean``, and the quantiles ``q05``, ``q25``, ``q50``, ``q75``, ``q95``.
    stops : DataFrame
        Within which place ``x_m`` a ``share`` of all bodies end, with its interval of 95 %, ``low_m`` and ``high_m``.
    envelopes : DataFrame
        A row for each distance ``x_m`` along the slope: shares of launches, with their intervals, and quantiles and the
        largest value, ``most``, of the speed and of the kinetic energy of those that come there. Over a hillside also
        of ``bounce_m`` and ``centre_m``, heights over the ground of the lowest point and of the mass centre, and
        ``z_m``, the elevation of the ground there.
    sobol : DataFrame
        A row for each output and parameter: first order and total index, each with the half-width of its interval of
        95 %.
    """

    study: Study
    folder: Path
    launches: int
    files: tuple[Path, ...]
    shares: pd.DataFrame
    quantiles: pd.DataFrame
    stops: pd.DataFrame
    envelopes: pd.DataFrame
    sobol: pd.DataFrame

    def read(self, columns: list[str] | None = None) -> pd.DataFrame:
        """Return a row per launch: parameters, status, outputs; speed and energy at stations, NaN if never there."""
        return read_launches(self.files, columns)

    @property
    def answer(self) -> str:
        """The answer in a line: how descents end, and within which place."""
        return summary.answer(self.shares, self.stops)

    @property
    def words(self) -> str:
        """Tables for a reader."""
        return summary.words(self.shares, self.quantiles, self.stops, self.envelopes, self.sobol)

    def page(self, pictures: dict[str, bytes]) -> str:
        """Return the page of the study: its tables, and its pictures in the format PNG, by name."""
        names = "shares", "stops", "envelopes", "quantiles", "sobol"
        return filled(
            "study.html",
            study=self.study,
            launches=self.launches,
            tables={name: getattr(self, name) for name in names},
            pictures={name: base64.b64encode(picture).decode() for name, picture in pictures.items()},
        )

    def _repr_html_(self) -> str:
        """Return what a notebook shows: :attr:`words`."""
        return f"<pre>{escape(self.words)}</pre>"


def read_launches(files: tuple[Path, ...], columns: list[str] | None = None) -> pd.DataFrame:
    """Return columns of blocks, all by default, one after the other."""
    return pd.concat([pd.read_parquet(file, columns=columns) for file in files], ignore_index=True)
