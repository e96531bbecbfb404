"""Scenarios: validated YAML, its units, the contexts sampled from it and what it hands to the simulator."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import reprlib
import sys
from collections.abc import Collection
from difflib import get_close_matches
from functools import lru_cache
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal, NamedTuple, Self, get_args

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    StrictBool,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic_core import CoreSchema, ErrorDetails, core_schema

from sledenv.geometry import support_heights, within_a_turn
from sledenv.params import (
    FINITE,
    NOT_NEGATIVE,
    RESTITUTION,
    STEEPNESS,
    Body,
    ContactLaw,
    Rule,
    Slope,
    State,
    asymmetry_of,
    checked,
    circular_segment,
    holds_its_mass_centre,
    least_eccentricity,
    made,
    sled,
    sled_rise,
)

Pair = tuple[float, float]
Split = Literal["train", "validation", "test"]
CONFIGS: Final = Path(__file__).parent / "configs"  # all that ships as YAML: scenarios, studies, suites, settings
BOTH: Final = ("orientation", "spin")  # what the word "both" lets an agent choose
NOISY: Final = ("orientation", "spin")  # what launch noise disturbs, chosen or not

_NUMBERS = {  # tags of YAML, and how they are written here
    "tag:yaml.org,2002:int": r"[-+]?(0|[1-9][0-9]*)$",
    "tag:yaml.org,2002:float": r"[-+]?((0|[1-9][0-9]*|(?=\.[0-9]))(\.[0-9]*)?([eE][-+]?[0-9]+)?|\.inf)$|\.nan$",
}
_CELLS = 2.0**20  # of each range: a split has a part of its own of every cell
_TURN = 0.5 * (math.sqrt(5.0) - 1.0)  # of the range, between the draws of two splits


class ScenarioError(ValueError):
    """A scenario that does not exist or is not valid; one line of the message for each problem."""


class Quantity:
    """What a key accepts: a number in an interval that is written with its unit, as in ``"(0, 90] deg"``.

    Attributes
    ----------
    interval : str
        As it is written.
    allowed : str
        The same in words.
    unit : str
    ends : pair of float
        Lowest and highest number; whether they are in the interval themselves, :meth:`number` tells.
    """

    form: ClassVar[str] = "a number"

    def __init__(self, interval: str) -> None:
        parsed = re.fullmatch(r"([\[(])(\S+), (\S+)([\])]) ?(.*)", interval)
        if parsed is None:
            raise ValueError(f"not an interval: {interval!r}")
        self.interval = interval
        self.allowed = f"{self.form} in {interval}"
        self.unit = parsed[5]
        self._open = parsed[1] == "(", parsed[4] == ")"
        # An infinite end admits every finite number.
        self.ends = max(float(parsed[2]), -sys.float_info.max), min(float(parsed[3]), sys.float_info.max)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        schema = core_schema.no_info_plain_validator_function(self.read)
        return core_schema.nullable_schema(schema) if type(None) in get_args(source) else schema

    def read(self, value: Any) -> Any:
        """Return what a key is given as it is kept, or raise ValueError."""
        return self.number(value)

    def number(self, value: Any) -> float:
        """Return a number of the interval as a float, or raise ValueError."""
        (low, high), (low_open, high_open) = self.ends, self._open
        if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
            raise ValueError(f"must be {self.allowed}")
        if not low <= value <= high or (low_open and value == low) or (high_open and value == high):
            raise ValueError(f"must be {self.allowed}")
        return float(value) + 0.0  # -0.0 becomes 0.0


class Whole(Quantity):
    """A whole number of an interval."""

    form = "a whole number"

    def read(self, value: Any) -> int:
        """Return a whole number, or raise ValueError."""
        if self.number(value) != int(value):
            raise ValueError(f"must be {self.allowed}")
        return int(value)


class _Bounds(Quantity):
    form = "a pair [low, high] of numbers"

    def read(self, value: Any) -> Pair:
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise ValueError(f"must be {self.allowed}")
        low, high = self.number(value[0]), self.number(value[1])
        self.compare(low, high)
        return low, high

    def compare(self, low: float, high: float) -> None:
        if low >= high:
            raise ValueError(f"low must be below high; must be {self.allowed}")


class _Range(_Bounds):
    form = "a number, or a pair [low, high] to sample,"

    def read(self, value: Any) -> Pair:
        return super().read(value if isinstance(value, list | tuple) else (value, value))

    def compare(self, low: float, high: float) -> None:
        if low > high:
            raise ValueError(f"low must not exceed high; must be {self.allowed}")


class LaunchControl(_Bounds):
    """Marks a key of ``ControlSection`` that holds bounds: what an agent may choose of the launch within them.

    Parameters
    ----------
    interval : str
        Which bounds are allowed, with their unit. Those in deg are radians in a context.
    name : str
        Field of ``Context`` in whose place the choice stands.
    printed : str
        Format of a value, for a reader.
    searched : int
        Values on the grid of the oracle.
    drawn : int
        Values along an axis of the map of one context.
    turn : float
        Values that differ by this are the same launch; 0 where none are.
    """

    def __init__(self, interval: str, name: str, *, printed: str, searched: int, drawn: int, turn: float = 0.0) -> None:
        super().__init__(interval)
        self.name = name
        self.printed = printed
        self.searched = searched
        self.drawn = drawn
        self.turn = turn


class Section(BaseModel):
    """A mapping of a file of configuration: immutable, and without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", serialize_by_alias=True)

    @classmethod
    def quantities(cls) -> dict[str, Quantity]:
        """Return what the keys that are numbers accept."""
        fields = cls.model_fields.items()
        return {key: mark for key, field in fields for mark in field.metadata if isinstance(mark, Quantity)}

    @classmethod
    def explain(cls, error: ErrorDetails) -> str:
        """Return what is wrong with a key, its value and what is allowed; the whole mapping has no key."""
        key = ".".join(map(str, error["loc"]))
        match error["type"]:
            case "missing":
                return f"{key}: missing"
            case "extra_forbidden":
                return f"{key}: unknown key; known: {', '.join(cls.model_fields)}"
            case "value_error":
                text = str(error["ctx"]["error"])
            case _:
                text = error["msg"]
        return f"{key} = {reprlib.repr(error['input'])}: {text}" if key else text


class DiscBody(Section):
    """A full disc whose mass centre lies off its axis."""

    kind: Literal["disc"]
    mass_kg: Annotated[float, Quantity("(0, inf) kg")]
    radius_m: Annotated[float, Quantity("(0, inf) m")]
    eccentricity_m: Annotated[float, Quantity("[0, inf) m")]
    inertia_kg_m2: Annotated[float, Quantity("(0, inf) kg m^2")]  # about the mass centre

    @field_validator("eccentricity_m")
    @classmethod
    def _mass_centre_inside(cls, eccentricity: float, info: ValidationInfo) -> float:
        radius = info.data.get("radius_m", math.inf)
        if eccentricity >= radius:
            raise ValueError(f"must be a number in [0, radius_m) = [0, {radius:g}) m")
        return eccentricity

    @field_validator("inertia_kg_m2")
    @classmethod
    def _mass_within_the_rim(cls, inertia: float, info: ValidationInfo) -> float:
        if {"mass_kg", "radius_m", "eccentricity_m"} <= info.data.keys():
            mass, radius, eccentricity = (info.data[key] for key in ("mass_kg", "radius_m", "eccentricity_m"))
            highest = mass * (radius - eccentricity) * (radius + eccentricity)
            if not highest < math.inf:
                raise ValueError("m r^2 must be a finite number of kg m^2")
            if inertia > highest * (1.0 + 1e-9):
                raise ValueError(f"must be a number in (0, m (r^2 - h^2)] = (0, {highest:g}] kg m^2")
        return inertia

    def build(self) -> Body:
        """Return the body of the simulator."""
        return Body(self.mass_kg, self.radius_m, self.eccentricity_m, self.inertia_kg_m2)


class SegmentBody(Section):
    """A uniform lamina bounded by an arc and its chord."""

    kind: Literal["segment"]
    mass_kg: Annotated[float, Quantity("(0, inf) kg")]
    radius_m: Annotated[float, Quantity("(0, inf) m")]
    half_angle_deg: Annotated[float, Quantity("(0, 180] deg")]  # of the arc

    def build(self) -> Body:
        """Return the body of the simulator."""
        return circular_segment(self.mass_kg, self.radius_m, math.radians(self.half_angle_deg))


class SledBody(Section):
    """A sled with its rider: runners bent to an arc, closed by the chord between their ends."""

    kind: Literal["sled"]
    mass_kg: Annotated[float, Quantity("(0, inf) kg")]
    length_m: Annotated[float, Quantity("(0, inf) m")]
    rocker_radius_m: Annotated[float, Quantity("(0, inf) m")]  # of the runners
    mass_centre_height_m: Annotated[float, Quantity("[0, inf) m")]  # above the middle of the runners
    gyration_radius_m: Annotated[float, Quantity("(0, inf) m")]  # about the mass centre

    @field_validator("rocker_radius_m")
    @classmethod
    def _reaches_both_ends(cls, radius: float, info: ValidationInfo) -> float:
        length = info.data.get("length_m", 0.0)
        if radius < 0.5 * length:
            raise ValueError(f"must be a number in [length_m / 2, inf) = [{0.5 * length:g}, inf) m")
        return radius

    @field_validator("mass_centre_height_m")
    @classmethod
    def _mass_centre_inside(cls, height: float, info: ValidationInfo) -> float:
        if {"length_m", "rocker_radius_m"} <= info.data.keys():
            rise = sled_rise(info.data["length_m"], info.data["rocker_radius_m"])
            if height > rise:
                raise ValueError(
                    f"must be a number in [0, {rise:g}] m: the chord between the runners' ends closes the body"
                )
        return height

    def build(self) -> Body:
        """Return the body of the simulator."""
        given = self.length_m, self.rocker_radius_m, self.mass_centre_height_m, self.gyration_radius_m
        return sled(self.mass_kg, *given)


class CustomBody(Section):
    """Any body of the simulator."""

    kind: Literal["custom"]
    mass_kg: Annotated[float, Quantity("(0, inf) kg")]
    radius_m: Annotated[float, Quantity("[0, inf) m")]
    eccentricity_m: Annotated[float, Quantity("[0, inf) m")]
    inertia_kg_m2: Annotated[float, Quantity("(0, inf) kg m^2")]  # about the mass centre
    half_angle_deg: Annotated[float, Quantity("(0, 180] deg")] = 180.0

    @model_validator(mode="after")
    def _mass_centre_inside(self) -> Self:
        half_angle = math.radians(self.half_angle_deg)
        if not holds_its_mass_centre(self.radius_m, self.eccentricity_m, half_angle):
            least = least_eccentricity(self.radius_m, half_angle)
            allowed = f"[max(radius_m cos(half_angle_deg), 0), radius_m] = [{least:g}, {self.radius_m:g}] m"
            raise ValueError(f"eccentricity_m = {self.eccentricity_m:g}: must be a number in {allowed}")
        return self

    def build(self) -> Body:
        """Return the body of the simulator."""
        half_angle = math.radians(self.half_angle_deg)
        return Body(self.mass_kg, self.radius_m, self.eccentricity_m, self.inertia_kg_m2, half_angle)


class SlopeSection(Section):
    """The incline."""

    angle_deg: Annotated[Pair, _Range("(-90, 90) deg")]  # positive downhill
    length_m: Annotated[float, Quantity("(0, inf) m")]
    gravity_m_s2: Annotated[float, Quantity("[0, inf) m/s^2")] = 9.81


class ContactSection(Section):
    """How the body touches the slope; either ``restitution`` or ``asymmetry``."""

    stiffness_n_m: Annotated[float, Quantity("(0, inf) N/m")]
    restitution: Annotated[Pair | None, _Range("(0, 1]")] = None
    asymmetry: Annotated[float | None, Quantity("[0, 1)")] = None
    friction: Annotated[Pair, _Range("[0, inf)")]
    rolling_arm_m: Annotated[float, Quantity("[0, inf) m")]
    corner_rolling_arm_m: Annotated[float, Quantity("[0, inf) m")] = 0.0

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.restitution is None) == (self.asymmetry is None):
            have = "both are given" if self.asymmetry is not None else "both are missing"
            raise ValueError(f"must have either restitution in (0, 1] or asymmetry in [0, 1), but {have}")
        return self

    @property
    def restitution_range(self) -> Pair:
        """Lowest and highest coefficient of restitution [-], whichever key gave it."""
        if self.restitution is not None:
            return self.restitution
        assert self.asymmetry is not None  # by _one_of_two
        restitution = math.sqrt((1.0 - self.asymmetry) / (1.0 + self.asymmetry))
        return restitution, restitution


class LaunchSection(Section):
    """How the body is let go."""

    speed_m_s: Annotated[Pair, _Range("[0, inf) m/s")]  # along the slope, downhill, unless the agent chooses it
    drop_m: Annotated[Pair, _Range("[0, inf) m")]  # clearance of the lowest point of the body
    fall_m_s: Annotated[Pair, _Range("[0, inf) m/s")] = (0.0, 0.0)  # towards the slope
    orientation_deg: Annotated[Pair, _Range("[-360, 360] deg")] = (0.0, 0.0)  # unless the agent chooses it
    spin_rad_s: Annotated[Pair, _Range("(-inf, inf) rad/s")] = (0.0, 0.0)  # unless the agent chooses it


class ControlSection(Section):
    """What an agent may choose of the launch, within which bounds and how exactly.

    A key that is a ``LaunchControl`` is all that there is to a control; its order here is that of the actions. One that
    is None by default is optional.
    """

    orientation_deg: Annotated[
        Pair,
        LaunchControl("[-360, 360] deg", "orientation", printed="8.2f", searched=72, drawn=180, turn=360.0),
    ]
    spin_rad_s: Annotated[
        Pair,
        LaunchControl("(-inf, inf) rad/s", "spin", printed="7.3f", searched=33, drawn=81),
    ]
    speed_m_s: Annotated[
        Pair | None,
        LaunchControl("[0, inf) m/s", "speed", printed="7.3f", searched=9, drawn=81),
    ] = None
    chosen: str = "both"  # a word of control_words, unless an environment is made with another
    noise_orientation_deg: Annotated[float, Quantity("[0, inf) deg")] = 0.0  # standard deviations at launch
    noise_spin_rad_s: Annotated[float, Quantity("[0, inf) rad/s")] = 0.0

    @field_validator("chosen")
    @classmethod
    def _offered(cls, word: str, info: ValidationInfo) -> str:
        # A key whose bounds are wrong is not in the data; it has its own message.
        given = [control.name for key, control in cls.controls().items() if info.data.get(key, key) is not None]
        words = control_words(given)
        if word not in words:
            raise ValueError(f"must be one of {', '.join(map(repr, words))}")
        return word

    @classmethod
    def controls(cls) -> dict[str, LaunchControl]:
        """Return the controls by key."""
        fields = cls.model_fields.items()
        return {key: mark for key, field in fields for mark in field.metadata if isinstance(mark, LaunchControl)}


CONTROLS: Final = {mark.name: mark for mark in ControlSection.controls().values()}


def control_words(offered: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Return what each word lets an agent choose, in the order of its actions, if ``offered`` of ``CONTROLS`` are."""
    names = [name for name in CONTROLS if name in offered]
    several = (each for count in range(1, len(names) + 1) for each in combinations(names, count))
    return {"both": BOTH} | {"+".join(each): each for each in several} | {"all": tuple(names)}


class RiderSection(Section):
    """A rider who can trim the spin in flight, with a rotor inside the body: docs/physics.md, section 9."""

    trim_rad_s: Annotated[float, Quantity("(0, inf) rad/s")]  # most spin that the rotor lends to the body
    rotor_inertia_kg_m2: Annotated[float, Quantity("(0, inf) kg m^2")]


class LimitsSection(Section):
    """Where a descent is given up."""

    max_time_s: Annotated[float, Quantity("(0, inf) s")]
    max_rebounds: Annotated[int, Whole("[1, 1000000]")]


class EndsSection(Section):
    """What ends a descent beyond the mechanics: a rider who has fallen does not go on."""

    on_chord: StrictBool = False  # lying on the chord, both ends settled


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


class Scenario(Section):
    """A family of descents: one body, one slope and the ranges that a context is drawn from.

    The keys are those of the YAML file, with their units; ``slope``, ``body`` and ``launch`` are read as
    ``slope_section``, ``body_section`` and ``launch_section``. Instances are immutable, hashable and picklable.
    """

    id: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    title: str
    question: str = ""  # what a launch, or an agent that chooses it, is asked
    description: str = ""
    sources: str = ""  # where the numbers come from
    tags: tuple[str, ...] = ()
    slope_section: Annotated[SlopeSection, Field(alias="slope")]
    body_section: Annotated[DiscBody | SegmentBody | SledBody | CustomBody, Field(alias="body", discriminator="kind")]
    contact: ContactSection
    launch_section: Annotated[LaunchSection, Field(alias="launch")]
    control: ControlSection
    limits: LimitsSection
    ends: EndsSection = EndsSection()
    rider: RiderSection | None = None

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Build a scenario from a mapping that has the keys of the YAML file.

        Raises
        ------
        ScenarioError
            Naming every wrong key, its value and what is allowed.
        """
        name = obj.get("id", "without id") if isinstance(obj, dict) else "without id"
        return cls._read(obj, f"scenario {name}", options)

    @classmethod
    def _read(cls, obj: Any, source: str, options: dict[str, Any]) -> Self:
        try:
            return super().model_validate(obj, **options)
        except ValidationError as error:
            problems = [f"{source}: {_explain(details)}" for details in error.errors()]
        raise ScenarioError("\n".join(problems))

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
        return ContactLaw(*self.laws(np.array([made("context", Context, context)]))[0].tolist())

    def laws(self, contexts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the contact laws of contexts of shape (N, 8): columns are the fields of ContactLaw, shape (N, 5)."""
        _, friction, restitution, *_ = contexts.T
        law = self.contact
        return _rows(
            ContactLaw,
            len(contexts),
            stiffness=law.stiffness_n_m,
            asymmetry=asymmetry_of(restitution),
            friction=friction,
            rolling_arm=law.rolling_arm_m,
            corner_rolling_arm=law.corner_rolling_arm_m,
        )

    def slope(self, context: Context) -> Slope:
        """Return the slope of a context."""
        return Slope(*self.slopes(np.array([made("context", Context, context)]))[0].tolist())

    def slopes(self, contexts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the slopes of contexts of shape (N, 8): columns are the fields of Slope."""
        section = self.slope_section
        slope = Slope(0.0, section.length_m, section.gravity_m_s2)
        return _rows(Slope, len(contexts), **slope._asdict() | {"angle": contexts[:, 0]})

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
        launches = self.launches(np.array([context._replace(orientation=phi, spin=omega, speed=u)]))
        return State(*launches[0].tolist())

    def launches(
        self, contexts: NDArray[np.float64], bodies: Body | NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Return the states at launch of contexts of shape (N, 8): fields of State, shape (N, 6).

        ``bodies`` takes the place of the scenario's body: one, or the fields of one a context, shape (N, 5).
        """
        *_, speed, drop, fall, orientation, spin = contexts.T
        height = drop + support_heights(self.body() if bodies is None else bodies, within_a_turn(orientation))
        return _rows(State, len(contexts), x=0.0, y=height, phi=orientation, u=speed, v=0.0 - fall, omega=spin)


def check_split(split: str) -> None:
    """Raise ValueError unless ``split`` is one."""
    if split not in get_args(Split):
        raise ValueError(f"split = {split!r}: must be one of {', '.join(map(repr, get_args(Split)))}")


def scenario_names() -> tuple[str, ...]:
    """Return the names of the shipped scenarios, sorted."""
    return shipped_names("scenario")


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
    return Scenario._read(*read_config(name_or_path, "scenario", ScenarioError), {})


def read_config(
    name_or_path: str | os.PathLike[str], kind: Literal["scenario", "study"], error: type[ScenarioError]
) -> tuple[Any, str]:
    """Read a shipped file by its name or any by its path; return what it holds and what messages call it.

    Raises
    ------
    ScenarioError
        Of the type ``error``, if there is no such file or it is no YAML.
    """
    if not isinstance(name_or_path, str | os.PathLike):
        raise TypeError(f"{kind} = {name_or_path!r}: must be the name of one or the path of a file")
    name, known = os.fspath(name_or_path), shipped_names(kind)
    if name.endswith((".yaml", ".yml")):
        source, file = name, Path(name)
    elif name in known:
        source, file = f"{name}.yaml", _shipped(kind) / f"{name}.yaml"
    else:
        raise error(f"unknown {kind} {name!r}{_hint(name, known)}; known: {', '.join(known)}; a file ends in .yaml")
    try:
        return read_yaml(file), source
    except (OSError, ValueError) as problem:
        raise error(f"{source}: cannot be read: {' '.join(str(problem).split())}") from problem


def read_yaml(file: Path) -> Any:
    """Read plain data from a file, with less of YAML than there is: see the documentation of scenarios.

    Raises
    ------
    OSError, ValueError
        If it cannot be read.
    """
    try:
        return yaml.load(file.read_text(encoding="utf-8"), _Loader)
    except yaml.YAMLError as problem:
        raise ValueError(str(problem)) from problem
    except RecursionError:
        raise ValueError("nested too deeply") from None


def shipped_names(kind: Literal["scenario", "study"]) -> tuple[str, ...]:
    """Return the names of the shipped files of a kind, sorted."""
    files = (entry.name for entry in _shipped(kind).iterdir())
    return tuple(sorted(name.removesuffix(".yaml") for name in files if name.endswith(".yaml")))


def _shipped(kind: Literal["scenario", "study"]) -> Path:
    return CONFIGS / {"scenario": "scenarios", "study": "studies"}[kind]


class _Loader(yaml.SafeLoader):
    """YAML in which a number is decimal, as in 1.2, and a repeated key or a reference to another place an error."""

    def compose_node(self, parent: Any, index: Any) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):  # a few lines of them can stand for gigabytes
            event = self.get_event()  # type: ignore[no-untyped-call]
            raise yaml.composer.ComposerError(None, None, f"*{event.anchor} refers to another place", event.start_mark)
        return super().compose_node(parent, index)

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        seen = set()
        for key in (key for key, _ in node.value if isinstance(key, yaml.ScalarNode)):
            if key.value in seen:
                raise yaml.constructor.ConstructorError(None, None, f"repeated key {key.value!r}", key.start_mark)
            seen.add(key.value)
        return node


# Without the numbers of YAML 1.1, to which 010 is 8, 1:30 is 90 and 1e7 is text.
_Loader.yaml_implicit_resolvers = {
    first: [(tag, form) for tag, form in known if tag not in _NUMBERS]
    for first, known in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
for _tag, _form in _NUMBERS.items():
    _Loader.add_implicit_resolver(_tag, re.compile(_form), list("-+.0123456789"))

BODIES: dict[str, type[Section]] = {"disc": DiscBody, "segment": SegmentBody, "sled": SledBody, "custom": CustomBody}
_SECTIONS = (BODIES | {"rider": RiderSection}) | {
    field.alias or name: field.annotation
    for name, field in Scenario.model_fields.items()
    if isinstance(field.annotation, type) and issubclass(field.annotation, Section)
}
_WORDING = {
    "model_type": "must be a mapping of keys to values",
    "model_attributes_type": "must be a mapping of keys to values",
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "string_pattern_mismatch": "must be lower-case letters, digits and underscores",
    "tuple_type": "must be a list of words",
}


def _explain(error: ErrorDetails) -> str:
    """Return one line for one validation error: the dotted key, its value and what is allowed."""
    location = error["loc"]
    path = ".".join(str(part) for i, part in enumerate(location) if not (i == 1 and location[0] == "body"))
    owner = Scenario if len(location) < 2 else _SECTIONS.get(str(location[-2]), Scenario)
    fields = {field.alias or name: field for name, field in owner.model_fields.items()}
    value = reprlib.repr(error["input"])
    match error["type"]:
        case "missing":
            quantities = [item for item in fields[str(location[-1])].metadata if isinstance(item, Quantity)]
            return f"{path}: missing" + "".join(f"; must be {quantity.allowed}" for quantity in quantities)
        case "extra_forbidden":
            return f"{path} = {value}: unknown key{_hint(str(location[-1]), fields)}; known: {', '.join(fields)}"
        case "union_tag_not_found":
            return f"{path}.kind: missing; must be one of {', '.join(BODIES)}"
        case "union_tag_invalid":
            tag = str(error["ctx"]["tag"])
            return f"{path}.kind = {tag!r}: must be one of {', '.join(BODIES)}{_hint(tag, BODIES)}"
        case "value_error":
            text = str(error["ctx"]["error"])
        case other:
            text = _WORDING.get(other, error["msg"])
    if isinstance(error["input"], dict) or not path:
        return f"{path or 'the file'}: {text}"
    return f"{path} = {value}: {text}"


def _hint(word: str, known: Any) -> str:
    """Return a suggestion for a misspelt word, empty if nothing is near."""
    nearest = get_close_matches(word, known, n=1)
    return f" (did you mean {nearest[0]!r}?)" if nearest else ""


def _apart(draws: NDArray[np.float64], split: Split) -> NDArray[np.float64]:
    """Move draws in [0, 1) into the part of a split: half of its third of one of many cells."""
    check_split(split)
    i = get_args(Split).index(split)
    # The turn keeps equal draws of two splits far apart, the cells unequal ones at least a little.
    within, cell = np.modf(_CELLS * np.modf(draws + i * _TURN)[0])
    return (cell + (i + 0.5 * within) / 3.0) / _CELLS


def _rows(kind: type[Any], rows: int, **fields: Any) -> NDArray[np.float64]:
    """Return tuples of a kind as the rows of a table; each field is a number or an array of shape (rows,)."""
    table = np.empty((rows, len(fields)))
    for name, field in fields.items():
        table[:, kind._fields.index(name)] = field
    return table


@lru_cache
def _build(section: DiscBody | SegmentBody | SledBody | CustomBody) -> Body:
    return section.build()


def _given(content: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in content.items() if value is not None}


def _radians(degrees: Pair) -> Pair:
    return math.radians(degrees[0]), math.radians(degrees[1])
