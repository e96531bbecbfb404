"""Profile intervals: how far a parameter may go until the least cost with it held has risen too far."""

from __future__ import annotations

from typing import NamedTuple

from scipy.optimize import brentq

from sledenv.identification.minimisation import minimise
from sledenv.identification.objective import Floats, Parameter, Problem

_REACH = 1e-6  # of a step's scale: how exactly the end of an interval is found
_LOWER = 1e-2  # of the rise that an interval allows: a fall of a cost that is more than unfinished minimisation


class Interval(NamedTuple):
    """Values that the data do not contradict; an end on a bound of the parameter is not a result of the data."""

    low: float
    high: float
    level: float
    low_on_bound: bool
    high_on_bound: bool

    @property
    def note(self) -> str:
        """Which of its ends are bounds, in words; "" if none is."""
        ends = (("low", self.low_on_bound), ("high", self.high_on_bound))
        return ", ".join(f"{end} end is its bound" for end, on_bound in ends if on_bound)


class LocalMinimumError(RuntimeError):
    """A fit turns out to be no global minimum.

    Attributes
    ----------
    values : dict
        Of all parameters, where the cost is lower.
    """

    def __init__(self, name: str, cost: float, lower: float, values: dict[str, float]) -> None:
        super().__init__(f"{name} = {values[name]:.6g}: the cost is {lower:.6g}, below {cost:.6g} of the fit")
        self.values = values


def profile_end(problem: Problem, values: Floats, cost: float, one: Parameter, step: float, allowed: float) -> float:
    """Return the value of a parameter at which the profiled cost has risen by what is allowed, or its bound.

    Parameters
    ----------
    problem : Problem
    values, cost
        Its minimum.
    one : Parameter
        That the cost is profiled along.
    step : float
        The first step away from the minimum; negative to look for the lower end.
    allowed : float
        Rise of the cost, > 0.

    Raises
    ------
    LocalMinimumError
        If a lower cost appears on the way.
    """
    bound = one.high if step > 0.0 else one.low
    at = float(values[problem.names.index(one.name)])
    known = {at: (-allowed, values)}  # by its value: rise of the cost over what is allowed, all values

    def rise(value: float) -> float:
        if value not in known:
            near = known[min(known, key=lambda other: abs(other - value))][1]
            held = problem.holding({one.name: value})
            found = minimise(held, near)
            if found.cost > cost + allowed:  # where the cost is rough, one start may miss the least
                found = min(found, minimise(held, values), key=lambda minimum: minimum.cost)
            known[value] = found.cost - cost - allowed, found.values
            if found.cost < cost - _LOWER * allowed:
                raise LocalMinimumError(one.name, cost, found.cost, problem.named(found.values))
        return known[value][0]

    inside = at
    while inside != bound:
        outside = min(max(inside + step, one.low), one.high)
        if rise(outside) > 0.0:
            return float(brentq(rise, inside, outside, xtol=_REACH * abs(outside - at), rtol=1e-8))
        inside = outside
        step *= 1.6
    return bound
