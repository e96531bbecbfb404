"""Studies: validated YAML, what of a scenario is uncertain and by how much, and the descents that follow from draws."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, SerializeAsAny, ValidationError, model_validator

from sledenv.scenarios.bodies import ChoiceBody
from sledenv.scenarios.configuration import Document, Quantity, Section, Whole, wrong_kind
from sledenv.scenarios.scenario import Context, Scenario, ScenarioError, load_scenario
from sledenv.scenarios.sections import (
    BumpsSection,
    ContactSection,
    LaunchSection,
    SlopeSection,
    ZoneSection,
)
from sledenv.scenarios.terrain import named
from sledenv.simulation.bodies import Body, records_of
from sledenv.simulation.checks import admitted, check_zones
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.jam import DescentJam
from sledenv.simulation.records import LIBRARY
from sledenv.simulation.scene import Zone, asymmetry_of, checked_profile, vertices_of
from sledenv.simulation.scenes import Scenes, settle_speed
from sledenv.uncertainty.distributions import KINDS, Distribution, Positive, TrackNumber
from sledenv.uncertainty.terrain import MaterialSection, TerrainSection, read_section

_SECTIONS: Final[dict[str, type[Section]]] = {
    "slope": SlopeSection,
    "contact": ContactSection,
    "zone": ZoneSection,
    "launch": LaunchSection,
}
_PARTS: Final = ("slope", "body", "contact", "zone", "launch")  # sections whose numbers may be uncertain
# Which field of what the simulator takes a key stands for; those of a body are told by its section.
_CONTEXT: Final = {
    "slope.angle_deg": "angle",
    "contact.friction": "friction",
    "contact.restitution": "restitution",
    "zone.begin_m": "zone_begin",
    "zone.friction": "zone_friction",
    "launch.speed_m_s": "speed",
    "launch.drop_m": "drop",
    "launch.fall_m_s": "fall",
    "launch.orientation_deg": "orientation",
    "launch.spin_rad_s": "spin",
}
_LAW: Final = {
    "contact.stiffness_n_m": "stiffness",
    "contact.asymmetry": "asymmetry",
    "contact.rolling_arm_m": "rolling_arm",
    "contact.corner_rolling_arm_m": "corner_rolling_arm",
}
_MATERIAL: Final = {  # of a zone
    "restitution": ("restitution",),
    "friction": ("friction",),
    "rolling_arm_m": ("rolling_arm", "corner_rolling_arm"),
    "stiffness_n_m": ("stiffness",),
}
_START: Final = "start_m"
_BUMPS: Final = "slope.bumps"
_EITHER: Final = ({"restitution", "asymmetry"}, {"profile_m", "profile_file", "bumps"})  # one stands for the others
_INCLINE: Final = ("gravity_m_s2", "air_density_kg_m3")  # of a slope, what terrain leaves open
_SLOPE: Final = {"slope.length_m": "length", "slope.gravity_m_s2": "gravity", "slope.air_density_kg_m3": "air_density"}
_NO_CONTROL: Final = {"orientation_deg": [-180, 180], "spin_rad_s": [-1, 1]}  # a scenario must have one: nobody chooses
_STATIONS: Final = 20


class StudyError(ScenarioError):
    """A study that cannot be run; one line of the message for each problem."""


def _read(value: Any) -> Any:
    """Read what a key is given: a mapping is a distribution, or bumps; the scenario looks at everything else."""
    if not isinstance(value, dict) or value.keys() & BumpsSection.model_fields.keys():
        return value
    kind = value.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        raise ValueError(wrong_kind(kind, KINDS))
    try:
        return KINDS[kind].model_validate(value)
    except ValidationError as error:
        raise ValueError("; ".join(KINDS[kind].problems(error))) from error


OneGiven = SerializeAsAny[Annotated[Any, BeforeValidator(_read)]]  # a distribution, a number, a word
Given = dict[str, OneGiven]  # by key


def _by_name(materials: Any) -> Any:
    """Return materials by the text of their names."""
    if not isinstance(materials, dict):
        return materials
    texts = {named(name): one for name, one in materials.items()}
    if len(texts) < len(materials):
        raise ValueError("must hold each name once, as a number or as text")
    return texts


class Study(Document):
    """Numbers of a scenario that are uncertain, and by how much.

    The keys are those of the YAML file. ``slope``, ``body``, ``contact`` and ``launch`` have the keys of a scenario and
    stand in for its own; each is a number or a distribution. So has ``zone``, for the zone that the scenario draws, or
    else its first one. Instances are immutable and picklable.
    """

    called: ClassVar[str] = "study"
    folder: ClassVar[str] = "studies"
    error: ClassVar[type[ValueError]] = StudyError

    question: str = ""
    description: str = ""
    sources: str = ""  # where the numbers come from
    scenario: str | None = None  # as for load_scenario; without it all sections are given
    solver: Literal["compliant", "rigid"] = "compliant"
    launches: Annotated[int, Whole("[1, 100000000]")] = 16384  # at least so many
    seed: Annotated[int, Whole("[0, 4294967295]")] = 0
    stations_m: tuple[Positive, ...] = ()  # distances at which speeds are told; 20 up to the end of the slope
    terrain: TerrainSection | None = None  # a hillside: x is horizontal, and with it come the next three keys
    # What the terrain is made of, by name.
    materials: Annotated[dict[str, Given], BeforeValidator(_by_name)] = Field(default_factory=dict)
    start_m: OneGiven = 0.0  # where along the section bodies start
    heights_m: tuple[Positive, ...] = ()  # of barriers: shares of launches that pass higher are told
    slope: Given = Field(default_factory=dict)
    body: Given = Field(default_factory=dict)
    contact: Given = Field(default_factory=dict)
    zone: Given = Field(default_factory=dict)  # begin_m and friction of the zone that the scenario draws
    launch: Given = Field(default_factory=dict)
    limits: dict[str, Any] = Field(default_factory=dict)
    ends: dict[str, Any] = Field(default_factory=dict)

    @classmethod
    def seen_from(cls, folder: Path, content: Any) -> Any:
        """Return what a file in a folder holds, with the paths of its scenario and profile as they are seen from here.

        The points of a terrain stand in place of the name of their file, so that a study holds all that it is about.
        """
        if isinstance(content, dict) and str(content.get("scenario")).endswith((".yaml", ".yml")):
            content |= {"scenario": os.path.abspath(folder / content["scenario"])}
        content = Scenario.seen_from(Path(os.path.abspath(folder)), content)
        terrain = content.get("terrain") if isinstance(content, dict) else None
        if isinstance(terrain, dict) and isinstance(terrain.get("section"), str):
            try:
                terrain["section"] = read_section(folder / terrain["section"], terrain.get("steepest_deg"))
            except ValueError as error:
                raise cls.error(f"terrain.section: {error}") from error
        return content

    @model_validator(mode="after")
    def _can_be_simulated(self) -> Self:
        """Check all that can be before anything is drawn."""
        base = self.base  # refuses keys that there are not
        problems = [self._misfit(name, distribution) for name, distribution in self._given.items()]
        known = _CONTEXT.keys() | _LAW.keys() | _SLOPE.keys() | {_START}
        if _BUMPS in self.parameters:
            known.remove("slope.length_m")  # bumps follow each other up to there
        free = "body.", "materials."
        certain = [name for name in self._given if not name.startswith(free) and name not in known]
        problems += [f"{name}: must be certain, a number alone" for name in certain]
        low, high = (dict(zip(Context._fields, ends, strict=True)) for ends in base.ranges)
        ranges = [name for name, field in _CONTEXT.items() if low[field] < high[field]]
        problems += [f"{name}: is a range, give a number or a distribution" for name in ranges]
        if self.solver != "compliant" and (self.terrain is not None or base.has_track):
            problems.append(f"solver = {self.solver!r}: must be 'compliant' where there is a profile")
        if isinstance(base.body_section, ChoiceBody):
            problems.append("body.kind = 'choice': a study is of one body")
        if not self.parameters:
            problems.append("nothing is uncertain: give a key of slope, body, contact or launch a distribution")
        begin = self.stations[0]
        if (np.diff(self.stations_m, prepend=begin) <= 0.0).any():
            behind = f", from {begin:g} m on" if begin else ""
            problems.append(f"stations_m = {list(self.stations_m)}: must rise{behind}")
        if any(problems):
            raise ValueError("\n".join(filter(None, problems)))
        return self

    @cached_property
    def base(self) -> Scenario:
        """The scenario that is simulated, with every distribution at its median."""
        content: dict[str, Any] = {"control": _NO_CONTROL}
        if self.scenario is not None:
            content = load_scenario(self.scenario).model_dump(by_alias=True)
        content |= {"id": self.id, "title": self.title, "rider": None}
        content |= self._hillside()
        for part in (*_PARTS, "limits", "ends"):
            if part == "zone":
                continue
            given = _medians(getattr(self, part))
            inherited = {} if "kind" in given else dict(content.get(part, {}))
            for either in _EITHER:
                if given.keys() & either:
                    inherited |= dict.fromkeys(either)
            if given or inherited:
                content[part] = inherited | given
        content["zones"] = self._zones(content.get("zones", ()))
        try:
            return Scenario.model_validate(content)
        except ScenarioError as error:
            lines = str(error).replace(f"scenario {self.id}: ", "").splitlines()
            raise ValueError("\n".join(map(self._as_given, lines))) from error

    def _hillside(self) -> dict[str, Any]:
        """Return what a scenario has of a terrain: a level plane of the commonest material, and zones of all others."""
        if self.terrain is None:
            alone = [name for name in ("materials", "start_m", "heights_m") if getattr(self, name)]
            if alone:
                raise ValueError(f"{alone[0]}: goes with terrain, and there is none")
            return {}
        given = {name for name in ("scenario", "contact", "zone", "ends") if getattr(self, name)}
        given |= {f"slope.{key}" for key in self.slope if key not in _INCLINE}
        if given:
            raise ValueError(f"{', '.join(sorted(given))}: cannot be given beside terrain")
        used = dict.fromkeys(run.material for run in self.terrain.runs)
        if used.keys() != self.materials.keys():
            names = f"{', '.join(used)}, those of terrain.section"
            raise ValueError(f"materials = {', '.join(self.materials)}: must be {names}")
        surfaces = {}
        for name, material in self.materials.items():
            try:
                found = MaterialSection.model_validate(_medians(material)).model_dump()
            except ValidationError as error:
                wrong = [f"materials.{name}.{line}" for line in MaterialSection.problems(error)]
                raise ValueError("\n".join(wrong)) from error
            surfaces[name] = found | {"corner_rolling_arm_m": found["rolling_arm_m"]}
        zones = [
            {"begin_m": run.begin, "end_m": run.end if run.end < np.inf else None} | surfaces[run.material]
            for run in self.terrain.zones
        ]
        slope = {"angle_deg": 0.0, "length_m": self.terrain.length}
        return {"slope": slope, "contact": surfaces[self.terrain.commonest], "zones": zones}

    def _as_given(self, problem: str) -> str:
        """Return what the scenario says of a median as said of the distribution that was given."""
        path, _, rest = problem.partition(" = ")
        name = f"zone.{path.rpartition('.')[2]}" if path.startswith("zones.") else path
        given = self._given.get(name)
        said = "" if given is None else f"{_central(given)!r}: "
        return f"{name}: {given.words}: {rest.removeprefix(said)}" if given and rest.startswith(said) else problem

    def _zones(self, inherited: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Zones of the scenario, the drawn one with what is given here."""
        zones = [dict(zone) for zone in inherited]
        given = _medians(self.zone)
        if given and not zones:
            raise ValueError("zone: the scenario has no zones")
        if given:
            drawn = [k for k, zone in enumerate(inherited) if ZoneSection.model_validate(zone).varies]
            zones[next(iter(drawn), 0)] |= given
        return zones

    @cached_property
    def parameters(self) -> dict[str, Distribution]:
        """Distributions by key, such as "contact.friction"; of bumps the number of the track."""
        bumps = self.base.slope_section.bumps is not None
        return self._given | ({_BUMPS: TrackNumber()} if bumps else {})

    @property
    def _given(self) -> dict[str, Distribution]:
        """Distributions that are given, by key."""
        every = {f"{part}.{key}": value for part in _PARTS for key, value in getattr(self, part).items()}
        every |= {
            f"materials.{name}.{key}": value for name, one in self.materials.items() for key, value in one.items()
        }
        every |= {_START: self.start_m}
        return {name: value for name, value in every.items() if isinstance(value, Distribution)}

    @property
    def stations(self) -> NDArray[np.float64]:
        """Distances [m] along the slope, from where all have begun on, at which speeds and energies are told."""
        start = self.start_m
        begin = getattr(start, "high", start.ends[1]) if isinstance(start, Distribution) else start
        if self.stations_m:
            return np.array([begin, *self.stations_m])
        return np.linspace(begin, self.base.slope_section.length_m, _STATIONS + 1)

    @property
    def key(self) -> str:
        """Identity of what is simulated for given draws: neither words nor the number of launches count."""
        content: list[Any] = [self.base.hash, self.solver, self.stations.tolist()]
        content += [DescentJam._fields, LIBRARY.fingerprint]
        content.append({name: one.model_dump() for name, one in self.parameters.items()})
        if self.terrain is not None:
            content += [self.terrain.vertices.tolist(), _central(self.start_m)]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:12]

    def values(self, draws: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what ``draws`` in (0, 1), shape (N, parameters), stand for, in the units of the keys; same shape."""
        columns = zip(self.parameters.values(), draws.T, strict=True)
        return np.column_stack([distribution.at(column) for distribution, column in columns])

    def scenes(self, values: NDArray[np.float64]) -> Scenes:
        """Return the descents of values of the parameters, shape (N, parameters)."""
        base = self.base
        given = dict(zip(self.parameters, values.T, strict=True))
        given |= {name: np.radians(column) for name, column in given.items() if name.endswith("_deg")}
        contexts = np.tile(base.ranges[0], (len(values), 1))
        for name, field in (_CONTEXT | {_BUMPS: "track"}).items():
            if name in given:
                contexts[:, Context._fields.index(field)] = given[name]
        scenes = base.scenes(contexts)
        if self._of_bodies:
            scenes.rows["body"] = np.arange(len(values))
            scenes = scenes._replace(bodies=records_of(list(self._bodies(values)), len(values)))
        for name, field in (_LAW | _SLOPE).items():
            if name in given:
                scenes.rows[field] = given[name]
        if self.terrain is not None:
            scenes = self._on_ground(self.terrain, given, scenes)
        rows, launches = scenes.rows, scenes.launches
        rows["settle_speed"] = settle_speed(rows["gravity"], scenes.of_body("size"))
        launches[:, 0] = given.get(_START, self.start_m)
        lowest = scenes.resting_heights(launches[:, 0], launches[:, 2])
        launches[:, 1] = contexts[:, Context._fields.index("drop")] + lowest
        if len(scenes.zones):  # which may overlap where one is drawn
            zones = scenes.zones.reshape(len(rows), -1, len(Zone._fields))
            check_zones(zones, np.full(len(rows), np.inf))
        return admitted(scenes, base.settings(self.solver))

    def _on_ground(self, terrain: TerrainSection, given: dict[str, NDArray[np.float64]], scenes: Scenes) -> Scenes:
        """Return scenes over the profile of the terrain, with what is drawn of materials."""
        runs, commonest = terrain.zones, terrain.commonest
        zones = scenes.zones.reshape(len(scenes.rows), len(runs), len(Zone._fields)).copy()
        for key, fields in _MATERIAL.items():
            for k, run in enumerate(runs):
                for i in map(Zone._fields.index, fields):
                    zones[:, k, i] = given.get(f"materials.{run.material}.{key}", zones[:, k, i])
            around = given.get(f"materials.{commonest}.{key}")
            for field in fields if around is not None else ():
                of_law = field == "restitution"
                scenes.rows["asymmetry" if of_law else field] = asymmetry_of(around) if of_law else around
        told = terrain.vertices
        ground = Grounds.of((vertices_of(checked_profile(told[:, :2], told[:, 2])),))
        scenes.rows["ground"], scenes.rows["ground_end"] = ground.places.T
        return scenes._replace(pieces=ground.pieces, zones=zones.reshape(-1, len(Zone._fields)))

    def check_bodies(self, values: NDArray[np.float64]) -> None:
        """Raise StudyError, saying how many, if some values of the parameters make no body; none of them is kept."""
        for _ in self._bodies(values if self._of_bodies else values[:0]):
            pass

    @property
    def _of_bodies(self) -> dict[int, str]:
        """Keys of the body that are uncertain, by the number of the parameter."""
        return {i: name.partition(".")[2] for i, name in enumerate(self.parameters) if name.startswith("body.")}

    def _bodies(self, values: NDArray[np.float64]) -> Iterator[Body]:
        """Body of each row of values that makes one; afterwards an error if some do not."""
        section, at = self.base.body_section, self._of_bodies
        assert not isinstance(section, ChoiceBody)  # by _can_be_simulated
        kind, certain = type(section), section.model_dump()
        wrong = []
        for row in values[:, list(at)].tolist():
            try:
                yield kind.model_validate(certain | dict(zip(at.values(), row, strict=True))).build()
            except ValidationError as error:
                wrong.append(kind.explain(error.errors()[0]))
        if wrong:
            share = len(wrong) / len(values)
            raise StudyError(f"study {self.id}: a share of {share:.2g} of all draws is no body, such as {wrong[0]}")

    def _misfit(self, name: str, distribution: Distribution) -> str:
        """Return what is wrong where a distribution leaves what its key allows, else nothing."""
        quantity = self._quantity(name)
        try:
            for end in distribution.ends:
                quantity.number(end)
        except ValueError:
            share = distribution.outside(*quantity.ends)
            hint = ": truncated_normal has bounds" if distribution.kind == "normal" else ""
            return f"{name}: {distribution.words}: a share of {share:.2g} lies outside {quantity.interval}{hint}"
        return ""

    def _quantity(self, name: str) -> Quantity:
        """Return what a key accepts."""
        if name == _START:
            assert self.terrain is not None  # by _hillside
            return Quantity(f"[0, {self.terrain.length:g}) m")
        part, _, key = name.partition(".")
        if part == "materials":
            return MaterialSection.quantities()[key.rpartition(".")[2]]
        section = type(self.base.body_section) if part == "body" else _SECTIONS[part]
        return section.quantities()[key]


def load_study(name_or_path: str | os.PathLike[str]) -> Study:
    """Read a study.

    Parameters
    ----------
    name_or_path : str or path
        A name out of ``study_names()``, or the path of a file that ends in ``.yaml``. The path of a scenario in it is
        seen from its folder.

    Returns
    -------
    Study
        Validated.

    Raises
    ------
    StudyError
        If there is no such study, or naming every wrong key of the file, its value and what is allowed.
    """
    return Study.load(name_or_path)


def study_names() -> tuple[str, ...]:
    """Return the names of the shipped studies, sorted."""
    return Study.names()


def _central(value: Any) -> Any:
    return float(value.at(np.array(0.5))) if isinstance(value, Distribution) else value


def _medians(given: Given) -> dict[str, Any]:
    return {key: _central(value) for key, value in given.items()}
