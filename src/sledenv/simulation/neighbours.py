"""The descents around one, each of which differs from it in one parameter: which are allowed, what they come to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sledenv.kernel.ground import MOST_ZONES
from sledenv.simulation.bisection import bisected, bracket, least_of_smaller
from sledenv.simulation.bodies import Body, Segment, holds_its_mass_centre, segment, segment_records
from sledenv.simulation.clearance import resting_heights
from sledenv.simulation.derivatives import (
    END_QUANTITIES,
    LAUNCH,
    OF_ZONE,
    PARAMETERS,
    REBOUND_QUANTITIES,
    Floats,
    natural_units,
)
from sledenv.simulation.outcomes import Descent, DescentBatch
from sledenv.simulation.profiles import level_at
from sledenv.simulation.rules import RESTITUTION
from sledenv.simulation.scene import ContactLaw, Slope, SlopeTable, asymmetry_of, zones_allowed
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulate import simulate_blocks
from sledenv.simulation.support import within_a_turn

SIGNS = np.array([-1.0, 1.0])  # of what the two directions do to a parameter
_STEPS = 2.0 ** -np.arange(33.0)  # of the scale of a parameter: changes that are looked at
_COLUMN = {name: i for i, name in enumerate(PARAMETERS)}
_RESTITUTION = _COLUMN["restitution"]
_SECTIONS = (6, 11, 14, 19)  # columns of launch, law, slope, body and zones: where the next begins
_TO_THE_LAST_BIT = 64  # bisections
_BLOCK_RECORDS = 1 << 17  # of rebounds, kept at a time


class Runs(NamedTuple):
    """What N descents that differ in one parameter have come to."""

    agreed: NDArray[np.int64]  # (N,) rebounds before the first that differs from the one looked at; one more if all
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
    """

    def __init__(self, descent: Descent, names: tuple[str, ...], settings: Settings) -> None:
        law = descent.law
        self.descent, self.names, self.settings = descent, names, settings
        self.columns = np.array([_COLUMN[name] for name in names])
        of_law = (law.restitution, law.friction, law.rolling_arm, law.corner_rolling_arm, law.stiffness)
        angle, length, gravity, *zones = descent.slope.row
        of_zones = zones + [np.nan] * (len(PARAMETERS) - _SECTIONS[-1] - len(zones))
        self.centre = np.array([*descent.launch, *of_law, angle, length, gravity, *self._of_body(), *of_zones])
        self.values = self.centre[self.columns]
        scales = self._scales()
        self.scales = np.array([scales[name] for name in names])
        self.steps = np.tile(self.scales[:, np.newaxis, np.newaxis] * _STEPS, (1, 2, 1))

    def _of_body(self) -> tuple[float, ...]:
        """Fields of a segment; of any other body NaN where it has none."""
        body = self.descent.body
        if isinstance(body, Segment):
            return body.mass, body.radius, body.eccentricity, body.inertia, body.half_angle
        return body.mass, np.nan, np.nan, body.inertia, np.nan

    def records(self, bodies: Floats) -> np.ndarray:
        """What the kernel reads of bodies, given the rows of :meth:`tables`."""
        if isinstance(self.descent.body, Segment):
            return segment_records(bodies)
        records = np.tile(self.descent.body.record, len(bodies))
        records["mass"], records["inertia"] = bodies[:, 0], bodies[:, 3]
        records["per_mass"], records["per_inertia"] = 1.0 / bodies[:, 0], 1.0 / bodies[:, 3]
        return records

    def bodies(self, rows: Floats) -> np.ndarray | list[Body]:
        """Bodies of the rows of :meth:`tables`: records alone do not know the names of their parts."""
        if self.settings.end_touching is None:
            return self.records(rows)
        body = self.descent.body
        if isinstance(body, Segment):
            return [segment(*row) for row in rows.tolist()]
        return [body.replace(mass=mass, inertia=inertia) for mass, _, _, inertia, _ in rows.tolist()]

    def _scales(self) -> dict[str, float]:
        """How much of each parameter is a great change: what is always positive need not vanish."""
        descent = self.descent
        natural = natural_units(descent.body, descent.slope, descent.launch)
        rates = np.maximum(natural, np.abs(descent.launch))[3:]
        zone = {name: natural[0] if unit else 1.0 for name, unit in OF_ZONE.items()}
        zones = [(f"zone_{k}_{name}", scale) for k in range(1, MOST_ZONES + 1) for name, scale in zone.items()]
        halves = ["stiffness", "length", "gravity", "mass", "inertia"]
        halves += [f"zone_{k}_stiffness" for k in range(1, MOST_ZONES + 1)]
        return {
            **dict(zip(LAUNCH, [*natural[:3], max(rates[:2]), max(rates[:2]), rates[2]], strict=True)),
            **dict.fromkeys(("restitution", "friction", "angle", "half_angle"), 1.0),
            **dict.fromkeys(("rolling_arm", "corner_rolling_arm", "radius", "eccentricity"), natural[0]),
            **dict(zones),
            **{name: 0.5 * self.centre[_COLUMN[name]] or 1.0 for name in halves},
        }

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
        zones = zones[:, : len(self.descent.slope.row) - slopes.shape[1]]
        return bodies, laws, np.hstack([slopes, zones]), launches

    def allowed(self, which: NDArray[np.int64], changes: Floats) -> NDArray[np.bool_]:
        """Whether a simulation would take each of these changes."""
        bodies, laws, slopes, launches = self.tables(which, changes)
        restitution = self.centre[_RESTITUTION] + np.where(self.columns[which] == _RESTITUTION, changes, 0.0)
        fine: NDArray[np.bool_] = RESTITUTION[0](restitution) & (launches[:, 0] < slopes[:, 1])
        segments = isinstance(self.descent.body, Segment)
        for kind, rows in ((Segment, bodies), (ContactLaw, laws), (Slope, slopes)):
            for (accepts, _), column in zip(kind.rules, rows.T, strict=False):  # zones come behind a slope
                fine &= accepts(column) | (np.isnan(column) & (kind is Segment and not segments))
        zones = slopes[:, len(Slope.rules) :].reshape(len(slopes), len(self.descent.slope.zones), len(OF_ZONE))
        fine &= zones_allowed(zones).all(axis=1)
        if segments:
            fine &= np.array([holds_its_mass_centre(r, h, alpha) for _, r, h, _, alpha in bodies.tolist()], bool)
        found = np.flatnonzero(fine)
        records, vertices = self.records(bodies[found]), self.descent.slope.vertices
        heights = resting_heights(records, launches[found, 0], within_a_turn(launches[found, 2]), vertices)
        fine[found] = launches[found, 1] >= heights
        if len(vertices):
            fine[found] &= level_at(slopes[found, 1], records["size"], vertices)[1]
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

    def run(self, which: NDArray[np.int64], changes: Floats, kept: int) -> Runs:
        """Simulate descents that differ by a change of one parameter each."""
        bodies, laws, slopes, launches = self.tables(which, changes)
        block = max(_BLOCK_RECORDS // self.settings.max_rebounds, 1)
        table = SlopeTable(slopes, self.descent.slope)
        blocks = simulate_blocks(self.bodies(bodies), laws, table, launches, self.settings, block=block)
        parts = [(self._agreed(batch), rebound_values(batch.rebounds[:, :kept]), end_values(batch)) for batch in blocks]
        runs = Runs(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
        turned = launches[:, 2] - within_a_turn(launches[:, 2])  # whole turns that simulations take off
        runs.rebounds[:, :, list(REBOUND_QUANTITIES).index("phi")] += turned[:, np.newaxis]
        runs.end[:, list(END_QUANTITIES).index("phi")] += turned
        return runs

    def _agreed(self, batch: DescentBatch) -> NDArray[np.int64]:
        """Number of leading rebounds with the events of the descent that is looked at; one more if all else agrees."""
        own, count = self.descent.rebounds, len(self.descent.rebounds)
        log = batch.rebounds[:, :count]
        same = np.arange(count) < batch.outcomes["rebounds"][:, np.newaxis]
        for name in ("feature", "mode", "sequence"):
            same &= log[name] == own[name]
        leading = np.cumprod(same, axis=1).sum(axis=1)
        ends = (_way_of(batch) == _way_of(self.descent.as_batch())).all(axis=1)
        agreed: NDArray[np.int64] = leading + (ends & (leading == count))
        return agreed


def _way_of(batch: DescentBatch) -> NDArray[np.int64]:
    """How descents ended, and on which side of its kinks their reward is, shape (N, 4)."""
    progress = batch.jam.progress
    kinks = (progress > 0.0).astype(int) + (progress < 1.0), batch.jam.retention > 0.0
    return np.stack([batch.outcomes["status"], batch.outcomes["rebounds"], *kinks], axis=-1)


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
