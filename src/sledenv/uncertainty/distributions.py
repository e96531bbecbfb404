"""Distributions that a study can give to a number, those of scipy.stats."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator
from scipy import stats

from sledenv.scenarios.configuration import Quantity, Section
from sledenv.scenarios.tracks import TRACKS

Number = Annotated[float, Quantity("(-inf, inf)")]
Positive = Annotated[float, Quantity("(0, inf)")]

EDGE: Final = 2.0**-31  # how near to 0 or 1 a draw may come: half a cell of Sobol's sequence in scipy


class Distribution(Section):
    """A distribution, in the unit of the key that it stands at."""

    kind: str

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        low, high = getattr(self, "low", -np.inf), getattr(self, "high", np.inf)
        mode = getattr(self, "mode", low)
        if not low < high:
            raise ValueError(f"low = {low:g}: must be below high = {high:g}")
        if not low <= mode <= high:
            raise ValueError(f"mode = {mode:g}: must be in [low, high] = [{low:g}, {high:g}]")
        return self

    @property
    def _scipy(self) -> Any:
        raise NotImplementedError

    def at(self, draws: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values below which shares ``draws`` of all lie, each in (0, 1); same shape."""
        with np.errstate(over="ignore"):  # inf is no number that a key accepts
            values = np.asarray(self._scipy.ppf(draws), dtype=np.float64)
        return np.clip(values, getattr(self, "low", -np.inf), getattr(self, "high", np.inf))  # rounding

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest value that can be drawn."""
        low, high = self.at(np.array([EDGE, 1.0 - EDGE])).tolist()
        return low, high

    def outside(self, low: float, high: float) -> float:
        """Return the share of values below ``low`` or above ``high``."""
        with np.errstate(over="ignore"):
            return float(self._scipy.cdf(low) + self._scipy.sf(high))

    @property
    def words(self) -> str:
        """The distribution as its file has it."""
        given = self.model_dump(exclude={"kind"}).items()
        return f"{self.kind}, {', '.join(f'{key} {value:g}' for key, value in given)}"


class Uniform(Distribution):
    """Every value between two is as likely."""

    kind: Literal["uniform"]
    low: Number
    high: Number

    @property
    def _scipy(self) -> Any:
        return stats.uniform(self.low, self.high - self.low)


class Normal(Distribution):
    """The normal distribution."""

    kind: Literal["normal"]
    mean: Number
    sd: Positive  # standard deviation

    @property
    def _scipy(self) -> Any:
        return stats.norm(self.mean, self.sd)


class TruncatedNormal(Distribution):
    """The normal distribution of a mean and a standard deviation, of which what lies between two values is kept."""

    kind: Literal["truncated_normal"]
    mean: Number
    sd: Positive
    low: Number
    high: Number

    @property
    def _scipy(self) -> Any:
        low, high = (self.low - self.mean) / self.sd, (self.high - self.mean) / self.sd
        return stats.truncnorm(low, high, self.mean, self.sd)


class Lognormal(Distribution):
    """Values whose logarithm is normal."""

    kind: Literal["lognormal"]
    median: Positive
    log_sd: Positive  # standard deviation of the natural logarithm

    @property
    def _scipy(self) -> Any:
        return stats.lognorm(self.log_sd, scale=self.median)


class Triangular(Distribution):
    """A density that rises from ``low`` to ``mode`` and falls to ``high``, along straight lines."""

    kind: Literal["triangular"]
    low: Number
    mode: Number
    high: Number

    @property
    def _scipy(self) -> Any:
        width = self.high - self.low
        return stats.triang((self.mode - self.low) / width, self.low, width)


class TrackNumber(Distribution):
    """Every number that draws the bumps of a track is as likely: what a scenario with bumps leaves to a study."""

    kind: Literal["track"] = "track"

    @property
    def _scipy(self) -> Any:
        return stats.randint(0, TRACKS)


KINDS: Final[dict[str, type[Distribution]]] = {
    get_args(kind.model_fields["kind"].annotation)[0]: kind
    for kind in (Uniform, Normal, TruncatedNormal, Lognormal, Triangular)
}
