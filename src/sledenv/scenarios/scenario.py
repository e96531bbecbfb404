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

from sledenv.kernel import params
from sledenv.scenarios.configuration import Document, Pair
from sledenv.scenarios.sections import (
    AnyBody,
    ContactSection,
    ControlSection,
    EndsSection,
    LaunchSection,
    LimitsSection,
    RiderSection,
    SlopeSection,
)
from sledenv.simulation.bodies import Body, records_of
from sledenv.simulation.rules import FINITE, NOT_NEGATIVE, RESTITUTION, STEEPNESS, Rule, checked, made
from sledenv.simulation.scene import ContactLaw, Slope, State, asymmetry_of
from sledenv.simulation.settings import Settings, Solver
from sledenv.simulation.support import support_height, support_heights, within_a_turn

Split = Literal["train", "validation", "test"]
NOISY: Final = ("orientation", "spin")  # what launch noise disturbs, chosen or not

_CELLS = 2.0**20  # of each range: a split has a part of its own of every cell
_TURN = 0.5 * (math.sqrt(5.0) - 1.0)  # of the range, between the draws of two splits


class ScenarioError(ValueError):
    """A scenario that does not exist or is not valid; one line of the message for each problem."""


class _ContextFields(NamedTuple):
    angle: float  # [rad] of the slope
    friction: float  # [-] f
    restitution: float  # [-] e
    speed: float  # [m/s] along the slope
    drop: float  # [m] clearance of the lowest point of the body
    fall: float  # [m/s] towards the slope
    orientation: float  # [rad] phi at launch
    spin: float  # [rad/s] omega at launch


class Context(_ContextFields):
    """One draw from the ranges of a scenario: all that differs between two of its descents.

    Many contexts are an array of shape (N, 8) with these fields as columns. ``rules`` says what can be simulated,
    whatever the ranges of a scenario are; a context is checked where it is used.
    """

    __slots__ = ()
    rules: ClassVar[tuple[Rule, ...]] = (
        *(STEEPNESS, NOT_NEGATIVE, RESTITUTION),
        *(FINITE, NOT_NEGATIVE, FINITE, FINITE, FINITE),
    )


class Scenario(Document):
    """A family of descents: one body, one slope and the ranges that a context is drawn from.

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
    launch_section: Annotated[LaunchSection, Field(alias="launch")]
    control: ControlSection
    limits: LimitsSection
    ends: EndsSection = EndsSection()
    rider: RiderSection | None = None

    @model_validator(mode="after")
    def _ends_at_a_part_of_the_body(self) -> Self:
        name, parts = self.ends.touching, _build(self.body_section).parts
        if name is not None and name not in parts:
            raise ValueError(f"ends.touching = {name!r}: must be a part of the body: {', '.join(parts)}")
        return self

    @property
    def ranges(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest value of each field of ``Context``: two new arrays of shape (8,), in its units."""
        low, high = np.array(self._pairs()).T.copy()
        return low, high

    @property
    def hash(self) -> str:
        """Identity of what is simulated, 16 hex digits: words about it, such as title, sources and tags, do not count.

        Neither does a section, or a key of ``control``, that is not given, nor a rule of ``ends`` that is off.
        """
        content = self.model_dump(mode="json", exclude={"title", "question", "description", "sources", "tags"})
        content["control"] = _given(content["control"])
        content["ends"] = {rule: on for rule, on in content["ends"].items() if on} or None
        content = _given(content)
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]

    def sample(self, rng: np.random.Generator, split: Split | None = None) -> Context:
        """Draw a context, uniform in the ranges; every call takes eight doubles from ``rng``.

        Parameters
        ----------
        rng : Generator
        split : {"train", "validation", "test"}, optional
            As for :meth:`contexts`.
        """
        return Context(*self.contexts(rng.random(len(Context._fields)), split).tolist())

    def contexts(self, draws: NDArray[np.float64], split: Split | None = None) -> NDArray[np.float64]:
        """Return the contexts at relative places ``draws`` in [0, 1) of the ranges, both of shape (..., 8).

        Parameters
        ----------
        draws : ndarray, shape (..., 8)
        split : {"train", "validation", "test"}, optional
            Take a context of this split. Whatever the draws, two splits never share a value of a field that varies,
            and equal draws give contexts that differ by at least 0.23 of every range. Each split is dense in the ranges
            to a millionth and uniform.

        Raises
        ------
        ValueError
            For an unknown split.
        """
        low, high = self.ranges
        return np.minimum(low + (high - low) * (draws if split is None else _apart(draws, split)), high)

    def _pairs(self) -> tuple[Pair, ...]:
        """Range of each field of ``Context``."""
        launch = self.launch_section
        return (
            _radians(self.slope_section.angle_deg),
            self.contact.friction,
            self.contact.restitution_range,
            launch.speed_m_s,
            launch.drop_m,
            launch.fall_m_s,
            _radians(launch.orientation_deg),
            launch.spin_rad_s,
        )

    @property
    def control_bounds(self) -> dict[str, Pair]:
        """Lowest and highest value of each of ``CONTROLS`` that an agent may choose, in the units of the YAML keys."""
        return _given({control.name: getattr(self.control, key) for key, control in ControlSection.controls().items()})

    def body(self) -> Body:
        """Return the body of every context."""
        return _build(self.body_section)

    def law(self, context: Context) -> ContactLaw:
        """Return the contact law of a context."""
        context = made("context", Context, context)
        return ContactLaw._make(map(float, self._law(context.friction, context.restitution)))

    def laws(self, contexts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the contact laws of contexts of shape (N, 8): columns are the fields of ContactLaw, shape (N, 5)."""
        return _rows(len(contexts), self._law(contexts[:, 1], contexts[:, 2]))

    def _law(self, friction: Any, restitution: Any) -> params.ContactLaw:
        """Contact law, of numbers or of columns."""
        law = self.contact
        return params.ContactLaw(
            stiffness=law.stiffness_n_m,
            asymmetry=asymmetry_of(restitution),
            friction=friction,
            rolling_arm=law.rolling_arm_m,
            corner_rolling_arm=law.corner_rolling_arm_m,
        )

    def slope(self, context: Context) -> Slope:
        """Return the slope of a context."""
        return Slope(*self._slope(made("context", Context, context).angle))

    def slopes(self, contexts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the slopes of contexts of shape (N, 8): columns are the fields of Slope."""
        return _rows(len(contexts), self._slope(contexts[:, 0]))

    def _slope(self, angle: Any) -> params.Slope:
        """Slope, of a number or of a column."""
        section = self.slope_section
        return params.Slope(angle, section.length_m, section.gravity_m_s2)

    def settings(self, solver: Solver = "compliant") -> Settings:
        """Return how its descents are simulated."""
        return Settings(
            solver=solver,
            max_time=self.limits.max_time_s,
            max_rebounds=self.limits.max_rebounds,
            end_on_chord=self.ends.on_chord,
            end_touching=self.ends.touching,
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
        context = made("context", Context, context)
        phi = context.orientation if orientation is None else checked("State", "phi", orientation, FINITE)
        omega = context.spin if spin is None else checked("State", "omega", spin, FINITE)
        u = context.speed if speed is None else checked("State", "u", speed, FINITE)
        y = context.drop + support_height(self.body(), float(within_a_turn(np.array(phi))))
        return State(0.0, y, phi, u, 0.0 - context.fall, omega)

    def launches(self, contexts: NDArray[np.float64], bodies: Body | np.ndarray | None = None) -> NDArray[np.float64]:
        """Return the states at launch of contexts of shape (N, 8): fields of State, shape (N, 6).

        ``bodies`` takes the place of the scenario's body: one, or records of kernel.outline.BODY, one a context.
        """
        *_, speed, drop, fall, orientation, spin = contexts.T
        records = records_of(self.body() if bodies is None else bodies, len(contexts))
        y = drop + support_heights(records, within_a_turn(orientation))
        return _rows(len(contexts), (0.0, y, orientation, speed, 0.0 - fall, spin))


def check_split(split: str) -> None:
    """Raise ValueError unless ``split`` is one."""
    if split not in get_args(Split):
        raise ValueError(f"split = {split!r}: must be one of {', '.join(map(repr, get_args(Split)))}")


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


def _rows(rows: int, fields: Sequence[Any]) -> NDArray[np.float64]:
    """Return tuples as the rows of a table; each field is a number or an array of shape (rows,)."""
    table = np.empty((rows, len(fields)))
    for i, field in enumerate(fields):
        table[:, i] = field
    return table


@lru_cache
def _build(section: AnyBody) -> Body:
    return section.build()


def _given(content: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in content.items() if value is not None}


def _radians(degrees: Pair) -> Pair:
    return math.radians(degrees[0]), math.radians(degrees[1])
