"""Scenarios: the contexts that are drawn from a file's ranges, and what each hands to the simulator."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Final, Literal, NamedTuple, Self, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from sledenv.scenarios.configuration import Document, Pair
from sledenv.scenarios.sections import (
    AnyBody,
    ChoiceBody,
    ContactSection,
    ControlSection,
    EndsSection,
    LaunchSection,
    LimitsSection,
    RiderSection,
    SlopeSection,
    ZoneSection,
)
from sledenv.simulation.bodies import Body, records_of
from sledenv.simulation.records import MOST_ZONES, params
from sledenv.simulation.rules import FINITE, NOT_NEGATIVE, RESTITUTION, STEEPNESS, Rule, checked, checked_choice, made
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone, asymmetry_of
from sledenv.simulation.settings import Settings, Solver
from sledenv.simulation.support import support_heights, within_a_turn

Split = Literal["train", "validation", "test"]
NOISY: Final = ("orientation", "spin")  # what launch noise disturbs, chosen or not

_CELLS = 2.0**20  # of each range: a split has a part of its own of every cell
_TURN = 0.5 * (math.sqrt(5.0) - 1.0)  # of the range, between the draws of two splits


class ScenarioError(ValueError):
    """A scenario that does not exist or is not valid; one line of the message for each problem."""


# Beyond it energies overflow. A state that is simulated may have more, and its descent ends as "non_finite".
_MOST: Final = 1e150
_MOVING: Rule = (lambda v: abs(v) <= _MOST, f"in [-{_MOST:g}, {_MOST:g}]")
_HIGH: Rule = (lambda v: (v >= 0.0) & (v <= _MOST), f"in [0, {_MOST:g}] m")


class _ContextFields(NamedTuple):
    angle: float  # [rad] of the slope
    friction: float  # [-] f
    restitution: float  # [-] e
    speed: float  # [m/s] along the slope
    drop: float  # [m] clearance of the lowest point of the body
    fall: float  # [m/s] towards the slope
    orientation: float  # [rad] phi at launch
    spin: float  # [rad/s] omega at launch
    # Of the zone of the slope that is drawn; of the first one if none is, and 0 without zones.
    zone_begin: float  # [m] along the slope
    zone_friction: float  # [-] f
    shape: float  # [-] number of the body among those of the scenario, from 0 on


class Context(_ContextFields):
    """One draw from the ranges of a scenario: all that differs between two of its descents.

    Many contexts are an array of shape (N, 11) with these fields as columns. ``rules`` says what can be simulated,
    whatever the ranges of a scenario are; a context is checked where it is used.
    """

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (
        *(STEEPNESS, NOT_NEGATIVE, RESTITUTION),
        *(_MOVING, _HIGH, _MOVING, FINITE, _MOVING),
        *(NOT_NEGATIVE, NOT_NEGATIVE, (lambda v: (v >= 0.0) & (v == np.floor(v)), "a whole number >= 0")),
    )


_ZONE, _SHAPE = Context._fields.index("zone_begin"), Context._fields.index("shape")


class Scenario(Document):
    """A family of descents: one body or several, one slope and the ranges that a context is drawn from.

    The keys are those of the YAML file, with their units; ``slope``, ``body`` and ``launch`` are read as
    ``slope_section``, ``body_section`` and ``launch_section``. Instances are immutable, hashable and picklable.
    """

    called: ClassVar[str] = "scenario"
    folder: ClassVar[str] = "scenarios"
    error: ClassVar[type[ValueError]] = ScenarioError

    title: str
    question: str = ""  # what a launch, or an agent that chooses it, is asked
    description: str = ""
    sources: str = ""  # where the numbers come from
    tags: tuple[str, ...] = ()
    slope_section: Annotated[SlopeSection, Field(alias="slope")]
    body_section: Annotated[AnyBody, Field(alias="body", discriminator="kind")]
    contact: ContactSection
    zones: Annotated[tuple[ZoneSection, ...], Field(max_length=MOST_ZONES)] = ()
    launch_section: Annotated[LaunchSection, Field(alias="launch")]
    control: ControlSection
    limits: LimitsSection
    ends: EndsSection = EndsSection()
    rider: RiderSection | None = None

    @model_validator(mode="after")
    def _ends_at_a_part_of_the_body(self) -> Self:
        name = self.ends.touching
        if name is None:
            return self
        for body in self.all_bodies():
            if name not in body.parts:
                raise ValueError(f"ends.touching = {name!r}: must be a part of the body: {', '.join(body.parts)}")
        if len({body.parts.index(name) for body in self.all_bodies()}) > 1:
            raise ValueError(f"ends.touching = {name!r}: must have the same place in the parts of all bodies")
        return self

    @model_validator(mode="after")
    def _zones_in_a_row(self) -> Self:
        reached, length = 0.0, self.slope_section.length_m
        for k, zone in enumerate(self.zones):
            earliest, latest = zone.begin_m
            if earliest < reached:
                before = "that the zone before may end" if math.isfinite(reached) else "as the zone before has no end_m"
                raise ValueError(f"zones.{k}.begin_m = {earliest:g}: must be in [{reached:g}, inf) m, {before}")
            if latest >= length:
                raise ValueError(f"zones.{k}.begin_m = {latest:g}: must be in [0, slope.length_m) = [0, {length:g}) m")
            if zone.end_m is not None and zone.end_m > length:
                allowed = f"(0, slope.length_m] = (0, {length:g}] m"
                raise ValueError(f"zones.{k}.end_m = {zone.end_m:g}: must be in {allowed}")
            reached = math.inf if zone.end_m is None else zone.end_m
        drawn = [k for k, zone in enumerate(self.zones) if zone.varies]
        if len(drawn) > 1:
            given = f"those of zones.{drawn[0]} are"
            raise ValueError(f"zones.{drawn[1]}: begin_m and friction of one zone alone may be ranges, and {given}")
        return self

    @property
    def ranges(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest value of each field of ``Context``: two new arrays of shape (11,), in its units."""
        low, high = np.array(self._pairs()).T.copy()
        return low, high

    @property
    def hash(self) -> str:
        """Identity of what is simulated, 16 hex digits: words about it, such as title, sources and tags, do not count.

        Neither does a section, a key of ``control``, or a restitution or stiffness of a zone that is not given, nor a
        rule of ``ends`` that is off.
        """
        content = self.model_dump(mode="json", exclude={"title", "question", "description", "sources", "tags"})
        content["control"] = _given(content["control"])
        content["ends"] = {rule: on for rule, on in content["ends"].items() if on} or None
        own = "restitution", "stiffness_n_m"
        zones = ({key: value for key, value in zone.items() if key not in own or value} for zone in content["zones"])
        content["zones"] = list(zones) or None
        content["slope"] = {key: value for key, value in content["slope"].items() if key != "run_out_m" or value}
        content = _given(content)
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]

    def sample(self, rng: np.random.Generator, split: Split | None = None) -> Context:
        """Draw a context, uniform in the ranges; every call takes eleven doubles from ``rng``.

        Parameters
        ----------
        rng : Generator
        split : {"train", "validation", "test"}, optional
            As for :meth:`contexts`.

        Raises
        ------
        TypeError
            If ``rng`` is no random generator of numpy.
        """
        if not isinstance(rng, np.random.Generator):
            raise TypeError(f"rng = {rng!r}: must be a numpy.random.Generator, such as numpy.random.default_rng(0)")
        return Context(*self.contexts(rng.random(len(Context._fields)), split).tolist())

    def contexts(self, draws: NDArray[np.float64], split: Split | None = None) -> NDArray[np.float64]:
        """Return the contexts at relative places ``draws`` in [0, 1) of the ranges, both of shape (..., 11).

        Parameters
        ----------
        draws : ndarray, shape (..., 11)
        split : {"train", "validation", "test"}, optional
            Take a context of this split. Whatever the draws, two splits never share a value of a field that varies,
            ``shape`` apart, and equal draws give contexts that differ by at least 0.23 of every range. Each split is
            dense in the ranges to a millionth and uniform.

        Raises
        ------
        ValueError
            For an unknown split.
        """
        low, high = self.ranges
        places = draws if split is None else _apart(draws, split)
        contexts = np.minimum(low + (high - low) * places, high)
        contexts[..., _SHAPE] = np.floor(len(self.all_bodies()) * places[..., _SHAPE])
        return contexts

    def _pairs(self) -> tuple[Pair, ...]:
        """Range of each field of ``Context``."""
        launch, drawn = self.launch_section, self._drawn_zone
        zone = None if drawn is None else self.zones[drawn]
        return (
            _radians(self.slope_section.angle_deg),
            self.contact.friction,
            self.contact.restitution_range,
            launch.speed_m_s,
            launch.drop_m,
            launch.fall_m_s,
            _radians(launch.orientation_deg),
            launch.spin_rad_s,
            (0.0, 0.0) if zone is None else zone.begin_m,
            (0.0, 0.0) if zone is None else zone.friction,
            (0.0, float(len(self.all_bodies()) - 1)),
        )

    @property
    def _drawn_zone(self) -> int | None:
        """Number of the zone that a context tells of, None without zones."""
        drawn = [k for k, zone in enumerate(self.zones) if zone.varies]
        return next(iter([*drawn, *range(len(self.zones))]), None)

    @property
    def control_bounds(self) -> dict[str, Pair]:
        """Lowest and highest value of each of ``CONTROLS`` that an agent may choose, in the units of the YAML keys."""
        return _given({control.name: getattr(self.control, key) for key, control in ControlSection.controls().items()})

    def all_bodies(self) -> tuple[Body, ...]:
        """Return the bodies of the scenario, one of which is that of a context."""
        return _build(self.body_section)

    def body(self, context: Context | None = None) -> Body:
        """Return the body of a context; without one, the first body.

        Raises
        ------
        ValueError
            If the scenario has no body of this number.
        """
        if context is None:
            return self.all_bodies()[0]
        (number,) = self.shapes(_alone(context))
        return self.all_bodies()[int(number)]

    def bodies(self, contexts: NDArray[np.float64]) -> Body | np.ndarray:
        """Return the body of all contexts of shape (N, 11), or records of kernel.outline.BODY, one a context."""
        bodies = self.all_bodies()
        if len(bodies) == 1:
            return bodies[0]
        return np.concatenate([body.record for body in bodies])[self.shapes(contexts)]

    def shapes(self, contexts: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the place of each context's body among those of the scenario, shape (N,).

        Raises
        ------
        ValueError
            If it has no body there.
        """
        shapes, most = contexts[:, _SHAPE], len(self.all_bodies()) - 1
        wrong = ~((shapes >= 0.0) & (shapes <= most) & (shapes == np.floor(shapes)))
        if wrong.any():
            value = float(shapes[wrong][0])
            raise ValueError(f"context.shape = {value!r}: must be a whole number in [0, {most}], that of a body")
        return shapes.astype(np.intp)

    def law(self, context: Context) -> ContactLaw:
        """Return the contact law of a context."""
        return ContactLaw(*self.laws(_alone(context))[0].tolist())

    def laws(self, contexts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the contact laws of contexts of shape (N, 11): columns are the fields of ContactLaw, shape (N, 5)."""
        law, (_, friction, restitution, *_) = self.contact, contexts.T
        fields = params.ContactLaw(
            stiffness=law.stiffness_n_m,
            asymmetry=asymmetry_of(restitution),
            friction=friction,
            rolling_arm=law.rolling_arm_m,
            corner_rolling_arm=law.corner_rolling_arm_m,
        )
        return _rows(len(contexts), fields)

    def slope(self, context: Context) -> Slope:
        """Return the slope of a context, with its zones."""
        angle, length, gravity, *rest = self.slopes(_alone(context))[0].tolist()
        fields = iter(None if math.isnan(field) else field for field in rest)
        return Slope(angle, length, gravity, [Zone(*zone) for zone in zip(*[fields] * len(Zone._fields), strict=True)])

    def slopes(self, contexts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the slopes of contexts of shape (N, 11): columns are the fields of Slope, then those of each zone.

        NaN where a zone has no restitution or stiffness of its own.
        """
        section, contact = self.slope_section, self.contact
        fields: list[Any] = [contexts[:, 0], section.length_m, section.gravity_m_s2]
        for k, zone in enumerate(self.zones):
            drawn = k == self._drawn_zone
            fields += [
                contexts[:, _ZONE] if drawn else zone.begin_m[0],
                math.inf if zone.end_m is None else zone.end_m,
                contexts[:, _ZONE + 1] if drawn else zone.friction[0],
                contact.rolling_arm_m if zone.rolling_arm_m is None else zone.rolling_arm_m,
                contact.corner_rolling_arm_m if zone.corner_rolling_arm_m is None else zone.corner_rolling_arm_m,
                math.nan if zone.restitution is None else zone.restitution,
                math.nan if zone.stiffness_n_m is None else zone.stiffness_n_m,
            ]
        return _rows(len(contexts), fields)

    def settings(self, solver: Solver = "compliant") -> Settings:
        """Return how its descents are simulated."""
        return Settings(
            solver=solver,
            max_time=self.limits.max_time_s,
            max_rebounds=self.limits.max_rebounds,
            end_on_chord=self.ends.on_chord,
            end_touching=self.ends.touching,
            run_out=self.slope_section.run_out_m,
        )

    def launch(
        self,
        context: Context,
        orientation: float | None = None,
        spin: float | None = None,
        speed: float | None = None,
    ) -> State:
        """Return the state at launch: the lowest point of the body lies ``context.drop`` above the slope.

        Parameters
        ----------
        context : Context
            The draw.
        orientation : float, optional
            phi [rad] in place of the context's.
        spin : float, optional
            omega [rad/s] in place of the context's.
        speed : float, optional
            u [m/s], along the slope, in place of the context's.

        Returns
        -------
        State
            With x = 0.

        Raises
        ------
        TypeError, ValueError
            If ``orientation``, ``spin`` or ``speed`` is not a finite number, or ``context`` is no context.
        """
        given = {"orientation": ("phi", orientation), "spin": ("omega", spin), "speed": ("u", speed)}
        own = {
            name: checked("State", field, value, FINITE) for name, (field, value) in given.items() if value is not None
        }
        return State(*self.launches(_alone(context, **own))[0].tolist())

    def launches(
        self, contexts: NDArray[np.float64], bodies: Body | Sequence[Body] | np.ndarray | None = None
    ) -> NDArray[np.float64]:
        """Return the states at launch of contexts of shape (N, 11): fields of State, shape (N, 6).

        ``bodies`` takes the place of the scenario's body: one, or bodies or
        records of kernel.outline.BODY, one a context.
        """
        _, _, _, speed, drop, fall, orientation, spin, *_ = contexts.T
        records = records_of(self.bodies(contexts) if bodies is None else bodies, len(contexts))
        y = drop + support_heights(records, within_a_turn(orientation))
        return _rows(len(contexts), (0.0, y, orientation, speed, 0.0 - fall, spin))


def check_split(split: str) -> None:
    """Raise ValueError unless ``split`` is one."""
    checked_choice("split", split, get_args(Split))


def scenario_names() -> tuple[str, ...]:
    """Return the names of the shipped scenarios, sorted."""
    return Scenario.names()


def load_scenario(name_or_path: str | os.PathLike[str]) -> Scenario:
    """Read a scenario.

    Parameters
    ----------
    name_or_path : str or path
        A name out of ``scenario_names()``, or the path of a file that ends in ``.yaml``.

    Returns
    -------
    Scenario
        Validated.

    Raises
    ------
    ScenarioError
        If there is no such scenario, or naming every wrong key of the file, its value and what is allowed.
    """
    return Scenario.load(name_or_path)


def _apart(draws: NDArray[np.float64], split: Split) -> NDArray[np.float64]:
    """Move draws in [0, 1) into the part of a split: half of its third of one of many cells."""
    check_split(split)
    i = get_args(Split).index(split)
    # The turn keeps equal draws of two splits far apart, the cells unequal ones at least a little.
    within, cell = np.modf(_CELLS * np.modf(draws + i * _TURN)[0])
    return (cell + (i + 0.5 * within) / 3.0) / _CELLS


def _alone(context: Context, **changes: float) -> NDArray[np.float64]:
    """Return a context as a table of one row, with some fields changed; raise TypeError if it is none."""
    return np.array([made("context", Context, context)._replace(**changes)], np.float64)


def _rows(rows: int, fields: Sequence[Any]) -> NDArray[np.float64]:
    """Return tuples as the rows of a table; each field is a number or an array of shape (rows,)."""
    table = np.empty((rows, len(fields)))
    for i, field in enumerate(fields):
        table[:, i] = field
    return table


@lru_cache
def _build(section: AnyBody) -> tuple[Body, ...]:
    return tuple(one.build() for one in (section.of if isinstance(section, ChoiceBody) else (section,)))


def _given(content: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in content.items() if value is not None}


def _radians(degrees: Pair) -> Pair:
    return math.radians(degrees[0]), math.radians(degrees[1])
