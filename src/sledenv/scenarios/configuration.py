"""Files of configuration: less of YAML than there is, keys that tell what they accept, errors that name them."""

from __future__ import annotations

import os
import re
import reprlib
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Self, get_args

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, ErrorDetails, core_schema

from sledenv.machine.files import read_text
from sledenv.machine.shipped import CONFIGS, find_file, shipped, suggestion

Pair = tuple[float, float]

_MOST_BYTES: Final = 2**22  # of a file; one of 16384 vertices has a tenth of it
_NUMBERS = {  # tags of YAML, and how they are written here
    "tag:yaml.org,2002:int": r"[-+]?(0|[1-9][0-9]*)$",
    "tag:yaml.org,2002:float": r"[-+]?((0|[1-9][0-9]*|(?=\.[0-9]))(\.[0-9]*)?([eE][-+]?[0-9]+)?|\.inf)$|\.nan$",
}
_WORDING = {
    "model_type": "must be a mapping of keys to values",
    "model_attributes_type": "must be a mapping of keys to values",
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "string_pattern_mismatch": "must be lower-case letters, digits and underscores",
    "tuple_type": "must be a list",
}


class Quantity:
    """Numbers that a key accepts: those in an interval that is written with its unit, as in ``"(0, 90] deg"``.

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
        if isinstance(value, bool | np.timedelta64) or not isinstance(value, int | float | np.integer | np.floating):
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


class Bounds(Quantity):
    """Two numbers of an interval, the lower first."""

    form = "a pair [low, high] of numbers"

    def read(self, value: Any) -> Pair:
        """Return both numbers, or raise ValueError."""
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise ValueError(f"must be {self.allowed}")
        low, high = self.number(value[0]), self.number(value[1])
        self.compare(low, high)
        return low, high

    def compare(self, low: float, high: float) -> None:
        """Raise ValueError unless ``low`` is below ``high``."""
        if low >= high:
            raise ValueError(f"low must be below high; must be {self.allowed}")


class Range(Bounds):
    """Range of a draw: two numbers of an interval, or one."""

    form = "a number, or a pair [low, high] to sample,"

    def read(self, value: Any) -> Pair:
        """Return lowest and highest number, or raise ValueError."""
        return super().read(value if isinstance(value, list | tuple) else (value, value))

    def compare(self, low: float, high: float) -> None:
        """Raise ValueError if ``low`` is above ``high``."""
        if low > high:
            raise ValueError(f"low must not exceed high; must be {self.allowed}")


class OneOrSeveral(Quantity):
    """A number of an interval, or a list of them."""

    form = "a number, or a list of numbers,"

    def read(self, value: Any) -> float | tuple[float, ...]:
        """Return the number, or the numbers, or raise ValueError."""
        return tuple(map(self.number, value)) if isinstance(value, list | tuple) else self.number(value)


class Point(Quantity):
    """A point of a plane: two numbers of an interval."""

    form = "a pair [x, y] of numbers"

    def read(self, value: Any) -> Pair:
        """Return x and y, or raise ValueError."""
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise ValueError(f"must be {self.allowed}")
        return self.number(value[0]), self.number(value[1])


class Points(Quantity):
    """Points of a plane: rows of numbers of an interval.

    Parameters
    ----------
    interval : str
        As for ``Quantity``.
    fewest, most : int
        How many there may be.
    rows : str
        What each is, with its numbers in brackets.
    """

    def __init__(self, interval: str, fewest: int, most: int, rows: str = "pairs [x, y]") -> None:
        super().__init__(interval)
        self.allowed = f"a list of {fewest} to {most} {rows} of numbers in {interval}"
        self._counts = range(fewest, most + 1)
        self._columns = rows.count(",") + 1

    def read(self, value: Any) -> tuple[tuple[float, ...], ...]:
        """Return the points, or raise ValueError."""
        if not isinstance(value, list | tuple) or len(value) not in self._counts:
            raise ValueError(f"must be {self.allowed}")
        if not all(isinstance(point, list | tuple) and len(point) == self._columns for point in value):
            raise ValueError(f"must be {self.allowed}")
        return tuple(tuple(map(self.number, point)) for point in value)


class Section(BaseModel):
    """A mapping of a file of configuration: immutable, and without unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", serialize_by_alias=True)

    @classmethod
    def quantities(cls) -> dict[str, Quantity]:
        """Return what the keys that are numbers accept."""
        fields = cls.model_fields.items()
        return {key: mark for key, field in fields for mark in field.metadata if isinstance(mark, Quantity)}

    @classmethod
    def problems(cls, error: ValidationError) -> list[str]:
        """Return what is wrong, a line each: missing keys last, as an unknown one before them may be one misspelt."""
        ranked = sorted(error.errors(), key=lambda details: details["type"] == "missing")
        # A list with wrong entries is not too short: pydantic counts the right ones.
        ranked = [one for one in ranked if one["type"] != "too_short" or len(one["input"]) < one["ctx"]["min_length"]]
        return [line for details in ranked for line in cls.explain(details).splitlines()]

    @classmethod
    def explain(cls, error: ErrorDetails) -> str:
        """Return what is wrong with a key, in one line: its dotted name, its value and what is allowed."""
        owner, names = cls._place(error["loc"])
        path, key = ".".join(names), next((name for name in reversed(names) if not name.isdecimal()), "")
        fields, value = owner._fields(), reprlib.repr(error["input"])
        match error["type"]:
            case "missing":
                accepted = [mark.allowed for mark in fields[key].metadata if isinstance(mark, Quantity)]
                accepted += _needed(fields[key].annotation)
                return f"{path}: missing" + "".join(f"; must be {allowed}" for allowed in accepted)
            case "extra_forbidden":
                return f"{path} = {value}: unknown key{suggestion(key, fields)}; known: {', '.join(fields)}"
            case "union_tag_not_found":
                return f"{path}.{wrong_kind(None, _kinds(fields[key].annotation))}"
            case "union_tag_invalid":
                return f"{path}.{wrong_kind(error['ctx']['tag'], _kinds(fields[key].annotation))}"
            case "value_error":
                text = str(error["ctx"]["error"])
            case "too_short":
                least = error["ctx"]["min_length"]
                text = f"must have at least {least} {'entry' if least == 1 else 'entries'}"
            case "too_long":
                text = f"must have at most {error['ctx']['max_length']} entries"
            case other:
                text = _WORDING.get(other, error["msg"])
        if isinstance(error["input"], dict) or not path:
            return f"{path}: {text}" if path else text
        return f"{path} = {value}: {text}"

    @classmethod
    def _place(cls, location: tuple[int | str, ...]) -> tuple[type[Section], list[str]]:
        """Return the section that a key is in and the names that lead to the key, for a location of pydantic's."""
        owner: type[Section] = cls
        inner: dict[str, type[Section]] = {}  # sections that the next name may be in
        names: list[str] = []
        for part in map(str, location):
            if part in inner and len(inner) > 1:  # not a name of the file: which kind of section was read
                inner = {part: inner[part]}
                continue
            names.append(part)
            if part.isdecimal():  # of a list
                continue
            owner = next(iter(inner.values()), owner)
            inner = _kinds(owner._fields()[part].annotation) if part in owner._fields() else {}
        return owner, names

    @classmethod
    def _fields(cls) -> dict[str, FieldInfo]:
        return {field.alias or name: field for name, field in cls.model_fields.items()}


def _kinds(annotation: Any) -> dict[str, type[Section]]:
    """Return the sections that a key may hold by their kind; one that has no kind is called by its class."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        kinds = get_args(annotation.model_fields["kind"].annotation) if "kind" in annotation.model_fields else ()
        return {str(next(iter(kinds), annotation.__name__)): annotation}
    return {name: kind for inner in get_args(annotation) for name, kind in _kinds(inner).items()}


def _needed(annotation: Any) -> list[str]:
    """Return what a key that must hold a section accepts; of any other key nothing."""
    kinds = _kinds(annotation)
    if len(kinds) > 1:
        return [f"a mapping with kind, one of {', '.join(kinds)}"]
    if annotation not in kinds.values():
        return []
    names = [name for name, field in annotation._fields().items() if field.is_required()]
    return [f"a mapping with {', '.join(names)}"]


class Document(Section):
    """A file of configuration as a whole. Some ship with the package and are found by their names."""

    called: ClassVar[str]  # what messages call one
    folder: ClassVar[str]  # of those that ship
    error: ClassVar[type[ValueError]]

    id: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    title: str

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.id!r}, {self.title!r})"

    __str__ = __repr__

    @classmethod
    def model_validate(cls, obj: Any, **options: Any) -> Self:
        """Build one from a mapping that has the keys of the YAML file.

        Raises
        ------
        ValueError
            Of the type ``error``, naming every wrong key, its value and what is allowed.
        """
        name = obj.get("id", "without id") if isinstance(obj, dict) else "without id"
        return cls._validated(obj, f"{cls.called} {name}", options)

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return the names of the files that ship, sorted."""
        return shipped(cls.folder)

    @classmethod
    def find(cls, name_or_path: str | os.PathLike[str]) -> Path:
        """Return the file of a name out of :meth:`names`; a path ends in ``.yaml`` and is returned as it is.

        Raises
        ------
        TypeError, ValueError
            Of the type ``error``, if there is no such name.
        """
        if not isinstance(name_or_path, str | os.PathLike):
            raise TypeError(f"{cls.called} = {name_or_path!r}: must be the name of one or the path of a file")
        try:
            return find_file(cls.called, cls.folder, os.fspath(name_or_path))
        except ValueError as error:
            raise cls.error(str(error)) from None

    @classmethod
    def load(cls, name_or_path: str | os.PathLike[str]) -> Self:
        """Read a file, as :meth:`find` finds it.

        Raises
        ------
        TypeError, ValueError
            Of the type ``error``, if there is no such file, or naming every wrong key, its value and what is allowed.
        """
        file = cls.find(name_or_path)
        source = file.name if file.parent == CONFIGS / cls.folder else str(file)
        try:
            content = read_yaml(file)
        except (OSError, ValueError) as problem:
            raise cls.error(f"{source}: cannot be read: {' '.join(str(problem).split())}") from problem
        return cls._validated(cls.seen_from(file.parent, content), source, {})

    @classmethod
    def seen_from(cls, folder: Path, content: Any) -> Any:
        """Return what a file in a folder holds, with the paths in it as they are seen from here."""
        return content

    @classmethod
    def _validated(cls, obj: Any, source: str, options: dict[str, Any]) -> Self:
        try:
            return super().model_validate(obj, **options)
        except ValidationError as error:
            lines = cls.problems(error)
        raise cls.error("\n".join(f"{source}: {line}" for line in lines))


def wrong_kind(kind: Any, known: Collection[str]) -> str:
    """Return what is wrong with a key ``kind`` that is none of those known, or None where it is missing."""
    if kind is None:
        return f"kind: missing; must be one of {', '.join(known)}"
    return f"kind = {reprlib.repr(kind)}: must be one of {', '.join(known)}{suggestion(str(kind), known)}"


def read_yaml(file: Path) -> Any:
    """Read plain data from a file, with less of YAML than there is: see the documentation of scenarios.

    Raises
    ------
    OSError, ValueError
        If it cannot be read.
    """
    try:
        return yaml.load(read_text(file, _MOST_BYTES), _Loader)
    except yaml.YAMLError as problem:
        raise ValueError(str(problem)) from problem
    except RecursionError:
        raise ValueError("nested too deeply") from None


def write_yaml(file: Path, content: Any) -> None:
    """Write plain data to a file, from which :func:`read_yaml` reads the same."""
    file.write_text(yaml.dump(content, Dumper=_Dumper, sort_keys=False), encoding="utf-8")


class _Loader(yaml.SafeLoader):
    """YAML in which a number is decimal, as in 1.2, a key text, and a repeated key or a reference an error."""

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
            key.tag = self.DEFAULT_SCALAR_TAG  # 8 and no are names too
        return node


# Without the numbers of YAML 1.1, to which 010 is 8, 1:30 is 90 and 1e7 is text.
_Loader.yaml_implicit_resolvers = {
    first: [(tag, form) for tag, form in known if tag not in _NUMBERS]
    for first, known in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
for _tag, _form in _NUMBERS.items():
    _Loader.add_implicit_resolver(_tag, re.compile(_form), list("-+.0123456789"))


class _Dumper(yaml.SafeDumper):
    """YAML of the loader above: text that it would take for a number is quoted, and what is repeated stands twice."""

    yaml_implicit_resolvers = _Loader.yaml_implicit_resolvers

    def ignore_aliases(self, data: Any) -> bool:
        return True
