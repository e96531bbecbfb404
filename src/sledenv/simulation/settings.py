"""How a descent is simulated."""

from __future__ import annotations

import math
from typing import ClassVar, Self

from sledenv.kernel import params
from sledenv.simulation.rules import CLOSED_FRACTION, POSITIVE, Rule, checked_fields

_INTERVAL: Rule = (lambda v: (v >= 1e-12) & (v < math.inf), "in [1e-12, inf) s")
TOLERANCE = 1e-14  # default of Limits
_TOLERANCE: Rule = (lambda v: (v >= 1e-18) & (v <= 1e-3), "in [1e-18, 1e-3]")


class Limits(params.Limits):
    """Where a simulation stops and how finely it is integrated and sampled."""

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (
        POSITIVE,
        POSITIVE,
        _TOLERANCE,
        _INTERVAL,
        POSITIVE,
        CLOSED_FRACTION,
        POSITIVE,
        CLOSED_FRACTION,
        POSITIVE,
    )

    def __new__(
        cls,
        max_time: float = 60.0,
        max_steps: float = 1e6,
        tolerance: float = TOLERANCE,
        sample_interval: float = 0.01,
        step: float = 2.5e-7,
        printed_sign: float = 0.0,
        max_rebounds: float = 1000.0,
        end_on_chord: float = 0.0,
        most_work: float = 1e18,
    ) -> Self:
        limits = (max_time, max_steps, tolerance, sample_interval, step, printed_sign, max_rebounds, end_on_chord)
        return super().__new__(cls, *checked_fields(cls, *limits, most_work))
