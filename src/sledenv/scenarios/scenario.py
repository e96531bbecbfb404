"""Scenarios: the contexts that are drawn from a file's ranges, and what each hands to the simulator."""

from __future__ import annotations

import csv
import hashlib
import json
import math
import os
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal, NamedTuple, Self, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, TypeAdapter, ValidationError, model_validator

from sledenv.scenarios.bodies import AnyBody, ChoiceBody
from sledenv.scenarios.configuration import Document, Pair
from sledenv.scenarios.handmade import Track, load_track
from sledenv.scenarios.sections import (
    BumpsSection,
    ContactSection,
    ControlSection,
    EndsSection,
    LaunchSection,
    LimitsSection,
    RiderSection,
    SlopeSection,
    ZoneSection,
)
from sledenv.scenarios.terrain import Ground, placed, read_ground
from sledenv.scenarios.tracks import TRACKS, Bumps, standard_normals
from sledenv.simulation.bends import MOST_VERTICES
from sledenv.simulation.bodies import Body
from sledenv.simulation.checks import has_sharp_corner, warn_of_fine_ground
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.outlook import AHEAD
from sledenv.simulation.records import MOST_ZONES, SCENE, params
from sledenv.simulation.rules import (
    FINITE,
    NOT_NEGATIVE,
    RESTITUTION,
    STEEPNESS,
    Rule,
    checked,
    checked_array,
    checked_choice,
    checked_table,
    made,
)
from sledenv.simulation.scene import (
    ContactLaw,
    Profile,
    Slope,
    State,
    Zone,
    asymmetry_of,
    sharp_crests,
    vertices_of,
)
from sledenv.simulation.scenes import NO_ZONES, Scenes, columns, settle_speed
from sledenv.simulation.settings import Settings, Solver
from sledenv.simulation.support import within_a_turn

Split = Literal["train", "validation", "test"]
_SHIFT: Final = 1.25  # by which speeds and bumps are raised in contexts of a kind that no one trains on
NOISY: Final = ("orientation", "spin")  # what launch noise disturbs, chosen or not

_CELLS = 2.0**20  # of each range: a split has a part of its own of every cell
_TURN = 0.5 * (math.sqrt(5.0) - 1.0)  # of the range, between the draws of two splits


class ScenarioError(ValueError):
    """A scenario that does not exist or is not valid; one line of the message for each problem."""


# Beyond it energies overflow. A state that is simulated may have more, and its descent ends as "non_finite".
_MOST: Final = 1e150
_MOVING: Rule = (lambda v: abs(v) <= _MOST, f"in [-{_MOST:g}, {_MOST:g}]")
_DRAWN: Rule = (lambda v: (v >= 0.0) & (v < 1.0), "in [0, 1)")
_HIGH: Rule = (lambda v: (v >= 0.0) & (v <= _MOST), f"in [0, {_MOST:g}] m")


class _ContextFields(NamedTuple):
    angle: float  # [rad] of the slope, beta
    friction: float  # [-] f of the slope
    restitution: float  # [-] e, by energy
    speed: float  # [m/s] at launch, along the slope
    drop: float  # [m] at launch, clearance of the lowest point of the body
    fall: float  # [m/s] at launch, speed towards the slope
    orientation: float  # [rad] at launch, phi
    spin: float  # [rad/s] at launch, omega
    zone_begin: float  # [m] where the zone that is drawn begins; of the first one if none is, 0 without zones
    zone_friction: float  # [-] f of that zone
    shape: float  # [-] number of the body among those of the scenario, from 0 on
    track: float  # [-] number that draws the bumps and the rider's errors; 0 without either


class Context(_ContextFields):
    """One draw from the ranges of a scenario: all that differs between two of its descents.

    ``seen`` are the fields that an agent may see, all but ``track``: its track is what it sees, and not a number.
    Many contexts are an array of shape (N, 12) with these fields as columns; methods of a scenario take a DataFrame of
    them too. ``rules`` says what can be simulated, whatever the ranges of a scenario are; a context is checked where it
    is used.
    """

    __slots__ = ()
    seen: ClassVar[tuple[str, ...]] = _ContextFields._fields[:-1]
    units: ClassVar[tuple[str, ...]] = ("rad", "1", "1", "m/s", "m", "m/s", "rad", "rad/s", "m", "1", "1")  # of these
    rules: ClassVar[tuple[Rule, ...]] = (
        *(STEEPNESS, NOT_NEGATIVE, RESTITUTION),
        *(_MOVING, _HIGH, _MOVING, FINITE, _MOVING),
        *(FINITE, NOT_NEGATIVE, (lambda v: (v >= 0.0) & (v == np.floor(v)), "a whole number >= 0")),
        (lambda v: (v >= 0.0) & (v < TRACKS) & (v == np.floor(v)), f"a whole number in [0, {TRACKS})"),
    )


_LAW: Final = "stiffness", "corner_rolling_arm"
_INCLINE: Final = "angle", "air_density"
_ZONE, _SHAPE, _TRACK = (Context._fields.index(name) for name in ("zone_begin", "shape", "track"))


class Given(NamedTuple):
    """Arguments of one descent, as :func:`sledenv.simulate` takes it."""

    body: Body
    law: ContactLaw
    slope: Slope
    launch: State


class Scenario(Document):
    """A family of descents: one body or several, one slope and the ranges that a context is drawn from.

    The keys are those of the YAML file, with their units; ``slope``, ``body`` and ``launch`` are read as
    ``slope_section``, ``body_section`` and ``launch_section``. Instances are immutable, hashable and picklable.
    """

    called: ClassVar[str] = "scenario"
    folder: ClassVar[str] = "scenarios"
    error: ClassVar[type[ValueError]] = ScenarioError

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

    @model_validator(mode="before")
    @classmethod
    def _with_its_ground(cls, content: Any) -> Any:
        return _laid_out(content)

    @classmethod
    def seen_from(cls, folder: Path, content: Any) -> Any:
        """Return what a file in a folder holds, with the path of its profile as it is seen from here."""
        slope = content.get("slope") if isinstance(content, dict) else None
        if not isinstance(slope, dict) or not isinstance(slope.get("profile_file"), str):
            return content
        return content | {"slope": slope | {"profile_file": str(folder / slope["profile_file"])}}

    @model_validator(mode="after")
    def _ends_at_a_part_of_the_body(self) -> Self:
        given = self.ends.touching
        for name in () if given is None else (given,) if isinstance(given, str) else given:
            for body in self.all_bodies():
                if name not in body.parts:
                    raise ValueError(f"ends.touching = {name!r}: must be a part of the body: {', '.join(body.parts)}")
            if len({body.parts.index(name) for body in self.all_bodies()}) > 1:
                raise ValueError(f"ends.touching = {name!r}: must have the same place in the parts of all bodies")
        return self

    @model_validator(mode="after")
    def _zones_in_a_row(self) -> Self:
        reached, length = -math.inf, self.slope_section.length_m
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

    @model_validator(mode="after")
    def _can_be_descended(self) -> Self:
        slope, bodies = self.slope_section, self.all_bodies()
        if not self.has_track:
            return self
        size = max(body.size for body in bodies)
        round_ground = (
            slope.bumps.rounding_m > 0.0 if slope.bumps else not sharp_crests(vertices_of(slope.profile)).any()
        )
        if not round_ground and any(has_sharp_corner(body.record).any() for body in bodies):
            remedy = "give a polygon rounding_m, or the ground, or take a body whose outline has no corner"
            raise ValueError(
                f"body: has a sharp corner, which must be rounded where the ground has sharp crests; {remedy}"
            )
        if slope.bumps is not None:
            return self._has_room_for_bumps(slope.bumps, size)
        of_each_body = np.tile(self.ranges[0], (len(bodies), 1))  # it is the same in all contexts
        of_each_body[:, _SHAPE] = np.arange(len(bodies))
        warn_of_fine_ground(self.scenes(of_each_body))
        return self

    def _has_room_for_bumps(self, section: BumpsSection, size: float) -> Self:
        """Raise ValueError unless launch and finish are level and one bump at least is between them."""
        bumps, length = self._bumps, self.slope_section.length_m
        assert bumps is not None
        if bumps.begin < size:
            allowed = f"at least the size of the body, {size:.4g} m, so that it is launched over level ground"
            raise ValueError(f"slope.bumps.start_m = {section.start_m:g}: must be {allowed}")
        if not bumps.begin + bumps.longest <= bumps.end:
            parts = f"start_m, the longest bump and the size of the body, {size:.4g} m: the finish must be level"
            least = bumps.begin + bumps.longest + size
            raise ValueError(f"slope.length_m = {length:g}: must be at least {least:.6g} m, the sum of {parts}")
        if 4 * bumps.most() > MOST_VERTICES:
            most = f"at most {MOST_VERTICES // 4}; make them or gap_m longer, or slope.length_m shorter"
            raise ValueError(f"slope.bumps: there may be {bumps.most()} of the shortest: must be {most}")
        return self

    @property
    def ranges(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest value of each field of ``Context``: two new arrays of shape (12,), in its units."""
        low, high = np.array(self._pairs()).T.copy()
        return low, high

    @property
    def hash(self) -> str:
        """Identity of what is simulated, 16 hex digits: words about it, such as title, sources and tags, do not count.

        Neither does a section, a key of ``control``, ``slope`` or a body, or a restitution or stiffness of a zone that
        is not given, nor a rule of ``ends`` that is off. A file of the ground counts by what is in it.
        """
        content = self.model_dump(mode="json", exclude={"title", "question", "description", "sources", "tags"})
        content["control"] = _given(content["control"])
        content["body"] = _told(content["body"])
        if "of" in content["body"]:
            content["body"]["of"] = list(map(_told, content["body"]["of"]))
        content["ends"] = {rule: on for rule, on in content["ends"].items() if on} or None
        own = "restitution", "stiffness_n_m", "pieces", "material"
        zones = ({key: value for key, value in zone.items() if key not in own or value} for zone in content["zones"])
        content["zones"] = list(zones) or None
        content["slope"] = _given(
            {key: value for key, value in content["slope"].items() if key not in ("run_out_m", "rounding_m") or value}
        )
        if self.slope_section.air_density_kg_m3 == SlopeSection.model_fields["air_density_kg_m3"].default:
            del content["slope"]["air_density_kg_m3"]
        if content["slope"].get("bumps") is not None:
            bumps = content["slope"]["bumps"]
            content["slope"]["bumps"] = {key: value for key, value in bumps.items() if key != "rounding_m" or value}
        usual = LimitsSection.model_fields["tolerance"].default
        content["limits"] = {
            key: value for key, value in content["limits"].items() if key != "tolerance" or value != usual
        }
        content["launch"] = {key: [0.0, 0.0] if own is None else own for key, own in content["launch"].items()}
        if content["rider"] is not None:
            optional = "shortest_flight_s", "noise_rad_s"
            content["rider"] = {key: own for key, own in content["rider"].items() if key not in optional or own}
        content = _given(content)
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]

    def sample(self, rng: np.random.Generator, split: Split | None = None) -> Context:
        """Draw a context, uniform in the ranges; every call takes as many doubles from ``rng`` as ``draws`` says.

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
        return Context(*self.contexts(rng.random(self.draws), split).tolist())

    @property
    def has_track(self) -> bool:
        """Whether there is ground over the plane of its slope: vertices or bumps."""
        return self.slope_section.bumps is not None or bool(self.slope_section.profile)

    @property
    def draws(self) -> int:
        """How many doubles a context is drawn from: one for each field, without the track where it is always 0."""
        return len(Context._fields) - (not self._is_numbered)

    def contexts(self, draws: ArrayLike, split: Split | None = None) -> NDArray[np.float64]:
        """Return the contexts at relative places ``draws`` in [0, 1) of the ranges, shape (..., 12).

        Parameters
        ----------
        draws : array_like, shape (..., 11) or (..., 12)
            In the order of the fields. Without the last one tracks are number 0.
        split : {"train", "validation", "test"}, optional
            Take a context of this split. Whatever the draws, two splits never share a value of a field that varies,
            ``shape`` apart, and equal draws give contexts that differ by at least 0.23 of every range. Each split is
            dense in the ranges to a millionth and uniform.

        Raises
        ------
        TypeError, ValueError
            If a draw is not in [0, 1), or for an unknown split.
        """
        low, high = self.ranges
        draws, fields = checked_array("draws", draws, _DRAWN), len(Context._fields)
        if draws.ndim < 1 or not fields - 1 <= draws.shape[-1] <= fields:
            raise ValueError(f"draws has shape {draws.shape}: must be (..., {fields - 1}) or (..., {fields})")
        places = np.zeros((*draws.shape[:-1], fields))
        places[..., : draws.shape[-1]] = draws if split is None else _apart(draws, split)
        contexts = np.minimum(low + (high - low) * places, high)
        contexts[..., _SHAPE] = np.floor(len(self.all_bodies()) * places[..., _SHAPE])
        contexts[..., _TRACK] = np.floor(contexts[..., _TRACK])
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
            _radians(launch.orientation_deg or (0.0, 0.0)),
            launch.spin_rad_s or (0.0, 0.0),
            (0.0, 0.0) if zone is None else zone.begin_m,
            (0.0, 0.0) if zone is None else zone.friction,
            (0.0, float(len(self.all_bodies()) - 1)),
            (0.0, TRACKS - 1.0 if self._is_numbered else 0.0),
        )

    @property
    def _is_numbered(self) -> bool:
        """Whether the number of the track draws anything."""
        return self.slope_section.bumps is not None or (self.rider is not None and self.rider.noise_rad_s > 0.0)

    @property
    def _drawn_zone(self) -> int | None:
        """Number of the zone that a context tells of, None without zones."""
        drawn = [k for k, zone in enumerate(self.zones) if zone.varies]
        return next(iter([*drawn, *range(len(self.zones))]), None)

    @property
    def control_bounds(self) -> dict[str, Pair]:
        """Lowest and highest value of each of ``CONTROLS`` that an agent may choose, in the units of the YAML keys."""
        return _given({control.name: getattr(self.control, key) for key, control in ControlSection.controls().items()})

    @property
    def is_ride(self) -> bool:
        """Whether it is a question for a rider: there is one, and ground that is no plane."""
        return self.rider is not None and self.has_track

    def ride(self) -> Scenario:
        """Return the scenario of rides, whose launches nobody chooses: a context draws what an agent might choose.

        Where ``launch`` gives no range of the orientation or the spin, that is the one of ``control``.
        """
        launch = self.launch_section
        left = {key: getattr(self.control, key) for key, own in launch if own is None}
        return self.model_copy(update={"launch_section": launch.model_copy(update=left)}) if left else self

    def shifted(self) -> Scenario:
        """Return the scenario with launches that are a quarter faster, over bumps that are a quarter higher.

        No one trains on it: it says what an agent is worth outside of what it has learned.
        """
        launch, slope = self.launch_section, self.slope_section
        faster = launch.model_copy(update={"speed_m_s": _raised(launch.speed_m_s)})
        if slope.bumps is not None:
            bumps = slope.bumps.model_copy(update={"height_m": _raised(slope.bumps.height_m)})
            slope = slope.model_copy(update={"bumps": bumps})
        content = self.model_copy(update={"launch_section": faster, "slope_section": slope}).model_dump(by_alias=True)
        return Scenario.model_validate(content)

    def on(self, track: Track | str | os.PathLike[str]) -> Scenario:
        """Return the scenario on a track made by hand, in place of its own ground.

        Sled, contact, rider, ranges and run-out stay. The vertices are as round as those of its bumps.

        Parameters
        ----------
        track : Track, str or path
            As for :func:`sledenv.scenarios.load_track`.

        Raises
        ------
        ScenarioError
            If it is no ride.
        TrackError
            If there is no such track.

        Examples
        --------
        >>> import sledenv
        >>> sledenv.load_scenario("sled_rollers").on("whoops").id
        'sled_rollers_on_whoops'
        """
        track = track if isinstance(track, Track) else load_track(track)
        if not self.is_ride:
            raise ScenarioError(
                f"scenario {self.id}: must have a rider, and bumps or a profile, to be ridden on a track"
            )
        bumps = self.slope_section.bumps
        ground = {"length_m": track.length_m, "profile_m": track.profile_m, "bumps": None}
        content = self.model_dump(by_alias=True)
        content["slope"] |= ground | {"rounding_m": 0.0 if bumps is None else bumps.rounding_m}
        words = {"title": f"{track.title} ({self.title})", "description": track.description}
        words["question"] = "Which trims bring the sled over this track without a fall?"
        return Scenario.model_validate(content | words | {"id": f"{self.id}_on_{track.id}"})

    def errors(self, streams: NDArray[np.float64], decisions: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the errors [rad/s] of the spins that riders lend in flights, normal ones of ``rider.noise_rad_s``.

        Parameters
        ----------
        streams : ndarray, shape (N,)
            Numbers in [0, 2^32) of the streams that they are drawn from: of a context that of its track.
        decisions : ndarray of int, shape (N,)
            Which decision of the ride each is, counted from 0.

        Returns
        -------
        ndarray, shape (N,)
        """
        if self.rider is None or self.rider.noise_rad_s == 0.0:
            return np.zeros(len(streams))
        return self.rider.noise_rad_s * standard_normals(streams, decisions)

    def all_bodies(self) -> tuple[Body, ...]:
        """Return the bodies of the scenario, one of which is that of a context."""
        return _build(self.body_section)

    @property
    def outlines(self) -> np.ndarray:
        """Records that the kernel reads of the bodies, of kernel.outline.BODY."""
        return _records(self.body_section)

    def _shapes(self, contexts: NDArray[np.float64]) -> NDArray[np.intp]:
        """Return the place of each context's body among those of the scenario, shape (N,), or raise ValueError."""
        shapes, most = contexts[:, _SHAPE], len(self.all_bodies()) - 1
        wrong = ~((shapes >= 0.0) & (shapes <= most) & (shapes == np.floor(shapes)))
        if wrong.any():
            value = float(shapes[wrong][0])
            raise ValueError(f"context.shape = {value!r}: must be a whole number in [0, {most}], that of a body")
        return shapes.astype(np.intp)

    def check(self, contexts: NDArray[np.float64]) -> None:
        """Check what only a scenario can tell of contexts of shape (N, 12); NaN is what is to be drawn.

        Raises
        ------
        ValueError
            If it has no such body or no zone, or if its zone cannot begin there, naming the field, its value and what
            is allowed.
        """
        contexts = _rows_of(contexts)
        self._shapes(np.nan_to_num(contexts))
        drawn = self._drawn_zone
        if drawn is None:
            for name, column in zip(Context._fields[_ZONE:], contexts.T[_ZONE : _ZONE + 2], strict=False):
                for value in column[~np.isnan(column) & (column != 0.0)].tolist():
                    raise ValueError(f"context.{name} = {value!r}: must be 0, the scenario has no zones")
            return
        begins, ends = contexts[:, _ZONE], [math.inf if one.end_m is None else one.end_m for one in self.zones]
        low, high = ends[drawn - 1] if drawn else -math.inf, min(ends[drawn], self.slope_section.length_m)
        wrong = (begins < low) | (begins >= high)
        if wrong.any():
            value = float(begins[wrong][0])
            raise ValueError(f"context.zone_begin = {value!r}: must be in {'[' if drawn else '('}{low!r}, {high!r}) m")

    def draw(self, draws: ArrayLike, split: Split | None = None) -> Scenes:
        """Return the scenes at relative places ``draws`` in [0, 1) of the ranges: those of :meth:`contexts` there."""
        return self.scenes(self.contexts(draws, split))

    def scenes(self, contexts: NDArray[np.float64], errors: NDArray[np.float64] | None = None) -> Scenes:
        """Return all that descents in contexts are given.

        Parameters
        ----------
        contexts : ndarray, shape (N, 12), or DataFrame
            Columns are the fields of :class:`Context`. Those of an array are known to be right, such as what has been
            drawn; of a DataFrame they are checked.
        errors : ndarray, shape (N, 2), optional
            Of the orientation [rad] and of the spin [rad/s] at launch; none by default.

        Returns
        -------
        Scenes
            N of them, each with the contexts and errors that it is ``drawn`` from.

        Raises
        ------
        TypeError, ValueError
            If there is no such body or track, or naming an error that is not finite.
        """
        contexts = _rows_of(contexts)
        ground = (
            _laid(self.slope_section.profile) if self.slope_section.bumps is None else self._tracks(contexts[:, _TRACK])
        )
        bodies, law, slope = self.outlines, self.contact, self.slope_section
        drawn = np.zeros((len(contexts), len(Context._fields) + len(NOISY)))
        drawn[:, : len(Context._fields)] = contexts
        if errors is not None:
            table = checked_table("errors", errors, NOISY, (FINITE, FINITE))
            if len(table) != len(contexts):
                raise ValueError(f"errors has {len(table)} rows: must have {len(contexts)}, one for each context")
            drawn[:, len(Context._fields) :] = table
        scenes = Scenes(np.zeros(len(contexts), SCENE), bodies, ground.pieces, NO_ZONES, drawn)
        rows = scenes.rows
        rows["body"] = shapes = self._shapes(contexts)
        rows["ground"], rows["ground_end"] = ground.places.T
        rows["angle"], rows["length"], rows["gravity"] = contexts[:, 0], slope.length_m, slope.gravity_m_s2
        rows["air_density"] = slope.air_density_kg_m3
        rows["stiffness"], rows["asymmetry"] = law.stiffness_n_m, asymmetry_of(contexts[:, 2])
        rows["friction"], rows["rolling_arm"] = contexts[:, 1], law.rolling_arm_m
        rows["corner_rolling_arm"] = law.corner_rolling_arm_m
        rows["settle_speed"] = settle_speed(slope.gravity_m_s2, bodies["size"][shapes])
        rows["rotor_inertia"] = 1.0 if self.rider is None else self.rider.rotor_inertia_kg_m2
        rows["stream"] = contexts[:, _TRACK]
        if self.zones:
            scenes = scenes._replace(zones=self._zones_of(contexts))
            count = float(len(self.zones))
            rows["zones"] = count * np.arange(len(rows))
            rows["zones_end"] = rows["zones"] + count
        self.let_go(scenes, drawn)
        return scenes

    def let_go(self, scenes: Scenes, drawn: NDArray[np.float64]) -> None:
        """Write into scenes the launches that rows of ``drawn`` say: the fields of contexts, and errors.

        A body would touch the ground at x = 0 if it were lower by the drop of its context. Whole turns are taken off.
        """
        first, count = Context._fields.index("speed"), len(Context._fields)
        speed, drop, fall, orientation, spin = drawn[:, first : first + 5].T
        place = np.zeros(len(drawn))
        phi = within_a_turn(orientation + drawn[:, count])
        launches = place, drop + scenes.resting_heights(place, phi), phi, speed, 0.0 - fall, spin + drawn[:, count + 1]
        scenes.launches[:] = np.stack(launches, axis=-1)

    def given(
        self,
        context: Context,
        orientation: float | None = None,
        spin: float | None = None,
        speed: float | None = None,
    ) -> Given:
        """Return what one descent is given: ``simulate(*scenario.given(context), scenario.settings())``.

        Parameters
        ----------
        context : Context
            The draw.
        orientation : float, optional
            phi [rad] at launch in place of the context's.
        spin : float, optional
            omega [rad/s] in place of the context's.
        speed : float, optional
            u [m/s], along the slope, in place of the context's.

        Returns
        -------
        Given
            Body, contact law, slope with its zones and its profile, and state at launch: at x = 0, where the body would
            touch the ground if it were lower by ``context.drop``.

        Raises
        ------
        TypeError, ValueError
            If ``orientation``, ``spin`` or ``speed`` is not a finite number, or ``context`` is no context.
        """
        named = {"orientation": ("phi", orientation), "spin": ("omega", spin), "speed": ("u", speed)}
        own = {
            name: checked("State", field, value, FINITE) for name, (field, value) in named.items() if value is not None
        }
        return self.given_in(self.scenes(_alone(context, **own)))

    def given_in(self, scenes: Scenes) -> Given:
        """Return what the descent of the first of scenes is given, as :meth:`given` does."""
        (row,), fields = scenes.table[:1], iter([None if math.isnan(one) else one for one in self._zones_in(scenes)])
        zones = [Zone(*zone) for zone in zip(*[fields] * len(Zone._fields), strict=True)]
        vertices = scenes.pieces[int(scenes.rows["ground"][0]) + 1 : int(scenes.rows["ground_end"][0])]
        profile = np.column_stack([vertices["x"], vertices["y"]])
        told, bumps = vertices_of(self.slope_section.profile), self.slope_section.bumps
        # A piece has the radius that there is room for, a slope the one that was asked for.
        asked = told[: len(vertices), 2] if bumps is None else bumps.rounding_m
        rounding = np.where(vertices["radius"] > 0.0, asked, 0.0)
        law, slope = (row[columns(*ends)].tolist() for ends in (_LAW, _INCLINE))
        return Given(
            self.all_bodies()[int(scenes.rows["body"][0])],
            ContactLaw(*law),
            Slope(slope[0], slope[1], slope[2], zones, profile, rounding, slope[3]),
            State(*scenes.launches[0].tolist()),
        )

    @staticmethod
    def _zones_in(scenes: Scenes) -> list[float]:
        begin, end = int(scenes.rows["zones"][0]), int(scenes.rows["zones_end"][0])
        numbers: list[float] = scenes.zones[begin:end].ravel().tolist()
        return numbers

    @property
    def extent(self) -> tuple[float, float, float]:
        """Lengths [m] by which the vertices around a place are scaled: along the slope, off it, and of their radii.

        Eight of them hardly reach further, and none is further up or down; bends of small turns may be rounder.
        They are 0 on a plane, and the last one where nothing is rounded.
        """
        bumps, vertices = self._bumps, vertices_of(self.slope_section.profile)
        if bumps is not None:
            return AHEAD / 4 * bumps.longest, bumps.height[1], min(bumps.rounding, bumps.longest)
        if not len(vertices):
            return 0.0, 0.0, 0.0
        x = np.concatenate([[0.0], vertices[:, 0]])
        ends = np.concatenate([x, np.full(AHEAD, x[-1])])
        radius = float(_laid(self.slope_section.profile).pieces["radius"].max())
        return float((ends[AHEAD:] - x).max()), float(np.ptp(vertices[:, 1])) or 1.0, radius

    def _tracks(self, numbers: NDArray[np.float64]) -> Grounds:
        """Ground of tracks with such numbers, shape (N,), of which equal ones share it; ValueError if they are none."""
        accepts, allowed = Context.rules[_TRACK]
        fine = np.asarray(accepts(numbers))
        if not fine.all():
            raise ValueError(f"context.track = {float(numbers[~fine][0])!r}: must be {allowed}")
        bumps = self._bumps
        assert bumps is not None
        if not len(numbers):
            return Grounds.of(())
        tracks, places = np.unique(numbers, return_inverse=True)
        ground = Grounds.drawn(bumps.draw(tracks))
        return ground._replace(places=ground.places[places])

    @property
    def _bumps(self) -> Bumps | None:
        """Ranges that the bumps of a track are drawn from; None without them."""
        section = self.slope_section.bumps
        if section is None:
            return None
        size = max(body.size for body in self.all_bodies())
        begin = size if section.start_m is None else section.start_m
        ranges = section.gap_m, section.face_m, section.top_m, section.back_m, section.height_m
        return Bumps(*ranges, begin, self.slope_section.length_m - size, section.rounding_m)

    def _zones_of(self, contexts: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the zones of one context after the other."""
        contact, drawn = self.contact, self._drawn_zone
        rows = [
            params.Zone(
                begin=zone.begin_m[0],
                end=math.inf if zone.end_m is None else zone.end_m,
                friction=zone.friction[0],
                rolling_arm=contact.rolling_arm_m if zone.rolling_arm_m is None else zone.rolling_arm_m,
                corner_rolling_arm=(
                    contact.corner_rolling_arm_m if zone.corner_rolling_arm_m is None else zone.corner_rolling_arm_m
                ),
                restitution=math.nan if zone.restitution is None else zone.restitution,
                stiffness=math.nan if zone.stiffness_n_m is None else zone.stiffness_n_m,
            )
            for zone in self.zones
        ]
        zones = np.tile(np.array(rows), (len(contexts), 1, 1))
        zones[:, drawn, 0], zones[:, drawn, 2] = contexts[:, _ZONE], contexts[:, _ZONE + 1]
        return zones.reshape(-1, len(Zone._fields))

    def settings(self, solver: Solver = "compliant") -> Settings:
        """Return how its descents are simulated.

        Raises
        ------
        ValueError
            If there is no such solver, or it is "rigid" where there are vertices or bumps.
        """
        checked_choice("solver", solver, get_args(Solver))
        if solver != "compliant" and self.has_track:
            raise ValueError(f"solver = {solver!r}: must be 'compliant' in scenario {self.id}, which has a profile")
        return Settings(
            solver=solver,
            max_time=self.limits.max_time_s,
            max_rebounds=self.limits.max_rebounds,
            end_on_chord=self.ends.on_chord,
            end_touching=self.ends.touching,
            run_out=self.slope_section.run_out_m,
            tolerance=self.limits.tolerance,
        )


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


def _rows_of(contexts: Any) -> NDArray[np.float64]:
    """Return contexts as an array: one of floats as it is, the columns of a DataFrame by name."""
    known = type(contexts) is np.ndarray and contexts.dtype == np.float64
    known = known and contexts.ndim == 2 and contexts.shape[1] == len(Context._fields)
    return contexts if known else checked_table("contexts", contexts, Context._fields, Context.rules)


def _alone(context: Context, **changes: float) -> NDArray[np.float64]:
    """Return a context as a table of one row, with some fields changed; raise TypeError or ValueError if it is none."""
    fields = zip(Context._fields, made("context", Context, context)._replace(**changes), Context.rules, strict=True)
    return np.array([[checked("context", *field) for field in fields]])


def _laid_out(content: Any) -> Any:
    """Return what a file holds with the vertices of its profile, and with zones at their places.

    What is wrong otherwise is left to those who look at the keys.

    Raises
    ------
    ValueError
        Naming the file or the zone, the value and what is allowed.
    """
    if not isinstance(content, dict) or not isinstance(content.get("slope"), dict):
        return content
    slope = dict(content["slope"])
    file, *how = (slope.pop(key, None) for key in ("profile_file", "tolerance_m", "steepest_deg"))
    profile, zones = slope.get("profile_m"), content.get("zones", ())
    if file is None:
        for key, value in zip(("tolerance_m", "steepest_deg"), how, strict=True):
            if value is not None:
                raise ValueError(f"slope.{key} = {value!r}: must be left out without slope.profile_file")
        try:
            vertices = np.array(profile if profile else [], np.float64).reshape(-1, 2)
        except (TypeError, ValueError):
            return content
        sharp = np.column_stack([vertices, np.zeros(len(vertices))])
        ground = Ground(vertices, sharp, 0.0, (), None, np.arange(len(vertices)))
    else:
        ground = _read(file, how, slope)
        slope["profile_m"] = ground.told[:, :2].tolist()
        if ground.told[:, 2].any():
            slope["rounding_m"] = ground.told[:, 2].tolist()
        if ground.angle_deg is not None:
            slope["angle_deg"] = ground.angle_deg
    if len(ground.vertices) and "length_m" not in slope:
        try:
            bodies = _build(_BODY.validate_python(content.get("body")))
            slope["length_m"] = float(ground.vertices[-1, 0]) + max(body.size for body in bodies)
        except ValidationError:  # what is wrong is told of the body, and with any length of it alone
            slope["length_m"] = 1.0
    length = slope.get("length_m")
    placed_zones = placed(zones, ground, length if isinstance(length, int | float) else math.inf)
    return content | {"slope": slope, "zones": placed_zones}


_BODY: Final[TypeAdapter[Any]] = TypeAdapter(Annotated[AnyBody, Field(discriminator="kind")])


def _read(file: Any, how: Sequence[Any], slope: dict[str, Any]) -> Ground:
    """Read the file of a profile, given its tolerance_m and steepest_deg, and what else is said of the slope."""
    name = f"slope.profile_file = {file!r}"
    if not isinstance(file, str):
        raise ValueError(f"{name}: must be the path of a CSV file")
    for key in ("profile_m", "rounding_m", "bumps"):
        if slope.get(key) not in (None, 0.0):
            raise ValueError(f"{name}: must be left out where there is slope.{key}")
    angle = slope.get("angle_deg")
    pairs = zip(("angle_deg", "tolerance_m", "steepest_deg"), (angle, *how), strict=True)
    plane, tolerance, steepest = (None if value is None else _checked(key, value) for key, value in pairs)
    try:
        ground = read_ground(file, None if plane is None else plane[0], tolerance, steepest)
    except (OSError, ValueError, csv.Error) as problem:
        raise ValueError(f"{name}: {problem}") from problem
    if ground.angle_deg is not None and isinstance(angle, list | tuple) and angle[0] != angle[1]:
        why = "the plane over which terrain is measured; left out, it runs through the first and the last place"
        raise ValueError(f"slope.angle_deg = {list(angle)}: must be one number with a section of terrain, {why}")
    return ground


def _checked(key: str, value: Any) -> Any:
    """Return the value of a key of the slope as it is kept, or raise ValueError."""
    try:
        return SlopeSection.quantities()[key].read(value)
    except ValueError as problem:
        raise ValueError(f"slope.{key} = {value!r}: {problem}") from problem


def _raised(pair: Pair) -> Pair:
    low, high = pair
    return _SHIFT * low, _SHIFT * high


@lru_cache  # a scenario asks for its bodies and its ground in every reset of an environment
def _build(section: AnyBody) -> tuple[Body, ...]:
    return tuple(one.build() for one in (section.of if isinstance(section, ChoiceBody) else (section,)))


@lru_cache
def _records(section: AnyBody) -> np.ndarray:
    return np.concatenate([body.record for body in _build(section)])


@lru_cache
def _laid(profile: Profile) -> Grounds:
    return Grounds.of((vertices_of(profile),))


def _told(body: dict[str, Any]) -> dict[str, Any]:
    """Return what is given of a body, without a drag area of 0."""
    return {key: value for key, value in _given(body).items() if key != "drag_area_m2" or value}


def _given(content: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in content.items() if value is not None}


def _radians(degrees: Pair) -> Pair:
    return math.radians(degrees[0]), math.radians(degrees[1])
