"""Sections of a scenario's file: slope, contact, launch, what an agent chooses, and how a descent ends."""

from __future__ import annotations

import math
from collections.abc import Collection
from functools import lru_cache
from itertools import combinations
from typing import Annotated, Final, Self

import numpy as np
from pydantic import StrictBool, StrictStr, ValidationInfo, field_validator, model_validator

from sledenv.scenarios.configuration import Bounds, OneOrSeveral, Pair, Points, Quantity, Range, Section, Whole
from sledenv.simulation.bends import MOST_VERTICES, STEEPEST
from sledenv.simulation.scene import AIR_DENSITY, Profile, checked_profile
from sledenv.simulation.terrain import too_steep

BOTH: Final = ("orientation", "spin")  # what the word "both" lets an agent choose


class LaunchControl(Bounds):
    """Marks a key of ``ControlSection`` that holds bounds: what an agent may choose of the launch within them.

    Parameters
    ----------
    interval : str
        Which bounds are allowed, with their unit. Those in deg are radians in a context.
    name : str
        Field of ``Context`` in whose place the choice stands.
    printed : str
        Format of a value, for a reader.
    drawn : int
        Values along an axis of the map of one context.
    turn : float
        Values that differ by this are the same launch; 0 where none are.
    """

    def __init__(self, interval: str, name: str, *, printed: str, drawn: int, turn: float = 0.0) -> None:
        super().__init__(interval)
        self.name = name
        self.printed = printed
        self.drawn = drawn
        self.turn = turn


class BumpsSection(Section):
    """Bumps one behind the other, drawn anew for each context: level ground, a face, a top, a back down again."""

    height_m: Annotated[Pair, Range("[0.001, inf) m")]
    face_m: Annotated[Pair, Range("[0.001, inf) m")]  # length along the slope on which it rises
    top_m: Annotated[Pair, Range("[0, inf) m")]
    gap_m: Annotated[Pair, Range("[0, inf) m")]  # level ground before each bump
    back_m: Annotated[Pair | None, Range("[0.001, inf) m")] = (
        None  # on which it falls; as long as its face unless given
    )
    start_m: Annotated[float | None, Quantity("[0, inf) m")] = None  # of the first gap; the size of the body by default
    rounding_m: Annotated[float, Quantity("[0, inf) m")] = 0.0  # radius of all vertices

    @model_validator(mode="after")
    def _not_too_steep(self) -> Self:
        for key, (shortest, _) in (("face_m", self.face_m), ("back_m", self.back_m or self.face_m)):
            least = self.height_m[1] / math.tan(STEEPEST)
            if shortest < least:
                steepest = f"a piece may be {math.degrees(STEEPEST):g} degrees steep at most"
                allowed = f"at least {least:.4g} m, for bumps {self.height_m[1]:g} m high: {steepest}"
                raise ValueError(f"{key} = {shortest:g}: must be {allowed}; make it longer or height_m lower")
        return self


class SlopeSection(Section):
    """The incline, and the ground over it: none, vertices or bumps."""

    angle_deg: Annotated[Pair, Range("(-90, 90) deg")]  # positive downhill
    length_m: Annotated[float, Quantity("(0, inf) m")]
    gravity_m_s2: Annotated[float, Quantity("[0, inf) m/s^2")] = 9.81
    air_density_kg_m3: Annotated[float, Quantity("[0, inf) kg/m^3")] = AIR_DENSITY  # felt by bodies with a drag area
    run_out_m: Annotated[float, Quantity("[0, inf) m")] = 0.0  # behind the finish, where a fall still counts
    profile_m: Annotated[tuple[Pair, ...] | None, Points("(-inf, inf) m", 2, MOST_VERTICES)] = None
    rounding_m: Annotated[float | tuple[float, ...], OneOrSeveral("[0, inf) m")] = 0.0  # of its vertices
    # What ``Scenario`` reads before: it puts into ``profile_m`` and ``rounding_m`` what is in the file.
    profile_file: StrictStr | None = None
    tolerance_m: Annotated[float | None, Quantity("(0, inf) m")] = None
    steepest_deg: Annotated[float | None, Quantity("(0, 80] deg")] = None  # up to which steep faces are filled up
    bumps: BumpsSection | None = None

    @field_validator("profile_m")
    @classmethod
    def _goes_on(cls, profile: tuple[Pair, ...] | None) -> tuple[Pair, ...] | None:
        if profile is not None:
            check_vertices(profile)
        return profile

    @field_validator("rounding_m")
    @classmethod
    def _of_each_vertex(cls, rounding: float | tuple[float, ...], info: ValidationInfo) -> float | tuple[float, ...]:
        profile = info.data.get("profile_m")
        if "profile_m" in info.data and profile is None and rounding != 0.0:
            raise ValueError("must be left out without profile_m; bumps have a rounding_m of their own")
        if isinstance(rounding, tuple) and profile is not None and len(rounding) != len(profile):
            raise ValueError(f"must hold one for each of {len(profile)} vertices, or be one number")
        return rounding

    @field_validator("bumps")
    @classmethod
    def _or_a_profile(cls, bumps: BumpsSection | None, info: ValidationInfo) -> BumpsSection | None:
        if bumps is not None and info.data.get("profile_m") is not None:
            raise ValueError("must be left out where there is a profile, or the profile must")
        return bumps

    @property
    def profile(self) -> Profile:
        """Vertices of the ground that is the same in all contexts: see :class:`sledenv.Slope`."""
        return _profile(self)


def check_vertices(profile: tuple[Pair, ...]) -> None:
    """Raise ValueError if x does not increase from vertex to vertex, or if a piece is too steep."""
    x, _ = (vertices := np.array(profile)).T
    falls = np.flatnonzero(np.diff(x) <= 0.0)
    if falls.size:
        k = int(falls[0]) + 1
        raise ValueError(f"x of vertex {k} is {x[k]:g}: must be > that of the vertex before, {x[k - 1]:g} m")
    if (problem := too_steep(vertices)) is not None:
        k, text = problem
        raise ValueError(f"the piece from vertex {k - 1} to {k} {text}; move a vertex, or tilt the plane")


@lru_cache
def _profile(section: SlopeSection) -> Profile:
    return checked_profile(section.profile_m or (), section.rounding_m)


class ZoneSection(Section):
    """A part of the slope with a surface of its own, along the places of the contact point."""

    begin_m: Annotated[Pair, Range("(-inf, inf) m")]
    end_m: Annotated[float | None, Quantity("(-inf, inf) m")] = None  # without one it goes on in the run-out
    # What ``Scenario`` reads before, in place of both.
    pieces: tuple[int, int] | None = None  # first and last one of the profile
    material: StrictStr | None = None  # a name in the file of the profile
    friction: Annotated[Pair, Range("[0, inf)")]
    rolling_arm_m: Annotated[float | None, Quantity("[0, inf) m")] = None  # that of the contact by default
    corner_rolling_arm_m: Annotated[float | None, Quantity("[0, inf) m")] = None
    restitution: Annotated[float | None, Quantity("(0, 1]")] = None  # of contacts that begin in the zone
    stiffness_n_m: Annotated[float | None, Quantity("(0, inf) N/m")] = None

    @field_validator("end_m")
    @classmethod
    def _behind_its_begin(cls, end: float | None, info: ValidationInfo) -> float | None:
        _, latest = info.data.get("begin_m", (0.0, 0.0))
        if end is not None and end <= latest:
            raise ValueError(f"must be a number in ({latest:g}, inf) m, behind where the zone may begin")
        return end

    @property
    def varies(self) -> bool:
        """Whether its begin or its friction is drawn."""
        return self.begin_m[0] < self.begin_m[1] or self.friction[0] < self.friction[1]


class ContactSection(Section):
    """How the body touches the slope; either ``restitution`` or ``asymmetry``."""

    stiffness_n_m: Annotated[float, Quantity("(0, inf) N/m")]
    restitution: Annotated[Pair | None, Range("(0, 1]")] = None
    asymmetry: Annotated[float | None, Quantity("[0, 1)")] = None
    friction: Annotated[Pair, Range("[0, inf)")]
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

    speed_m_s: Annotated[Pair, Range("[0, inf) m/s")]  # along the slope, downhill, unless the agent chooses it
    drop_m: Annotated[Pair, Range("[0, inf) m")]  # clearance of the lowest point of the body
    fall_m_s: Annotated[Pair, Range("[0, inf) m/s")] = (0.0, 0.0)  # towards the slope
    # Unless the agent chooses them; 0 if not given, or in a ride all that an agent may choose.
    orientation_deg: Annotated[Pair | None, Range("[-360, 360] deg")] = None
    spin_rad_s: Annotated[Pair | None, Range("(-inf, inf) rad/s")] = None


class ControlSection(Section):
    """Launch controls: what an agent may choose, within which bounds and how exactly.

    A key that is a ``LaunchControl`` is all that there is to a control; its order here is that of the actions. One that
    is None by default is optional.
    """

    orientation_deg: Annotated[
        Pair,
        LaunchControl("[-360, 360] deg", "orientation", printed="8.2f", drawn=180, turn=360.0),
    ]
    spin_rad_s: Annotated[
        Pair,
        LaunchControl("(-inf, inf) rad/s", "spin", printed="7.3f", drawn=81),
    ]
    speed_m_s: Annotated[
        Pair | None,
        LaunchControl("[0, inf) m/s", "speed", printed="7.3f", drawn=81),
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
    shortest_flight_s: Annotated[float, Quantity("[0, inf) s")] = 0.0  # shorter ones are no decision of the rider's
    noise_rad_s: Annotated[float, Quantity("[0, inf) rad/s")] = 0.0  # standard deviation of what is lent


class LimitsSection(Section):
    """Where a descent is given up."""

    max_time_s: Annotated[float, Quantity("(0, inf) s")]
    max_rebounds: Annotated[int, Whole("[1, 1000000]")]
    tolerance: Annotated[float, Quantity("[1e-18, 0.001]")] = 1e-14  # of the series of a step in contact


class EndsSection(Section):
    """Rules that end a descent beyond the mechanics: a rider who has fallen does not go on."""

    on_chord: StrictBool = False  # lying on the chord, both ends settled
    touching: StrictStr | tuple[StrictStr, ...] | None = None  # a part of the body that touches the slope, or several
