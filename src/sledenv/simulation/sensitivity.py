"""How a descent changes with its launch, law, slope and body, and how far away its events change."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.ground import MOST_ZONES
from sledenv.simulation.bodies import Body, Segment, holds_its_mass_centre, made_body, segment, segment_records
from sledenv.simulation.checks import has_sharp_corner
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.jam import SHOWN, DescentJam, Shown
from sledenv.simulation.outcomes import Descent, DescentBatch
from sledenv.simulation.rules import (
    CLOSED_FRACTION,
    NOT_NEGATIVE,
    POSITIVE,
    RESTITUTION,
    checked_choice,
    checked_count,
    made,
    or_absent,
)
from sledenv.simulation.scene import (
    ContactLaw,
    Slope,
    SlopeTable,
    State,
    Zone,
    asymmetry_of,
    misplaced_zones,
    sharp_crests,
)
from sledenv.simulation.settings import Settings, checked_settings
from sledenv.simulation.simulate import simulate, simulate_blocks
from sledenv.simulation.support import resting_heights, within_a_turn

Floats = NDArray[np.float64]

LAUNCH: Final = State._fields
OF_ZONE: Final = dict(zip(Zone._fields, ("m", "m", "", "m", "m", "", "N/m"), strict=True))
PARAMETERS: Final = {
    **dict(zip(LAUNCH, ("m", "m", "rad", "m/s", "m/s", "rad/s"), strict=True)),
    "restitution": "",
    "friction": "",
    "rolling_arm": "m",
    "corner_rolling_arm": "m",
    "stiffness": "N/m",
    "angle": "rad",
    "length": "m",
    "gravity": "m/s^2",
    "air_density": "kg/m^3",
    "mass": "kg",
    "radius": "m",
    "eccentricity": "m",
    "inertia": "kg m^2",
    "half_angle": "rad",
    "drag_area": "m^2",
    # Of the zones of the slope, counted from 1.
    **{f"zone_{k}_{name}": unit for k in range(1, MOST_ZONES + 1) for name, unit in OF_ZONE.items()},
}
REBOUND_QUANTITIES: Final = {  # fields of REBOUND
    "t_touchdown": "s",
    "x_contact": "m",
    "u_before": "m/s",
    "v_before": "m/s",
    "omega_before": "rad/s",
    "t": "s",
    "x": "m",
    "phi": "rad",
    "u_after": "m/s",
    "v_after": "m/s",
    "omega_after": "rad/s",
}
STATE_AFTER: Final = ("x", "phi", "u_after", "v_after", "omega_after")  # y follows from phi: the body touches
END_QUANTITIES: Final = {
    "t": "s",
    **{name: PARAMETERS[name] for name in LAUNCH},
    **{name: SHOWN.get(name, Shown()).unit for name in DescentJam._fields},
}
_ORDERS = 7  # times that differences are extrapolated
_ROUNDING = 4.0 * np.finfo(float).eps
SIGNS = np.array([-1.0, 1.0])  # of what the two directions do to a parameter
_STEPS = 2.0 ** -np.arange(33.0)  # of the scale of a parameter: changes that are looked at
_COLUMN = {name: i for i, name in enumerate(PARAMETERS)}
_RESTITUTION = _COLUMN["restitution"]
_SLOPE = (*Slope.rules, NOT_NEGATIVE)  # rules of angle, length, gravity and air density
_SECTIONS = (6, 11, 15, 21)  # columns of launch, law, slope, body and zones: where the next begins
_TO_THE_LAST_BIT = 64  # bisections
_BLOCK_RECORDS = 1 << 17  # of rebounds, kept at a time
_BISECTIONS = 24
_FAR = 1e-3  # of a derivative: by less the difference over the smallest step is another, if the derivative exists
_NOISE = 1e-11  # of a quantity, from one descent to the next
_OF_SEGMENTS = ("radius", "eccentricity", "half_angle")


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Derivatives of a descent with respect to ``parameters``, of which there are P.

    Derivatives hold as long as the sequence of events stays: what touches, what slips, sticks, turns, closes and opens
    in each contact, in order, and how the descent ends. ``sides`` and ``distances`` tell how long that is.

    At an end of the range that a parameter is allowed, such as a rolling arm or a friction of 0 and a restitution of 1,
    the descent itself may have events of its own: with any arm a spin that turns is one, without it is none. There the
    sequence that counts is that of the nearest neighbour, if as many rebounds of the same parts of the body lead to the
    same kind of end, and if differences to the descent vanish in proportion to the step. Where they do not, as those of
    a jump, the derivative is NaN.

    Attributes
    ----------
    descent : Descent
        The one that is looked at.
    parameters : tuple of str
        Names; their units are in ``PARAMETERS``.
    values, scales : ndarray, shape (P,)
        Values of the parameters, and the farthest change of each that was looked at.
    rebounds, rebound_errors : ndarray, shape (N, 11, P)
        Derivatives of what is in ``REBOUND_QUANTITIES`` at the first N rebounds, and the estimated error of each.
    end, end_errors : ndarray, shape (Q, P)
        The same of the Q in ``END_QUANTITIES`` when the descent has ended.
    sides : ndarray of int, shape (N + 1, P)
        0 where a derivative holds to both sides, as far as each rebound and in the end (the last row). 1 or -1 where it
        holds for more or for less of the parameter alone: to the other side another sequence of events, or what is not
        allowed, begins at once. 0 too where it holds to neither; the derivative is then NaN.
    distances : ndarray, shape (N + 1, P, 2)
        How much less and how much more each parameter may be until the sequence of events changes in one of the
        rebounds up to this one, and in the whole descent (the last row). inf if it does not within ``scales`` and the
        range that the parameter is allowed; 0 if it does within 2^-32 of ``scales``. Known to 1e-7 of themselves. They
        are sought at distances that are halved again and again: a sequence that is back before twice the distance at
        which it was left may be missed.
    """

    descent: Descent
    parameters: tuple[str, ...]
    values: Floats
    scales: Floats
    rebounds: Floats
    rebound_errors: Floats
    end: Floats
    end_errors: Floats
    sides: NDArray[np.int64]
    distances: Floats

    def __repr__(self) -> str:
        of = f"{len(self.rebounds)} rebounds and the end, {self.descent.status}"
        return f"Sensitivity(of {of}; by {', '.join(self.parameters)})"

    def of_rebounds(self, quantity: str, parameter: str) -> Floats:
        """Derivative of a quantity at each rebound, shape (N,), such as ``of_rebounds("omega_after", "friction")``."""
        checked_choice("quantity", quantity, tuple(REBOUND_QUANTITIES))
        return self.rebounds[:, list(REBOUND_QUANTITIES).index(quantity), self._place(parameter)]

    def of_end(self, quantity: str, parameter: str) -> float:
        """Derivative of a quantity at the end of the descent, such as ``of_end("reward", "phi")``."""
        checked_choice("quantity", quantity, tuple(END_QUANTITIES))
        return float(self.end[list(END_QUANTITIES).index(quantity), self._place(parameter)])

    @property
    def growth(self) -> Floats:
        """Singular values of the derivative of the state after each rebound by the launch, shape (N, 5).

        The largest comes first: by so much a small difference of the launch may have grown. Differences are made
        comparable by :attr:`units`. NaN where a derivative is.

        Raises
        ------
        ValueError
            If a field of the launch is not among the parameters.
        """
        columns = [self._place(name) for name in LAUNCH]
        rows = [list(REBOUND_QUANTITIES).index(name) for name in STATE_AFTER]
        scale = self.units
        after = np.array([scale[LAUNCH.index(name.removesuffix("_after"))] for name in STATE_AFTER])
        matrices = self.rebounds[:, rows][:, :, columns] * scale / after[:, np.newaxis]
        known = np.isfinite(matrices).all(axis=(1, 2))
        values = np.full(matrices.shape[:2], np.nan)
        values[known] = np.linalg.svd(matrices[known], compute_uv=False)
        return values

    @property
    def units(self) -> Floats:
        """Natural units of x, y, phi, u, v and omega, shape (6,).

        They follow from the size of the body and the square root of gravity times size; without gravity from the speed.
        """
        return natural_units(self.descent.body, self.descent.slope, self.descent.launch)

    def _place(self, parameter: str) -> int:
        checked_choice("parameter", parameter, self.parameters)
        return self.parameters.index(parameter)


def natural_units(body: Body, slope: Slope, launch: State) -> Floats:
    """Units of x, y, phi, u, v and omega that suit a body."""
    size = body.size or 1.0
    speed = math.sqrt(slope.gravity * size) or math.hypot(launch.u, launch.v, size * launch.omega) or 1.0
    return np.array([size, size, 1.0, speed, speed, speed / size])


# Differences over smaller and smaller steps, extrapolated (Richardson); ends of what holds, bisected.


def derivatives_of(here: Floats, there: Floats, fine: NDArray[np.bool_], steps: Floats) -> tuple[Floats, Floats]:
    """Derivatives of Q quantities, and their errors, shapes (Q, P).

    Parameters
    ----------
    here : ndarray, shape (Q,)
        The quantities of the descent that is looked at,
    there : ndarray, shape (P * 2 * K, Q)
        and of each lane.
    fine : ndarray of bool, shape (P, 2, K)
        Which lanes count.
    steps : ndarray, shape (P, 2, K)
        How much the parameter of a lane is less, or more.
    """
    moved = np.moveaxis((there - here).reshape(*steps.shape, -1), -1, 0)  # (Q, P, 2, K)
    below, above = np.moveaxis(np.where(fine, moved, np.nan), 2, 0)
    less, more = np.moveaxis(steps, 1, 0)
    widths = np.stack([more + less, more, less])[:, np.newaxis]  # (3, 1, P, K)
    differences = np.stack([above - below, above, -below]) / widths
    rounding = _ROUNDING * np.abs(here)[:, np.newaxis, np.newaxis] / widths
    return _extrapolated(differences, rounding, np.array([4.0, 2.0, 2.0])[:, np.newaxis, np.newaxis, np.newaxis])


def continues(
    here: Floats, there: Floats, fine: NDArray[np.bool_], steps: Floats, derivatives: Floats, units: Floats
) -> NDArray[np.bool_]:
    """Whether differences vanish with the step, and in proportion to it, shape (P,).

    Of a jump or of a root the difference over the smallest step is far from all that is extrapolated.

    Parameters
    ----------
    here, there, fine, steps, derivatives
        As for :func:`derivatives_of`, and what it has found.
    units : ndarray, shape (Q,)
        Small amounts of the quantities, which make them comparable.
    """
    units, smallest = np.maximum(units, np.abs(here)), steps[..., -1]
    moved = (there - here).reshape(*steps.shape, -1)[:, :, -1]  # (P, 2, Q)
    apart = np.abs(moved / (SIGNS * smallest)[..., np.newaxis] - derivatives.T[:, np.newaxis])
    allowed = _FAR * (np.abs(derivatives.T) / units).max(axis=-1)[:, np.newaxis] + _NOISE / smallest
    near = (apart / units).max(axis=-1) <= allowed
    return np.asarray((near | ~fine[..., -1]).all(axis=-1))


def _extrapolated(column: Floats, rounding: Floats, ratios: Floats) -> tuple[Floats, Floats]:
    """Best of the estimates that follow from differences over smaller and smaller steps, and their errors.

    Parameters
    ----------
    column : ndarray, shape (kinds, Q, P, K)
        Differences of several kinds over steps that are halved each time.
    rounding : ndarray, shape (kinds, Q, P, K)
        Their rounding errors.
    ratios : ndarray, shape (kinds, 1, 1, 1)
        Of the leading errors of two steps in a row; those of each further term are so much larger.
    """
    best, least = np.full(column.shape[1:3], np.nan), np.full(column.shape[1:3], np.inf)
    for order in range(1, _ORDERS + 1):
        coarse, fine = column[..., :-1], column[..., 1:]
        column = fine + (fine - coarse) / (ratios**order - 1.0)
        errors = np.maximum(np.abs(column - fine), np.abs(column - coarse)) + rounding[..., order:]
        for values, of_kind in zip(column, np.where(np.isnan(errors), np.inf, errors), strict=True):
            at = of_kind.argmin(axis=-1)[..., np.newaxis]
            error, value = (np.take_along_axis(table, at, -1)[..., 0] for table in (of_kind, values))
            best, least = np.where(error < least, value, best), np.minimum(error, least)
    return best, np.where(np.isnan(best), np.nan, least)


def bracket(steps: Floats, fine: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Largest step that is fine, or 0, and smallest that is not, or inf, of the last axis, on which steps shrink."""
    bad = fine.shape[-1] - np.count_nonzero(fine, axis=-1, keepdims=True)  # so many come first
    low = np.take_along_axis(np.append(steps, np.zeros((*steps.shape[:-1], 1)), axis=-1), bad, -1)
    high = np.where(bad > 0, np.take_along_axis(steps, np.maximum(bad - 1, 0), -1), np.inf)
    return low[..., 0], high[..., 0]


def least_of_smaller(values: NDArray[Any]) -> NDArray[Any]:
    """Least of the values at each step and at all smaller ones, of the last axis, on which steps shrink."""
    return np.minimum.accumulate(values[..., ::-1], axis=-1)[..., ::-1]


def bisected(
    low: Floats, high: Floats, holds: Callable[[Floats], NDArray[np.bool_]], times: int
) -> tuple[Floats, Floats]:
    """Halve brackets, shape (N,), so that ``holds`` is true at the low ends and false at the high ones."""
    for _ in range(times):
        middle = 0.5 * (low + high)
        fine = holds(middle)
        low, high = np.where(fine, middle, low), np.where(fine, high, middle)
    return low, high


# The descents around one, each of which differs from it in one parameter.


class Course(NamedTuple):
    """The events of N descents."""

    rebounds: NDArray[np.int64]  # (N, rebounds, 3) feature, mode and sequence of each; -1 of those that there are not
    ways: NDArray[np.int64]  # (N, 4) status, number of rebounds, and on which side of its kinks the reward is

    def of(self, which: NDArray[Any] | slice) -> Self:
        """Return the events of some of the descents."""
        return type(self)(*(events[which] for events in self))

    def in_outline(self) -> Self:
        """Return what touches in each rebound, and how each descent ends."""
        return type(self)(self.rebounds[..., :1], self.ways[:, :2])


class Runs(NamedTuple):
    """Results of N descents that differ in one parameter."""

    agreed: NDArray[np.int64]  # (N,) rebounds before the first that has not the events that count; one more if all
    rebounds: Floats  # (N, rebounds, quantities)
    end: Floats  # (N, quantities)


class Neighbours:
    """The descents around one, each of which differs from it in one parameter.

    Attributes
    ----------
    descent : Descent
        The one that is looked at.
    names : tuple of str
        The P parameters.
    values, scales : ndarray, shape (P,)
        Their values, and the farthest change of each that is looked at.
    steps : ndarray, shape (P, 2, K)
        Changes that are looked at, to both sides, each half of the one before.
    course : Course
        Of each parameter the events that count: those of the descent, or after :meth:`heed_ends` of a neighbour.
    """

    def __init__(self, descent: Descent, names: tuple[str, ...], settings: Settings) -> None:
        law = descent.law
        self.descent, self.names, self.settings = descent, names, settings
        self.columns = np.array([_COLUMN[name] for name in names])
        of_law = (law.restitution, law.friction, law.rolling_arm, law.corner_rolling_arm, law.stiffness)
        incline, zones = descent.slope.incline, [number for zone in descent.slope.zones for number in zone.row]
        self.centre = np.array([*descent.launch, *of_law, *incline, *self._of_body(), *zones])
        self.values = self.centre[self.columns]
        self.crests = bool(sharp_crests(descent.slope.vertices).any())  # over which no radius may vanish
        scales = self._scales()
        self.scales = np.array([scales[name] for name in names])
        self.steps = np.tile(self.scales[:, np.newaxis, np.newaxis] * _STEPS, (1, 2, 1))
        self.count = len(descent.rebounds)
        self.course = course_of(descent.as_batch(), self.count).of(np.zeros(len(names), np.intp))

    def _of_body(self) -> tuple[float, ...]:
        """Fields of a segment; of any other body NaN where it has none."""
        body = self.descent.body
        if isinstance(body, Segment):
            return body.mass, body.radius, body.eccentricity, body.inertia, body.half_angle, body.drag_area
        return body.mass, np.nan, np.nan, body.inertia, np.nan, body.drag_area

    def records(self, bodies: Floats) -> np.ndarray:
        """Records that the kernel reads of bodies, given the rows of :meth:`tables`."""
        if isinstance(self.descent.body, Segment):
            return segment_records(bodies)
        records = np.tile(self.descent.body.record, len(bodies))
        records["mass"], records["inertia"], records["drag_area"] = bodies[:, 0], bodies[:, 3], bodies[:, 5]
        records["per_mass"], records["per_inertia"] = 1.0 / bodies[:, 0], 1.0 / bodies[:, 3]
        return records

    def bodies(self, rows: Floats) -> np.ndarray | list[Body]:
        """Bodies of the rows of :meth:`tables`: records alone do not know the names of their parts."""
        if self.settings.end_touching is None:
            return self.records(rows)
        body = self.descent.body
        if isinstance(body, Segment):
            return [segment(*row) for row in rows.tolist()]
        return [body.replace(mass=m, inertia=inertia, drag_area=area) for m, _, _, inertia, _, area in rows.tolist()]

    def _scales(self) -> dict[str, float]:
        """How much of each parameter is a great change: what is always positive need not vanish."""
        descent = self.descent
        natural = natural_units(descent.body, descent.slope, descent.launch)
        rates = np.maximum(natural, np.abs(descent.launch))[3:]
        zone, there = {name: natural[0] if unit else 1.0 for name, unit in OF_ZONE.items()}, len(descent.slope.zones)
        zones = [(f"zone_{k}_{name}", scale) for k in range(1, there + 1) for name, scale in zone.items()]
        halves = ["stiffness", "length", "gravity", "air_density", "mass", "inertia", "drag_area"]
        halves += ["radius"] if self.crests else []
        halves += [f"zone_{k}_stiffness" for k in range(1, there + 1)]
        return {
            **dict(zip(LAUNCH, [*natural[:3], max(rates[:2]), max(rates[:2]), rates[2]], strict=True)),
            **dict.fromkeys(("restitution", "friction", "angle", "half_angle"), 1.0),
            **dict.fromkeys(("rolling_arm", "corner_rolling_arm", "radius", "eccentricity"), natural[0]),
            **dict(zones),
            **{name: 0.5 * self.centre[_COLUMN[name]] or 1.0 for name in halves},
        }

    def units(self, kept: int) -> list[Floats]:
        """Natural units of the quantities of each rebound and of the end."""
        size, _, _, speed, _, spin = natural_units(self.descent.body, self.descent.slope, self.descent.launch)
        known = {"m": size, "s": size / speed, "m/s": speed, "rad/s": spin}
        tables = [REBOUND_QUANTITIES] * kept + [END_QUANTITIES]
        return [np.array([known.get(unit, 1.0) for unit in table.values()]) for table in tables]

    def rounded(self, steps: Floats) -> Floats:
        """Steps as the values of the parameters change by them."""
        values, signs = self.values[:, np.newaxis, np.newaxis], SIGNS[:, np.newaxis]
        moved: Floats = signs * ((values + signs * steps) - values)
        return moved

    def tables(self, which: NDArray[np.int64], changes: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Rows of bodies, laws, slopes and launches that differ by a change of one parameter each."""
        rows = np.tile(self.centre, (len(changes), 1))
        rows[np.arange(len(changes)), self.columns[which]] += changes
        launches, of_law, slopes, bodies, zones = np.split(rows, _SECTIONS, axis=1)
        restitution, friction, arm, corner_arm, stiffness = of_law.T
        own = restitution == self.centre[_RESTITUTION]
        asymmetry = np.where(own, self.descent.law.asymmetry, asymmetry_of(restitution))
        laws = np.stack([stiffness, asymmetry, friction, arm, corner_arm], axis=-1)
        return bodies, laws, np.hstack([slopes, zones]), launches

    def allowed(self, which: NDArray[np.int64], changes: Floats) -> NDArray[np.bool_]:
        """Whether a simulation would take each of these changes."""
        bodies, laws, slopes, launches = self.tables(which, changes)
        restitution = self.centre[_RESTITUTION] + np.where(self.columns[which] == _RESTITUTION, changes, 0.0)
        bounce = CLOSED_FRACTION if self.settings.solver == "rigid" else RESTITUTION
        fine: NDArray[np.bool_] = bounce[0](restitution) & (launches[:, 0] < slopes[:, 1])
        segments = isinstance(self.descent.body, Segment)
        for rules, rows in ((Segment.rules, bodies), (ContactLaw.rules, laws), (_SLOPE, slopes)):
            for (accepts, _), column in zip(rules, rows.T, strict=False):  # zones come behind a slope
                fine &= accepts(column) | (np.isnan(column) & (rules is Segment.rules and not segments))
        zones = slopes[:, len(_SLOPE) :].reshape(len(slopes), len(self.descent.slope.zones), len(OF_ZONE))
        of_zone = (*Zone.rules, or_absent(bounce), or_absent(POSITIVE))
        for (accepts, _), column in zip(of_zone, np.moveaxis(zones, 2, 0), strict=True):
            fine &= accepts(column).all(axis=1)
        for one in misplaced_zones(np.moveaxis(zones[:, :, :2], 0, 2), slopes[:, 1]):
            fine &= ~one.wrong
        if segments:
            fine &= np.array([holds_its_mass_centre(r, h, alpha) for _, r, h, _, alpha, _ in bodies.tolist()], bool)
        found = np.flatnonzero(fine)
        records, slope = self.records(bodies[found]), self.descent.slope
        ground, lanes = Grounds.of((slope.vertices,)), np.arange(float(len(found)))
        heights = resting_heights(records, launches[found, 0], within_a_turn(launches[found, 2]), ground, lanes)
        fine[found] = launches[found, 1] >= heights
        fine[found] &= ~(self.crests & has_sharp_corner(records))
        return fine

    def room(self) -> Floats:
        """How far each parameter may be changed to either side, shape (P, 2); inf if by its scale."""
        allowed = self.allowed(*places(self.steps)).reshape(self.steps.shape)
        low, high = bracket(self.steps, least_of_smaller(allowed))
        bounded = np.isfinite(high)
        index, side = np.nonzero(bounded)
        found = np.full(bounded.shape, np.inf)
        found[bounded], _ = bisected(
            low[bounded], high[bounded], lambda middle: self.allowed(index, SIGNS[side] * middle), _TO_THE_LAST_BIT
        )
        return found

    def heed_ends(self, room: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Let the events of the nearest neighbour count where a parameter is at an end of its range, and has others.

        Parameters
        ----------
        room : ndarray, shape (P, 2)
            How far each parameter may be changed.

        Returns
        -------
        ndarray of int, ndarray of int, shapes (P,)
            Of what counts: rebounds before the first that has not the events of the descent, and before the first that
            touches with another part; one more if there is none, and if it ends as the descent does.
        """
        alike, shared = np.full((2, len(self.names)), self.count + 1)
        free = self.steps[..., -1] < room
        ends = np.flatnonzero(free.sum(axis=1) == 1)
        if len(ends):
            side = free[ends].argmax(axis=1)
            batches = self._batches(ends, SIGNS[side] * self.steps[ends, side, -1])
            rebounds, ways = zip(*(course_of(batch, self.count) for _, batch in batches), strict=True)
            nearest, own = Course(np.concatenate(rebounds), np.concatenate(ways)), self.course.of(ends)
            alike[ends], shared[ends] = agreed_of(nearest, own), agreed_of(nearest.in_outline(), own.in_outline())
            for events, theirs in zip(self.course, nearest, strict=True):
                events[ends] = theirs
        return alike, shared

    def _batches(self, which: NDArray[np.int64], changes: Floats) -> Iterator[tuple[slice, DescentBatch]]:
        """Simulate descents that differ by a change of one parameter each, block by block."""
        bodies, laws, slopes, launches = self.tables(which, changes)
        block = max(_BLOCK_RECORDS // self.settings.max_rebounds, 1)
        table = SlopeTable(slopes, self.descent.slope.ground)
        blocks = simulate_blocks(self.bodies(bodies), laws, table, launches, self.settings, block=block)
        for begin, batch in zip(range(0, len(changes), block), blocks, strict=True):
            yield slice(begin, begin + block), batch

    def run(self, which: NDArray[np.int64], changes: Floats, kept: int) -> Runs:
        """Simulate descents that differ by a change of one parameter each."""
        parts = []
        for lanes, batch in self._batches(which, changes):
            agreed = agreed_of(course_of(batch, self.count), self.course.of(which[lanes]))
            parts.append((agreed, rebound_values(batch.rebounds[:, :kept]), end_values(batch)))
        runs = Runs(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
        launches = self.tables(which, changes)[-1]
        turned = launches[:, 2] - within_a_turn(launches[:, 2])  # whole turns that simulations take off
        runs.rebounds[:, :, list(REBOUND_QUANTITIES).index("phi")] += turned[:, np.newaxis]
        runs.end[:, list(END_QUANTITIES).index("phi")] += turned
        return runs


def course_of(batch: DescentBatch, count: int) -> Course:
    """Events of descents, as far as ``count`` rebounds."""
    progress = batch.jam.progress
    kinks = (progress > 0.0).astype(int) + (progress < 1.0), batch.jam.retention > 0.0
    ways = np.stack([batch.outcomes["status"], batch.outcomes["rebounds"], *kinks], axis=-1)
    log, found = batch.rebounds[:, :count], np.arange(count) < batch.outcomes["rebounds"][:, np.newaxis]
    events = np.stack([log[name] for name in ("feature", "mode", "sequence")], axis=-1)
    return Course(np.where(found[..., np.newaxis], events, -1), ways)


def agreed_of(one: Course, other: Course) -> NDArray[np.int64]:
    """Number of leading rebounds with the same events, shape (N,); one more if all else agrees."""
    same = (one.rebounds == other.rebounds).all(axis=-1)
    leading = np.cumprod(same, axis=1).sum(axis=1)
    ends = (one.ways == other.ways).all(axis=1)
    agreed: NDArray[np.int64] = leading + (ends & (leading == same.shape[1]))
    return agreed


def rebound_values(records: np.ndarray) -> Floats:
    """Quantities of rebounds, on a new last axis."""
    table: Floats = np.stack([records[name] for name in REBOUND_QUANTITIES], axis=-1)
    return table


def end_values(batch: DescentBatch) -> Floats:
    """Quantities at the end of descents, shape (N, 10)."""
    table: Floats = np.column_stack([batch.time, batch.states, *batch.jam])
    return table


def places(steps: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Which parameter each of the steps of shape (P, 2, K) changes, and by how much, shapes (P * 2 * K,)."""
    which = np.broadcast_to(np.arange(len(steps))[:, np.newaxis, np.newaxis], steps.shape)
    return which.ravel(), (steps * SIGNS[:, np.newaxis]).ravel()


def sensitivity(
    body: Body,
    law: ContactLaw,
    slope: Slope,
    launch: State,
    settings: Settings | None = None,
    *,
    parameters: Sequence[str] | None = None,
    rebounds: int = 10,
) -> Sensitivity:
    """Differentiate a descent with respect to its launch, law, slope and body.

    Derivatives are differences of exact descents that are simulated as one batch: central and one-sided ones over steps
    that are halved again and again, extrapolated (Richardson). Of all estimates the one with the smallest estimated
    error counts, as in C. Ridders, Advances in Engineering Software 4 (1982). A step counts for a rebound only if up to
    there the descents of this and of all smaller steps go through the same events.

    Parameters
    ----------
    body, law, slope, launch
        As for :func:`sledenv.simulate`.
    settings : Settings, optional
        How it is simulated; the default ones otherwise.
    parameters : sequence of str, optional
        Which, of ``sledenv.simulation.sensitivity.PARAMETERS``; by default all that play a part. All others stay as
        they are while one is varied: ``y`` and ``phi`` with the radius, the mean stiffness with the restitution.
    rebounds : int
        How many to look at, from the first one, >= 1.

    Returns
    -------
    Sensitivity

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range; nothing is simulated then.
    """
    rebounds = checked_count("rebounds", rebounds)
    settings = checked_settings(settings)
    body, law, slope = made_body(body), made("law", ContactLaw, law), made("slope", Slope, slope)
    names = _checked_parameters(parameters, body, slope, settings.solver)
    descent = simulate(body, law, slope, launch, settings)
    # A neighbour with more rebounds has another sequence; how it goes on does not matter.
    settings = replace(settings, max_rebounds=min(settings.max_rebounds, len(descent.rebounds) + 1))
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):  # where a descent is not finite
        return _differentiated(Neighbours(descent, names, settings), min(rebounds, len(descent.rebounds)))


def _differentiated(neighbours: Neighbours, kept: int) -> Sensitivity:
    """Derivatives of the first rebounds, and of the end."""
    descent, room = neighbours.descent, neighbours.room()
    alike, shared = neighbours.heed_ends(room)
    room = room[..., np.newaxis]
    steps = np.minimum(neighbours.steps, room)
    runs = neighbours.run(*places(steps), kept)
    agreed = least_of_smaller(np.minimum(runs.agreed.reshape(steps.shape), shared[:, np.newaxis, np.newaxis]))
    needed = [*range(kept), neighbours.count]
    here = [*rebound_values(descent.rebounds[:kept]), *end_values(descent.as_batch())]
    there = [*np.moveaxis(runs.rebounds, 1, 0), runs.end]
    taken, allowed = neighbours.rounded(steps), steps < room  # a step that a bound has cut short is none
    fine, values, errors = [], [], []
    for count, one, lanes, units in zip(needed, here, there, neighbours.units(kept), strict=True):
        holds = (agreed > count) & allowed
        derivatives, doubts = derivatives_of(one, lanes, holds, taken)
        jumps = (alike <= count) & ~continues(one, lanes, holds, taken, derivatives, units)
        agreed[jumps] = np.minimum(agreed[jumps], count)
        holds[jumps], derivatives[:, jumps], doubts[:, jumps] = False, np.nan, np.nan
        fine.append(holds)
        values.append(derivatives)
        errors.append(doubts)
    closed = (alike <= neighbours.count)[:, np.newaxis, np.newaxis] & ~allowed[..., -1:]
    shape = (kept, len(REBOUND_QUANTITIES), len(neighbours.names))
    return Sensitivity(
        descent=descent,
        parameters=neighbours.names,
        values=neighbours.values,
        scales=neighbours.scales,
        rebounds=np.array(values[:-1]).reshape(shape),
        rebound_errors=np.array(errors[:-1]).reshape(shape),
        end=values[-1],
        end_errors=errors[-1],
        sides=np.array([np.diff(each.any(axis=-1).astype(int))[:, 0] for each in fine]),
        distances=_distances(neighbours, steps, np.where(closed, neighbours.count + 1, agreed), needed),
    )


def _checked_parameters(given: Sequence[str] | None, body: Body, slope: Slope, solver: str) -> tuple[str, ...]:
    """Names of parameters, those that play a part by default."""
    idle = {name for name in PARAMETERS if name.endswith("stiffness")} if solver == "rigid" else set()
    if len(body.arcs) == 1:
        idle |= {"corner_rolling_arm", "half_angle"}
    foreign = () if isinstance(body, Segment) else _OF_SEGMENTS
    idle |= set(foreign)
    if math.isinf(slope.length):
        idle.add("length")
    if body.drag_area == 0.0:
        idle |= {"air_density", "drag_area"}
    absent = {name for name in PARAMETERS if name.startswith("zone_")}
    for k, zone in enumerate(slope.zones, 1):
        absent -= {f"zone_{k}_{name}" for name, value in zone.given().items() if math.isfinite(value)}
    idle |= absent
    if given is None:
        return tuple(name for name in PARAMETERS if name not in idle)
    if isinstance(given, str) or not isinstance(given, Sequence) or not given:
        raise ValueError(f"parameters = {given!r}: must be a sequence of names, at least one")
    known = tuple(name for name in PARAMETERS if name not in absent)
    for name in given:
        if isinstance(name, str) and name in absent:
            raise ValueError(f"parameters: the slope has no {name!r} that could be varied")
        checked_choice("parameters", name, known)
        if name in foreign:
            raise ValueError(f"parameters: {name!r} is that of a segment, and the body is a {type(body).__name__}")
    if len(set(given)) < len(given):
        raise ValueError(f"parameters = {given!r}: must name each parameter once")
    if "length" in given and "length" in idle:
        raise ValueError("parameters: the slope is endless, so that its length cannot be varied")
    return tuple(given)


def _distances(neighbours: Neighbours, steps: Floats, agreed: NDArray[np.int64], needed: list[int]) -> Floats:
    """Distances at which fewer rebounds agree than needed, of several needs, shape (needs, P, 2)."""
    brackets = [bracket(steps, agreed > count) for count in needed]
    low, high = (np.array(ends) for ends in zip(*brackets, strict=True))
    near = np.isfinite(high) & (low > 0.0)
    level, which, side = np.nonzero(near)
    signs, counts = SIGNS[side], np.array(needed)[level]

    def agrees(middle: Floats) -> NDArray[np.bool_]:
        tried, lanes = np.unique(np.stack([which, signs * middle]), axis=1, return_inverse=True)
        same: NDArray[np.bool_] = neighbours.run(tried[0].astype(int), tried[1], 0).agreed[lanes.reshape(-1)] > counts
        return same

    if near.any():
        low[near], high[near] = bisected(low[near], high[near], agrees, _BISECTIONS)
    return np.where(low > 0.0, 0.5 * (low + high), np.where(np.isfinite(high), 0.0, np.inf))
