"""Columns of an observation, each with its name, its unit, its scale and what it is computed of.

A new entry of the state is an entry of ``STATE``; of the ground and of landings it is one of the kernel's (outlook.py)
and a row here. The table of docs/environments/descent.md is made of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.machine.text_tables import markdown
from sledenv.scenarios.scenario import Context, Scenario
from sledenv.simulation.outlook import AHEAD, BEHIND, PLACES, Outlook, look_out
from sledenv.simulation.scenes import Scenes

Floats = NDArray[np.float64]

GROUPS: Final = ("context", "state", "ground", "landing")  # of columns, in their order: what a ride tells of itself
BOUND: Final = 5.0  # of entries that have no bound of their own: most are within 1, and what is beyond is cut off


class Scales(NamedTuple):
    """Scales of the columns of one scenario."""

    length: float  # [m] of the slope
    size: float  # [m] of the largest body
    speed: float  # [m/s] of a body that has all energy which the scenario can supply to a launch
    lent: float  # [rad/s] most spin that a rider lends
    reach: float  # [m] along the slope to the furthest vertex that is told
    relief: float  # [m] height of the bumps
    radius: float  # [m] largest of the bends
    # Limits of the scenario, which end a descent: up to there nothing is cut off, so that agents see them come.
    time: float  # [s]
    rebounds: float


class Look(NamedTuple):
    """All that columns of n lanes are computed of."""

    scenes: Scenes
    flights: np.ndarray  # of OUTCOME, (n,)
    outlook: Outlook

    @property
    def x(self) -> Floats:
        """Places [m] of the mass centres along the slope."""
        return self.flights["x"]


class Column(NamedTuple):
    """One entry of an observation."""

    name: str
    unit: str
    what: str  # for a reader, as the next one is
    by: str  # by which its values are divided
    scale: Callable[[Scales], float]
    value: Callable[[Look], Floats]  # in the unit, shape (n,)
    most: Callable[[Scales], float] = lambda of: math.inf  # in the unit, in place of BOUND


# The flight that begins. Scales are such that in rides of the shipped scenarios with random trims each entry has a
# standard deviation between 0.1 and 1; only the pose of a sled, which hardly turns, has less.
STATE: Final = (
    Column("left", "m", "way to the finish", "L", lambda of: of.length, lambda see: see.scenes.rows["length"] - see.x),
    Column(
        *("height", "m", "height of the mass centre over the ground below it", "0.4 s"),
        *(lambda of: 0.4 * of.size, lambda see: see.flights["y"] - see.outlook.under),
    ),
    Column(
        *("sine", "1", "of the orientation to the plane of the slope", "1"),
        *(lambda of: 1.0, lambda see: see.outlook.sine, lambda of: 1.0),
    ),
    Column(
        *("cosine", "1", "of the orientation", "1"),
        *(lambda of: 1.0, lambda see: see.outlook.cosine, lambda of: 1.0),
    ),
    Column("u", "m/s", "velocity along the slope", "U / 4", lambda of: of.speed / 4.0, lambda see: see.flights["u"]),
    Column("v", "m/s", "velocity off the slope", "U / 8", lambda of: of.speed / 8.0, lambda see: see.flights["v"]),
    Column(
        *("omega", "rad/s", "spin", "U / (3 s)"),
        *(lambda of: of.speed / of.size / 3.0, lambda see: see.flights["omega"]),
    ),
    Column(
        *("trim", "rad/s", "spin lent by the rotor", "`trim_rad_s` and four times `noise_rad_s`"),
        *(lambda of: of.lent, lambda see: see.flights["trim_spin"]),
    ),
    Column(
        *("supplied", "J/kg", "energy supplied so far, over the mass", "U^2 / 4"),
        *(lambda of: of.speed**2 / 4.0, lambda see: see.flights["supplied"] / see.scenes.of_body("mass")),
    ),
    Column(
        *("time", "s", "since the launch; bounded by `max_time_s`", "3 L / U"),
        *(lambda of: 3.0 * of.length / of.speed, lambda see: see.flights["t"], lambda of: of.time),
    ),
    Column(
        *("rebounds", "1", "contacts so far; bounded by `max_rebounds`", "15"),
        *(lambda of: 15.0, lambda see: see.flights["rebounds"], lambda of: of.rebounds),
    ),
)


class Around(NamedTuple):
    """An entry of each vertex around, as the kernel's VERTEX has it: of the k-th one to its side."""

    name: str
    unit: str
    what: str
    by: str
    scale: Callable[[Scales, int], float]
    bound: float = BOUND


AROUND: Final = (
    Around("x", "m", "less that of the mass centre", "k / 8 of the reach", lambda of, k: of.reach * k / AHEAD),
    Around("y", "m", "less that of the ground below the mass centre", "H", lambda of, k: of.relief),
    Around("radius", "m", "of the bend; left out where nothing is rounded", "the largest", lambda of, k: of.radius),
    Around("there", "1", "whether there is such a vertex: else all its entries are 0", "1", lambda of, k: 1.0, 1.0),
)


class Foreseen(NamedTuple):
    """An entry of a landing, as the kernel's LANDING has it."""

    name: str
    unit: str
    what: str
    scale: float


FORESEEN: Final = (
    Foreseen("time", "s", "until a body that lies would touch the ground under its mass centre, at most 3 s", 0.8),
    Foreseen("distance", "m", "that the mass centre flies along the slope", 10.0),
    Foreseen("pitch", "rad", "of the ground there to the plane", 0.25),
    Foreseen("approach", "m/s", "velocity into the ground", 4.0),
    Foreseen("speed", "m/s", "velocity along the ground", 8.0),
    Foreseen("pose", "rad", "orientation then, less the pitch", 3.0),
    Foreseen("spin", "rad/s", "without what the rotor lends", 10.0),
)
_RISE: Final = 0.4  # [rad] what 1 stands for of the ground's angles around a landing
_HEIGHTS: Final = 0.2 + 0.2 * np.minimum(np.abs(PLACES), 4.0)  # and of its heights, in those of bumps


class Columns:
    """The columns of one task.

    Parameters
    ----------
    groups : sequence of str
        Of ``GROUPS``.
    scenario : Scenario
    ride : bool
        Whether there are flights: a launch has no state, no landing and no ground behind.
    speed, lent : float
        As in :class:`Scales`.
    varies : ndarray of bool, shape (11,)
        Which fields of the context are told; the others read 0.

    Attributes
    ----------
    names, units : tuple of str
        Of all columns.
    middle, scale, bound : ndarray, shape (k,)
        An entry is its value less the middle, over the scale, within the bounds.
    """

    def __init__(
        self,
        groups: Sequence[str],
        scenario: Scenario,
        *,
        ride: bool,
        speed: float,
        lent: float,
        varies: NDArray[np.bool_],
    ) -> None:
        reach, relief, radius = scenario.extent
        size = max(body.size for body in scenario.all_bodies())
        limits = scenario.limits.max_time_s, float(scenario.limits.max_rebounds)
        self.scales = Scales(scenario.slope_section.length_m, size, speed, lent, reach, relief or 1.0, radius, *limits)
        self.groups = tuple(groups)
        self._varies = varies
        self._entries = [i for i, (entry, *_) in enumerate(AROUND) if entry != "radius" or radius > 0.0]
        self._told = slice(0 if ride else BEHIND, BEHIND + AHEAD if reach > 0.0 else 0)
        low, high = (ends[: len(Context.seen)] for ends in scenario.ranges)
        of = self.scales
        parts: list[tuple[str, str, float, float, float]] = []  # name, unit, middle, scale and bound of each
        if "context" in groups:
            for i, (name, unit) in enumerate(zip(Context.seen, Context.units, strict=True)):
                ends = (float(low[i]), float(high[i])) if varies[i] else (-1.0, 1.0)
                parts.append((name, unit, 0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0]), 1.0))
        if "state" in groups:
            for state in STATE:
                most = state.most(of) / state.scale(of)
                parts.append((state.name, state.unit, 0.0, state.scale(of), most if math.isfinite(most) else BOUND))
        if "ground" in groups:
            places = [*(("behind", k) for k in range(BEHIND, 0, -1)), *(("ahead", k) for k in range(1, AHEAD + 1))]
            told = [AROUND[i] for i in self._entries]
            parts += [
                (f"{side}_{k}_{one.name}", one.unit, 0.0, one.scale(of, k), one.bound)
                for side, k in places[self._told]
                for one in told
            ]
        if "landing" in groups:
            parts += [(f"landing_{name}", unit, 0.0, scale, BOUND) for name, unit, _, scale in FORESEEN]
            rises, on = np.full(len(PLACES), _RISE), PLACES if reach > 0.0 else PLACES[:0]  # a plane has no others
            for name, unit, scales in (("height", "m", _HEIGHTS * of.relief), ("rise", "rad", rises)):
                for place, one in zip(on, scales[: len(on)].tolist(), strict=True):
                    parts.append((f"landing_{name}_{place:+g}", unit, 0.0, one, BOUND))
        self.names: tuple[str, ...] = tuple(part[0] for part in parts)
        self.units: tuple[str, ...] = tuple(part[1] for part in parts)
        self.middle, self.scale, self.bound = np.array([part[2:] for part in parts]).reshape(-1, 3).T
        self._looks = bool({"state", "landing"} & set(groups)) or ("ground" in groups and reach > 0.0)

    def fill(self, scenes: Scenes, flights: np.ndarray) -> Floats:
        """Return what is seen of lanes, scaled but not bounded, shape (n, k)."""
        values, at = np.empty((len(flights), len(self.names))), 0
        if "context" in self.groups:
            at = len(Context.seen)
            values[:, :at] = np.where(self._varies, scenes.drawn[:, :at], 0.0)
        if self._looks:
            outlook = look_out(scenes, flights, ahead="landing" in self.groups)
            if "state" in self.groups:
                see = Look(scenes, flights, outlook)
                for column in STATE:
                    values[:, at] = column.value(see)
                    at += 1
            if "ground" in self.groups and self._told.stop:
                around = outlook.around[:, self._told]
                if len(self._entries) < len(AROUND):
                    around = around[..., self._entries]
                width = around.shape[1] * around.shape[2]
                values[:, at : at + width] = around.reshape(len(values), width)
                at += width
            if "landing" in self.groups:
                values[:, at:] = outlook.landings[:, : len(self.names) - at]
        values -= self.middle
        values /= self.scale
        return values

    def values(self, observations: NDArray[np.floating]) -> dict[str, Floats]:
        """Return what entries of observations of shape (n, k) stand for, by name, shapes (n,), in their units."""
        table = observations * self.scale + self.middle
        return dict(zip(self.names, table.T, strict=True))


def table() -> str:
    """Return what entries there are, for a reader, as a table in Markdown."""
    rows = [(f"`{one.name}`", one.unit, one.what, one.by) for one in STATE]
    around = f"`behind_{BEHIND}_", f"`ahead_{AHEAD}_"
    rows += [(f"{around[0]}{one.name}` to {around[1]}{one.name}`", one.unit, one.what, one.by) for one in AROUND]
    rows += [(f"`landing_{one.name}`", one.unit, one.what, f"{one.scale:g}") for one in FORESEEN]
    heights = "m", "height of the ground d m from the landing, less that there", "(0.2 + 0.2 min(abs(d), 4)) H"
    for name, told in (("height", heights), ("rise", ("rad", "angle of the ground there to the plane", f"{_RISE:g}"))):
        rows.append((f"`landing_{name}_{PLACES[0]:+g}` to `landing_{name}_{PLACES[-1]:+g}`", *told))
    return markdown(("name", "unit", "what it is", "divided by"), rows)
