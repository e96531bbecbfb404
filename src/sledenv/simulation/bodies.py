"""The body: its mass, its inertia and its outline; the segment; and what the kernel reads of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, ClassVar, Final, NoReturn, Self

import numpy as np

from sledenv.kernel.entries import run_complete, run_directions
from sledenv.kernel.outline import BODY, GIVEN, listed_twice
from sledenv.simulation.outlines import (
    Arc,
    Floats,
    checked_arcs,
    outline_of,
    sines_and_cosines,
)
from sledenv.simulation.rules import (
    INERTIA,
    MEASURE,
    MEASURE_OR_0,
    NOT_NEGATIVE,
    Rule,
    checked,
    checked_rows,
    checked_table,
    is_frame,
)

HALF_ANGLE: Rule = (lambda v: (v > 0.0) & (v <= math.pi), "in (0, pi] rad")
_ON_CHORD = 1e-15  # of the radius: a mass centre that is farther outside the chord is so by more than rounding
_SAMPLES, _DEEPER = 33, 1e-9  # orientations that are looked at; of the size: a circle may reach so far by rounding
_SEGMENT_PARTS: Final = ("arc", "nose", "tail", "chord")
_ARC, _NOSE, _TAIL, _CHORD = range(1, 5)  # their codes


class Body:
    """A rigid body with a convex outline of arcs and straight sides: docs/physics.md, section 8.

    It never changes, is compared by its values and may be a key of a dictionary.

    Parameters
    ----------
    mass : float
        Mass [kg], > 0.
    inertia : float
        Moment of inertia about the mass centre [kg m^2], > 0.
    arcs : sequence of Arc
        1 to 24 arcs of the outline in the order in which they touch as the orientation rises, so that ``begin`` rises
        from one to the next. Each is the lowest up to ``begin`` of the next one, the last one up to that of the first.
        There both are at the same place, or apart by the length of a straight side. A single arc goes all around.
    drag_area : float
        Drag coefficient times the area that the air meets, c_d A [m^2], >= 0: docs/physics.md, section 9. 0, the
        default, feels no air.

    Attributes
    ----------
    mass, inertia, drag_area : float

    Raises
    ------
    TypeError, ValueError
        Naming the field, its value and the allowed range. An outline must be closed and convex, and must have the mass
        centre within it or on it. Sides must be at least 1e-9 of the size long, and the outline must turn by at least
        1e-9 rad from one side to the next. A radius may be 1e6 of the size.
    """

    fields: ClassVar[tuple[str, ...]] = ("mass", "inertia", "arcs", "drag_area")

    mass: float
    inertia: float
    drag_area: float
    _arcs: tuple[Arc, ...]

    def __init__(self, mass: float, inertia: float, arcs: Sequence[Arc], drag_area: float = 0.0) -> None:
        self._keep(
            mass=checked("Body", "mass", mass, MEASURE),
            inertia=checked("Body", "inertia", inertia, INERTIA),
            _arcs=checked_arcs("Body", arcs),
            drag_area=checked("Body", "drag_area", drag_area, NOT_NEGATIVE),
        )

    def _keep(self, **values: Any) -> None:
        self.__dict__.update(values)

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"{type(self).__name__}.{name} cannot be set: use replace")

    def __delattr__(self, name: str) -> NoReturn:
        raise AttributeError(f"{type(self).__name__}.{name} cannot be deleted")

    @property
    def arcs(self) -> tuple[Arc, ...]:
        """Arcs of the outline, sorted by ``begin`` [rad] in [-pi, pi)."""
        return self._arcs

    @cached_property
    def _sides(self) -> list[float]:
        """Length [m] of the straight side after each arc."""
        return outline_of(self.arcs).sides.tolist()  # type: ignore[no-any-return]

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """Names of the arcs and then of the straight sides, those with the same name once.

        The code of a part in logs and trajectories is its place here, counted from 1; 0 is none.
        """
        sides = (arc.side for arc, length in zip(self.arcs, self._sides, strict=True) if length > 0.0)
        return tuple(dict.fromkeys([*(arc.part for arc in self.arcs), *sides]))

    @cached_property
    def record(self) -> np.ndarray:
        """Record that the kernel reads of the body, shape (1,) of kernel.outline.BODY; it cannot be written to."""
        records = self._made()
        records.setflags(write=False)
        return records

    @property
    def size(self) -> float:
        """Largest distance of the outline from the mass centre [m]."""
        return float(self.record["size"][0])

    @property
    def lowest_support(self) -> float:
        """Smallest support height over all orientations [m], from which the supplied energy is counted."""
        return float(self.record["lowest"][0])

    def replace(self, **changes: Any) -> Self:
        """Return a body of the same kind with other values of some ``fields``, all of them checked."""
        return type(self)(**dict(zip(self.fields, self._values(), strict=True)) | changes)

    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, field) for field in self.fields)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Body) and type(other) is type(self) and self._values() == other._values()

    def __hash__(self) -> int:
        return hash((type(self), self._values()))

    def typed(self) -> str:
        """Return the Python that makes it anew."""
        given = zip(self.fields, self._values(), strict=True)
        values = (f"{field}={value!r}" for field, value in given if field != "drag_area" or value)
        return f"{type(self).__name__}({', '.join(values)})"

    def __repr__(self) -> str:
        told = [field for field in self.fields if field != "arcs" and (field != "drag_area" or self.drag_area)]
        numbers = (f"{field} {getattr(self, field):.6g}" for field in told)
        return f"{type(self).__name__}({', '.join(numbers)}; parts: {', '.join(self.parts)})"

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._values()

    def _made(self) -> np.ndarray:
        return _with_ends(self._listed())

    def _listed(self) -> np.ndarray:
        """Record of the arcs as they are given."""
        records = np.zeros(1, BODY)
        arcs, sides = list(self.arcs), self._sides
        codes = {name: float(code) for code, name in enumerate(self.parts, 1)}
        if arcs[0].begin > -math.pi:  # the last one is the lowest at +-pi, and listed twice
            arcs, sides = [arcs[-1]._replace(begin=-math.pi), *arcs], [sides[-1], *sides]
        record = records[0]
        record["mass"], record["inertia"], record["count"] = self.mass, self.inertia, len(arcs)
        record["drag_area"] = self.drag_area
        for k, arc in enumerate(arcs):
            record["begin"][k], record["along"][k], record["across"][k] = arc.begin, arc.y, 0.0 - arc.x
            record["r"][k], record["part"][k] = arc.radius, codes[arc.part]
            record["side"][k] = codes[arc.side] if sides[k] > 0.0 else 0.0
            record["corner"][k] = 1.0 if arc.corner else 0.0
        return completed(records)


def _with_ends(given: np.ndarray) -> np.ndarray:
    """Let the end of a straight side stand for an arc whose circle would reach beyond the outline on its other side.

    Where one end of a side touches, the lowest point of the other one is the end of the side, until the body lies flat.
    The lowest point of the whole circle differs from that, and may be far lower if the circle is large. ``given`` and
    the result are complete, shape (1,).
    """
    record = given[0]
    for arc in range(int(record["count"])):
        low, high = float(record["low"][arc]), float(record["high"][arc])
        for name in ("falling", "rising"):
            other = int(record[name][arc])
            if other < 0 or record["r"][other] == 0.0:
                continue
            sine, cosine = sines_and_cosines(np.linspace(low, high, _SAMPLES))
            across, along = (record[each][arc] - record[each][other] for each in ("across", "along"))
            lowest = float((record["r"][arc] - record["r"][other] + across * sine - along * cosine).min())
            if lowest < -_DEEPER * record["size"]:
                return _with_ends(_with_end(given, other, rising=name == "rising"))
    return given


def _with_end(given: np.ndarray, arc: int, *, rising: bool) -> np.ndarray:
    """List the end of the side before an arc, or behind it, as a corner."""
    records = given.copy()
    record, count = records[0], int(given["count"][0])
    place = arc if rising else arc + 1
    edge = float(record["begin"][arc] if rising else record["high"][arc])
    sine, cosine = (float(each[0]) for each in sines_and_cosines(np.array([edge])))
    for name in GIVEN:
        record[name][place + 1 : count + 1] = record[name][place:count].copy()
        record[name][place] = given[name][0, arc]
    record["count"], record["begin"][place], record["r"][place] = count + 1.0, edge, 0.0
    r = given["r"][0, arc]
    record["across"][place] += r * sine
    record["along"][place] -= r * cosine
    record["side"][place if rising else arc] = 0.0
    if listed_twice(given[0]) and not rising and arc == 0:
        record["side"][count] = 0.0
    return completed(records)


def completed(records: np.ndarray) -> np.ndarray:
    """Let the kernel write all that follows from what is given of bodies, shape (N,); return them."""
    run_complete(records)
    return records


def made_body(value: Any) -> Body:
    """Return an argument that must be a body, or raise TypeError."""
    if not isinstance(value, Body):
        raise TypeError(f"body = {value!r}: must be a Body, such as segment(...) or polygon(...) returns")
    return value


def records_of(bodies: Body | Sequence[Body] | np.ndarray, lanes: int, name: str = "body") -> np.ndarray:
    """Return what the kernel reads of one body for all lanes, or of one for each.

    Parameters
    ----------
    bodies : Body, sequence of Body, or ndarray
        One, or as many as lanes: bodies, the fields of segments without drag, shape (N, 5), or records of
        kernel.outline.BODY, shape (1,) or (N,), that are complete.
    lanes : int
        How many descents there are.
    name : str
        What messages call the argument.

    Returns
    -------
    ndarray of kernel.outline.BODY, shape (1,) or (N,)

    Raises
    ------
    TypeError, ValueError
        Naming the argument, the lane, the value and what is allowed.
    """
    if isinstance(bodies, Body):
        return bodies.record
    if isinstance(bodies, np.ndarray) or is_frame(bodies):
        return _records_of_table(bodies, lanes, name)
    given: Any = bodies
    if isinstance(given, str | bytes) or not isinstance(given, Sequence):
        raise TypeError(f"{name} = {given!r}: must be a Body or a sequence of them")
    _check_count(given, lanes, name)
    return _records_of_each(given, name)


def _check_count(bodies: Any, lanes: int, name: str) -> None:
    if len(bodies) != lanes:
        raise ValueError(f"{name}: {len(bodies)} given for {lanes} launches; give one or one a launch")
    if not lanes:
        raise ValueError(f"{name} has no row: give one Body for all where there are no launches")


def _records_of_table(table: Any, lanes: int, name: str) -> np.ndarray:
    """Records that are complete, or of the segments that rows of numbers are."""
    if isinstance(table, np.ndarray) and table.dtype == BODY and table.ndim == 1:
        if len(table) != 1:
            _check_count(table, lanes, name)
        return np.ascontiguousarray(table)
    rows = checked_table(name, table, Segment.fields[:-1])
    _check_count(rows, lanes, name)
    check_bodies(f"{name}[{{lane}}]", rows)
    return segment_records(np.column_stack([rows, np.zeros(len(rows))]))


def _records_of_each(bodies: Sequence[Body], name: str) -> np.ndarray:
    """Records of bodies, of which equal ones are completed once."""
    bodies = list(bodies)
    places: dict[int, int] = {}  # of an object among the bodies that differ
    different: dict[Body, int] = {}
    for lane, body in enumerate(bodies):
        if id(body) not in places:
            if not isinstance(body, Body):
                raise TypeError(f"{name}[{lane}] = {body!r}: must be a Body")
            places[id(body)] = different.setdefault(body, len(different))
    records = np.empty(len(different), BODY)
    segments = [body for body in different if isinstance(body, Segment)]
    if segments:
        rows = np.array([body._values() for body in segments])
        records[[different[body] for body in segments]] = segment_records(rows)
    for body, place in different.items():
        if not isinstance(body, Segment):
            records[place] = body.record[0]
    return records[[places[id(body)] for body in bodies]]


# Segments.


def least_eccentricity(radius: float, half_angle: float) -> float:
    """Smallest distance [m] of the mass centre from the centre of the arc with which it is not beyond the chord."""
    return radius * max(math.cos(half_angle), 0.0)


def holds_its_mass_centre(radius: float, eccentricity: float, half_angle: float) -> bool:
    """Whether the mass centre lies between arc and chord, so that it stays above the slope: docs/physics.md (8.11)."""
    return least_eccentricity(radius, half_angle) - _ON_CHORD * radius <= eccentricity <= radius


class Segment(Body):
    """A circular arc with an eccentric mass centre, closed by its chord: see :func:`segment`, which makes it.

    Its parts are "arc", "nose", "tail" and "chord". At phi = 0 the nose is the downhill end of the arc.
    """

    fields: ClassVar[tuple[str, ...]] = ("mass", "radius", "eccentricity", "inertia", "half_angle", "drag_area")
    rules: ClassVar[tuple[Rule, ...]] = (MEASURE, MEASURE_OR_0, NOT_NEGATIVE, INERTIA, HALF_ANGLE, NOT_NEGATIVE)
    _fields: ClassVar[tuple[str, ...]] = fields  # where rules.checked_rows looks for them

    radius: float
    eccentricity: float
    half_angle: float

    def __init__(
        self,
        mass: float,
        radius: float,
        eccentricity: float,
        inertia: float,
        half_angle: float = math.pi,
        drag_area: float = 0.0,
    ) -> None:
        given = zip(self.fields, (mass, radius, eccentricity, inertia, half_angle, drag_area), self.rules, strict=True)
        values = {field: checked("segment", field, value, rule) for field, value, rule in given}
        r, h, alpha = values["radius"], values["eccentricity"], values["half_angle"]
        if not holds_its_mass_centre(r, h, alpha):
            raise _outside("segment", r, h, alpha)
        self._keep(**values)

    @cached_property
    def arcs(self) -> tuple[Arc, ...]:
        """Arcs of the outline, sorted by ``begin`` [rad] in [-pi, pi)."""
        record, arcs = self.record[0], []
        for k in range(int(record["count"])):
            across, along, r, begin = (float(record[of][k]) for of in ("across", "along", "r", "begin"))
            part = int(record["part"][k])
            name, side = _SEGMENT_PARTS[part - 1], "chord" if part == _TAIL else "side"
            arcs.append(Arc(0.0 - across, along, r, begin, name, side, part != _ARC))
        return tuple(arcs)

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """Names of all that a segment can touch with, whether or not this one has a chord."""
        return _SEGMENT_PARTS

    def _made(self) -> np.ndarray:
        return segment_records(np.array([self._values()]))


def segment(
    mass: float,
    radius: float,
    eccentricity: float,
    inertia: float,
    half_angle: float = math.pi,
    drag_area: float = 0.0,
) -> Segment:
    """Return a circular arc with an eccentric mass centre, closed by its chord: docs/physics.md, sections 1 and 8.

    Parameters
    ----------
    mass : float
        Mass [kg], > 0.
    radius : float
        Radius of the arc [m], >= 0; 0 is a point.
    eccentricity : float
        Distance from the centre of the arc to the mass centre [m], which lies between arc and chord: from
        ``radius * cos(half_angle)``, or 0 if that is negative, to ``radius``. Elsewhere it would pass below the slope.
    inertia : float
        Moment of inertia about the mass centre [kg m^2], > 0. If all mass lies between arc and chord it is at most
        ``mass * (radius**2 - eccentricity**2)``; this is not checked, as a spool on its axle has more: docs/physics.md
        (8.12).
    half_angle : float
        Half-angle of the arc [rad] in (0, pi]; pi is a full disc without corners.
    drag_area : float
        [m^2], as of :class:`Body`.

    Returns
    -------
    Segment
        A body that keeps these six numbers as attributes.

    Raises
    ------
    TypeError, ValueError
        Naming the argument, its value and the allowed range.
    """
    return Segment(mass, radius, eccentricity, inertia, half_angle, drag_area)


def _outside(owner: str, radius: float, eccentricity: float, half_angle: float) -> ValueError:
    least = least_eccentricity(radius, half_angle)
    return ValueError(
        f"{owner}.eccentricity = {eccentricity!r}: must be in [max(radius cos(half_angle), 0), radius] = "
        f"[{least!r}, {radius!r}] m: elsewhere the mass centre would pass below the slope"
    )


def check_bodies(owner: str, rows: Floats) -> None:
    """Check the fields of many segments without drag, shape (N, 5): as ``checked_rows`` does, and their mass centres.

    Raises
    ------
    ValueError
        Naming row, field, value and allowed range; ``{lane}`` in ``owner`` becomes the number of the row.
    """
    checked_rows(owner, Segment, rows)
    _, radius, eccentricity, _, half_angle = rows.T
    doubtful = ~((radius * np.maximum(np.cos(half_angle), 0.0) <= eccentricity) & (eccentricity <= radius))
    for lane in np.flatnonzero(doubtful).tolist():
        _, r, h, _, alpha = rows[lane].tolist()
        if not holds_its_mass_centre(r, h, alpha):
            raise _outside(owner.format(lane=lane), r, h, alpha)


def segment_records(rows: Floats) -> np.ndarray:
    """Return what the kernel reads of segments whose fields, shape (N, 6), have been checked; shape (N,)."""
    mass, radius, eccentricity, inertia, half_angle, drag_area = rows.T
    records = np.zeros(len(rows), BODY)
    records["mass"], records["inertia"], records["count"], records["drag_area"] = mass, inertia, 1.0, drag_area
    records["begin"][:, 0], records["part"][:, 0] = -math.pi, _ARC
    records["along"][:, 0], records["r"][:, 0] = eccentricity, radius

    ended = np.flatnonzero((half_angle < math.pi) & (radius > 0.0))
    radius, eccentricity, half_angle = radius[ended], eccentricity[ended], half_angle[ended]
    sine, cosine = np.empty(len(ended)), np.empty(len(ended))
    run_directions(half_angle, cosine, sine)
    across, along = radius * sine, eccentricity - radius * cosine
    records["count"][ended] = 3.0
    columns = {
        "begin": (-math.pi, -half_angle, half_angle),
        "along": (along, eccentricity, along),
        "across": (-across, 0.0, across),
        "r": (0.0, radius, 0.0),
        "part": (_NOSE, _ARC, _TAIL),
        "side": (0.0, 0.0, _CHORD),
        "corner": (1.0, 0.0, 1.0),
    }
    for name, values in columns.items():
        for k, value in enumerate(values):
            records[name][ended, k] = value
    return completed(records)
