"""Rules for numbers, words and tables that are given, and the errors that name what breaks them."""

from __future__ import annotations

import math
import reprlib
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Real
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

_T = TypeVar("_T", bound=tuple[Any, ...])
_V = TypeVar("_V")

Rule = tuple[Callable[[Any], Any], str]  # what accepts a float, or each entry of an array; what it accepts, in words

FINITE: Rule = (lambda v: abs(v) < math.inf, "a finite number")
NOT_NEGATIVE: Rule = (lambda v: (v >= 0.0) & (v < math.inf), "in [0, inf)")
STEEPNESS: Rule = (lambda v: abs(v) < math.pi / 2, "in (-pi/2, pi/2) rad")
RESTITUTION: Rule = (lambda v: (v > 0.0) & (v <= 1.0), "in (0, 1]")
CLOSED_FRACTION: Rule = (lambda v: (v >= 0.0) & (v <= 1.0), "in [0, 1]")
POSITIVE: Rule = (lambda v: (v > 0.0) & (v < math.inf), "in (0, inf)")
# Of bodies: masses [kg] and lengths [m], and what follows from them. Squares and energies of others are no numbers.
_LEAST, _MOST = 1e-50, 1e50
MEASURE: Rule = (lambda v: (v >= _LEAST) & (v <= _MOST), f"in [{_LEAST:g}, {_MOST:g}]")
MEASURE_OR_0: Rule = (lambda v: (v == 0.0) | MEASURE[0](v), f"0 or {MEASURE[1]}")
PLACE: Rule = (lambda v: abs(v) <= _MOST, f"in [-{_MOST:g}, {_MOST:g}]")
INERTIA: Rule = (lambda v: (v >= 1e-250) & (v <= 1e150), "in [1e-250, 1e+150]")


def or_absent(rule: Rule) -> Rule:
    """Rule of the entries of an array that may be NaN, where there is none."""
    accepts, allowed = rule
    return lambda v: accepts(v) | np.isnan(v), allowed


def checked(owner: str, field: str, value: Any, rule: Rule) -> float:
    """Return ``value`` as a float, or raise an error that names field, value and allowed range.

    Raises
    ------
    TypeError
        If ``value`` is not a real number.
    ValueError
        If ``value`` is NaN or outside the range.
    """
    accepts, allowed = rule
    if type(value) is float and accepts(value):
        return value
    try:
        kind = getattr(getattr(value, "dtype", None), "kind", "f")  # a tensor's type has none
        real = isinstance(value, Real) or hasattr(value, "dtype")  # of others float() reads words, or drops digits
        if not real or isinstance(value, bool | np.ma.MaskedArray) or kind not in "iuf":
            raise TypeError
        number = float(value)
    except (TypeError, ValueError, RuntimeError):
        comma = "," if allowed.startswith("a ") else ""
        raise TypeError(f"{owner}.{field} = {value!r}: must be a number{comma} {allowed}") from None
    except OverflowError:  # an integer that no float holds
        raise ValueError(f"{owner}.{field} = {reprlib.repr(value)}: must be {allowed}") from None
    if not accepts(number):
        raise ValueError(f"{owner}.{field} = {value!r}: must be {allowed}")
    return number


class Checked:
    """Base of named tuples of floats whose fields are checked in whatever way one is made: ``_replace`` uses this."""

    __slots__ = ()

    if not TYPE_CHECKING:  # whose named tuples allow no other

        @classmethod
        def _make(cls, iterable):
            return cls(*iterable)


def ruled(kind: type[Any]) -> tuple[str, ...]:
    """Return the fields of a named tuple that have rules; behind them may be others, as the zones of a slope."""
    fields: tuple[str, ...] = kind._fields[: len(kind.rules)]
    return fields


def made(name: str, kind: type[_T], value: Any) -> _T:
    """Return an argument as the kind of tuple that it must be, every field checked.

    A sequence without names is one as well, if it has a number for each field that has a rule.

    Raises
    ------
    TypeError, ValueError
        Naming the argument or the field, its value and what is allowed.
    """
    if type(value) is kind:
        return value
    fields = ruled(kind)
    own = isinstance(value, kind.__bases__[-1])  # of the kernel
    plain = type(value) in (tuple, list) or (isinstance(value, np.ndarray) and value.ndim == 1)
    if own or (plain and len(value) == len(fields)):
        return kind(*value)
    raise TypeError(f"{name} = {value!r}: must be a {kind.__name__}, or as many numbers: {', '.join(fields)}")


def checked_fields(kind: type[Any], *values: Any) -> tuple[float, ...]:
    """Return the fields of a named tuple that have ``rules``, floats, each checked."""
    for value, (accepts, _) in zip(values, kind.rules, strict=True):
        if type(value) is not float or not accepts(value):
            break
    else:
        return values
    columns = zip(ruled(kind), values, kind.rules, strict=True)
    return tuple(checked(kind.__name__, field, value, rule) for field, value, rule in columns)


def checked_rows(owner: str, kind: type[Any], rows: np.ndarray) -> None:
    """Check many tuples of one kind at once.

    Parameters
    ----------
    owner : str
        What the message calls a row; ``{lane}`` in it becomes the number of the row.
    kind : type
        A named tuple of floats with ``rules``, one for each field, such as :class:`sledenv.Slope`.
    rows : ndarray of float, shape (N, fields)

    Raises
    ------
    ValueError
        Naming row, field, value and allowed range.
    """
    _check_columns(owner, rows, ruled(kind), kind.rules)


def checked_table(name: str, given: Any, fields: Sequence[str], rules: Sequence[Rule] = ()) -> np.ndarray:
    """Return the numbers of a table that users give, whatever kind of table it is.

    Parameters
    ----------
    name : str
        What messages call the table.
    given : DataFrame, Series or array_like
        N rows, or one. The columns of a DataFrame and the labels of a Series are the fields, in any order. Those of
        anything else, of arrays and of lists of tuples, are taken by position.
    fields : sequence of str
        Names of the columns.
    rules : sequence of Rule, optional
        What the numbers of each of the first columns must be; without one a column may hold anything, NaN too.

    Returns
    -------
    ndarray of float, shape (N, fields)
        A new array.

    Raises
    ------
    TypeError, ValueError
        Naming the column that is unknown, missing, there twice or without numbers; the shape; masked numbers; or the
        row and the field, its value and the allowed range.
    """
    columns = f"columns {', '.join(fields)}"
    if _is_series(given):
        given = given.to_frame().T.infer_objects()
    if is_frame(given):
        table = _columns_by_name(name, given, fields)
    else:
        table = np.atleast_2d(numbers_of(name, given, f"numbers, {columns}", fields))
    if table.ndim != 2 or table.shape[1] != len(fields):
        raise ValueError(f"{name} has shape {np.shape(given)}: must be (N, {len(fields)}), {columns}")
    _check_columns(f"{name}[{{lane}}]", table, fields, rules)
    return table


def checked_array(name: str, given: Any, rule: Rule) -> np.ndarray:
    """Return a number, or an array of them of any shape, as floats.

    Raises
    ------
    TypeError, ValueError
        Naming the array or its entry, the value and what is allowed.
    """
    accepts, allowed = rule
    numbers: np.ndarray = numbers_of(name, given, f"numbers, each {allowed}")
    bad = ~accepts(numbers)
    if bad.any():
        where = np.unravel_index(int(np.argmax(bad)), numbers.shape)
        index = f"[{', '.join(map(str, where))}]" if numbers.ndim else ""
        raise ValueError(f"{name}{index} = {float(numbers[where])!r}: must be {allowed}")
    return numbers


def numbers_of(name: str, given: Any, wanted: str, fields: Sequence[str] = ()) -> np.ndarray:
    """Return what a user gives as an array of floats, a new one in the order of C.

    Parameters
    ----------
    name : str
        What messages call it.
    given : array_like
    wanted : str
        What it must hold, for messages.
    fields : sequence of str, optional
        Names that tuples in it must have, if they have names.

    Raises
    ------
    TypeError, ValueError
        Naming it and its value, or what it holds that is no number: words, bytes, True or False, what is masked,
        integers of more than 64 bits.
    """
    if not isinstance(given, bool | np.bool_):
        _check_entries(name, given, wanted, fields)
    try:
        array = np.asarray(given)
    except (TypeError, ValueError, RuntimeError):  # rows of different lengths; a tensor that requires a gradient
        array = np.asarray(None)
    if array.dtype.kind not in "iuf":
        if array.ndim == 0:
            raise TypeError(f"{name} = {reprlib.repr(given)}: must be {wanted}")
        found = "True or False" if array.dtype.kind == "b" else array.dtype
        raise TypeError(f"{name} holds {found}: must hold {wanted}")
    return np.array(array, dtype=float, order="C")


def is_frame(given: Any) -> bool:
    """Whether this is a DataFrame, of pandas or of another library."""
    return hasattr(given, "columns") and hasattr(given, "to_numpy")


def _is_series(given: Any) -> bool:
    """Whether this is a row or a column of a DataFrame of pandas."""
    return hasattr(given, "index") and hasattr(given, "to_frame")


def is_named(given: Any) -> bool:
    """Whether this has columns, or entries, that go by their names."""
    return is_frame(given) or _is_series(given)


def check_names(name: str, columns: Iterable[Any]) -> None:
    """Raise ValueError, naming it, if a column of a table is there twice."""
    twice = [column for column, count in Counter(columns).items() if count > 1]
    if twice:
        raise ValueError(f"{name} has the column {twice[0]!r} more than once")


def _columns_by_name(name: str, given: Any, fields: Sequence[str]) -> np.ndarray:
    """Columns of a DataFrame in the order of the fields, shape (N, fields)."""
    there, columns = list(given.columns), f"columns {', '.join(fields)}"
    check_names(name, there)
    for column in there:
        if column not in fields:
            raise ValueError(f"{name} has the column {column!r}: must have the {columns}")
    table = np.empty((len(given), len(fields)))
    for i, field in enumerate(fields):
        if field not in there:
            raise ValueError(f"{name} has no column {field!r}: must have the {columns}")
        table[:, i] = numbers_of(f"{name}.{field}", given[field], "numbers")
    return table


def _check_entries(name: str, given: Any, wanted: str, fields: Sequence[str]) -> None:
    """Refuse what NumPy would take for numbers in lists, or take by position though it has other names."""
    if isinstance(given, tuple | list):
        for one in given:
            if type(one) is not float:  # as nearly all are
                _check_entries(name, one, wanted, fields)
        other = getattr(given, "_fields", ())
        if fields and other and tuple(other) != tuple(fields):
            found = f"a {type(given).__name__} of {', '.join(other)}"
            raise TypeError(f"{name} holds {found}: must have {', '.join(fields)}")
    elif isinstance(given, bool | np.bool_):
        raise TypeError(f"{name} holds True or False: must hold {wanted}")
    elif isinstance(given, bytearray | memoryview):
        raise TypeError(f"{name} holds a {type(given).__name__}: must hold {wanted}")
    elif isinstance(given, int) and not -(2**63) <= given < 2**64:
        raise ValueError(f"{name} holds {reprlib.repr(given)}: must hold {wanted}; no integer of more than 64 bits")
    elif isinstance(given, np.ma.MaskedArray):
        raise TypeError(f"{name} is a masked array, or holds one: must hold {wanted}, without a mask")
    elif fields and _is_series(given):
        raise TypeError(f"{name} holds a {type(given).__name__}: must be one DataFrame, or hold numbers")


def _check_columns(owner: str, rows: np.ndarray, fields: Sequence[str], rules: Sequence[Rule]) -> None:
    """Raise ValueError, naming row, field, value and allowed range, for the first number that its rule refuses."""
    for column, field, (accepts, allowed) in zip(rows.T, fields, rules, strict=False):
        accepted = accepts(column)
        if not accepted.all():
            lane = int(np.argmin(accepted))
            value = float(column[lane])
            raise ValueError(f"{owner.format(lane=lane)}.{field} = {value!r}: must be {allowed}")


def checked_kind(name: str, value: Any, kind: type[_V]) -> _V:
    """Return what must be of a kind, or raise TypeError."""
    if not isinstance(value, kind):
        raise TypeError(f"{name} = {reprlib.repr(value)}: must be a {kind.__name__}")
    return value


def checked_sequence(name: str, values: Iterable[_V], kind: type[_V]) -> list[_V]:
    """Return some things that must be of a kind, or raise TypeError."""
    if not isinstance(values, Iterable) or isinstance(values, str | Mapping) or has_no_length(values):
        raise TypeError(f"{name} = {reprlib.repr(values)}: must be a sequence of {kind.__name__}")
    return [checked_kind(f"{name}[{i}]", value, kind) for i, value in enumerate(values)]


def checked_choice(name: str, value: str, allowed: tuple[str, ...]) -> str:
    """Return one of the words that are allowed, or raise ValueError."""
    if not isinstance(value, str) or value not in allowed:
        raise ValueError(f"{name} = {value!r}: must be one of {', '.join(map(repr, allowed))}")
    return value


def checked_names(
    name: str, given: Any, allowed: Sequence[str], wanted: str = "a sequence of any of"
) -> tuple[str, ...]:
    """Return words of a sequence, each of which is allowed, or raise ValueError."""
    try:
        names = None if isinstance(given, str) else tuple(given)
    except TypeError:
        names = None
    if names is None or not all(isinstance(one, str) and one in allowed for one in names):
        raise ValueError(f"{name} = {given!r}: must be {wanted} {', '.join(map(repr, allowed))}")
    return names


def has_no_length(value: object) -> bool:
    """Whether this is an array of no dimensions, such as ``numpy.ma.masked``, which is no sequence either."""
    return getattr(value, "ndim", 1) == 0


def is_whole(value: object) -> bool:
    """Whether this is a whole number of some kind; a time of NumPy's is none."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool | np.timedelta64)


def checked_count(name: str, value: int, least: int = 1) -> int:
    """Return a number of things, at least so many, or raise TypeError or ValueError."""
    if not is_whole(value):
        raise TypeError(f"{name} = {value!r}: must be an integer >= {least}")
    if not least <= value < 2**63:
        allowed = f">= {least}" if value < least else "below 2**63"
        raise ValueError(f"{name} = {reprlib.repr(value)}: must be an integer {allowed}")
    return int(value)


def checked_seed(value: int | np.integer[Any], name: str = "seed") -> int:
    """Return a seed, an integer at or above 0, or raise TypeError or ValueError."""
    if not is_whole(value):
        raise TypeError(f"{name} = {value!r}: must be an integer >= 0")
    if value < 0:
        raise ValueError(f"{name} = {value!r}: must be an integer >= 0")
    return int(value)


def checked_pair(name: str, value: tuple[Any, Any]) -> tuple[Any, Any]:
    """Return two of something, or raise TypeError."""
    if not isinstance(value, tuple | list | np.ndarray) or has_no_length(value) or len(value) != 2:
        raise TypeError(f"{name} = {value!r}: must be a pair")
    first, second = value
    return first, second


def checked_mapping(name: str, value: Mapping[str, _V] | None) -> Mapping[str, _V]:
    """Return what is given by names, nothing for None, or raise TypeError."""
    if not isinstance(value, Mapping | None) or not all(isinstance(key, str) for key in value or ()):
        raise TypeError(f"{name} = {value!r}: must be a mapping of names to values")
    return value or {}


def checked_bounds(value: Mapping[str, tuple[float, float]] | None) -> dict[str, tuple[float, float]]:
    """Return lowest and highest values by their names, whatever their order, or raise TypeError or ValueError."""
    pairs = {name: checked_pair(f"bounds, {name!r}", pair) for name, pair in checked_mapping("bounds", value).items()}
    finite = {name: [checked("bounds", name, end, FINITE) for end in pair] for name, pair in pairs.items()}
    return {name: (low, high) for name, (low, high) in finite.items()}


def checked_flag(name: str, value: bool) -> bool:
    """Return whether something is to be, or raise TypeError."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name} = {value!r}: must be True or False")
    return bool(value)


def warn_user(text: str) -> None:
    """Warn where the user calls the package."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and str(frame.f_globals.get("__name__")).startswith(("sledenv.", "pydantic.")):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, stacklevel=level)
