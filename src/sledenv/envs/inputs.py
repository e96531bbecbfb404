"""Inputs of environments, checked: what a user fixes of episodes that begin, and actions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction
from numpy.typing import NDArray

from sledenv.scenarios.scenario import Context, Split, check_split
from sledenv.simulation.rules import checked, checked_rows, checked_table, is_named, numbers_of

# (n, 12), columns as in Context; (n, 14) in a task with launch noise, that of orientation [rad] and spin [rad/s] behind
Contexts = NDArray[np.float64]

FIELDS: Final = len(Context._fields)
SEEN: Final = len(Context.seen)  # those that an agent may see, the first ones
_SLACK = 1e-4  # by which an action may lie outside the box: what RescaleAction's float32 cancels, with much to spare


class Given(NamedTuple):
    """All that a user fixes of episodes that begin."""

    fixed: NDArray[np.float64]  # (n, 12), columns as in Context; NaN where a field is to be drawn
    split: Split | tuple[Split | None, ...] | None  # a tuple has one per episode

    def of(self, rows: NDArray[np.intp]) -> Given:
        """Return what is given of some of the episodes."""
        split = tuple(self.split[i] for i in rows.tolist()) if isinstance(self.split, tuple) else self.split
        return Given(self.fixed[rows], split)


def checked_actions(
    space: spaces.Box,
    names: Sequence[str],
    actions: Any,
    lanes: int | None = None,
    acting: slice | NDArray[np.intp] = slice(None),
) -> NDArray[np.float64]:
    """Return actions as numbers, shape (lanes, k), or (1, k).

    Parameters
    ----------
    space : Box
        Of one lane, shape (k,).
    names : sequence of str
        What the k numbers are: columns of a DataFrame, in any order.
    actions : DataFrame or array_like, shape (lanes, k), or of one lane alone Series or array_like, shape (k,)
    lanes : int, optional
    acting : ndarray of int, optional
        Lanes whose actions count; all by default.

    Returns
    -------
    ndarray
        What lies outside the box by rounding, at most 1e-4, is on its bound.

    Raises
    ------
    gymnasium.error.InvalidAction
        If they have another shape or other columns, or naming the first that is not a number or lies outside the box.
    """
    shape = space.shape if lanes is None else (lanes, *space.shape)
    if type(actions) is np.ndarray and actions.shape == shape and actions.dtype.kind == "f":  # as of every network
        given = actions.astype(np.float64).reshape(-1, shape[-1])
    else:
        try:
            given = _table("actions", actions, names, [shape], "have")
        except (TypeError, ValueError) as error:
            raise InvalidAction(str(error)) from error
    within: NDArray[np.float64] = np.minimum(np.maximum(given, space.low), space.high)
    fine = np.abs(within - given) <= _SLACK  # NaN is not
    if not fine[acting].all():
        lane = int(np.arange(len(given))[acting][np.argmin(fine[acting].all(axis=1))])
        name = "action" if len(given) == 1 else f"actions[{lane}]"
        bounds = f"[{space.low.min()}, {space.high.max()}]"
        hint = "; gymnasium.wrappers.ClipAction puts others there" if np.isfinite(given[lane]).all() else ""
        raise InvalidAction(f"{name} = {given[lane].tolist()}: must be within {bounds}{hint}")
    return within


def _table(
    name: str, given: Any, fields: Sequence[str], shapes: Sequence[tuple[int, ...]], verb: str = "has"
) -> NDArray[np.float64]:
    """Return the numbers of a table that must have one of some shapes."""

    def check_shape(shape: tuple[int, ...]) -> None:
        if shape not in shapes:
            allowed = " or ".join(map(str, shapes))
            raise ValueError(f"{name} {verb} shape {shape}: must be {allowed}, columns {', '.join(fields)}")

    if not is_named(given):  # where names are wrong it is told first
        try:
            plain = np.asarray(given)
        except (TypeError, ValueError, RuntimeError):  # of which it is told below
            plain = np.empty(shapes[0])
        if plain.ndim and plain.dtype.kind in "biuf":
            check_shape(plain.shape)
    table = checked_table(name, given, fields)
    check_shape(np.asarray(given).shape)
    return table


def _fixed(context: Any, lanes: int, called: str = "context") -> NDArray[np.float64]:
    """Fields of contexts that a user fixes, shape (lanes, 12), NaN where one is to be drawn."""
    if isinstance(context, list | tuple) and any(isinstance(one, Mapping | None) for one in context):
        if len(context) != lanes:
            raise ValueError(f"{called} has {len(context)} entries: must be one per lane, {lanes}")
        return np.concatenate([_fixed(one, 1, f"context[{lane}]") for lane, one in enumerate(context)])
    fixed = np.full((lanes, FIELDS), np.nan)
    if isinstance(context, Mapping):
        for name, value in context.items():
            if name not in Context._fields:
                raise ValueError(f"unknown field {name!r} of context: must be one of {', '.join(Context._fields)}")
            i = Context._fields.index(name)
            column = numbers_of(f"{called}.{name}", value, "a number, or an array of them")
            if column.shape not in ((), (lanes,)):
                raise ValueError(f"{called}.{name} has shape {column.shape}: must be () or ({lanes},)")
            for lane, number in enumerate(column.reshape(-1).tolist()):
                checked(f"{called}[{lane}]" if column.ndim else called, name, number, Context.rules[i])
            fixed[:, i] = column
    elif context is not None:
        shape = lanes, FIELDS
        rows = _table(called, context, Context._fields, (shape[1:], shape))
        alone = np.ndim(context) == 1
        checked_rows(called if alone else f"{called}[{{lane}}]", Context, rows)
        fixed[:] = rows
    return fixed


def checked_options(options: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return a copy of the options of a reset, nothing for None, or raise TypeError."""
    if not isinstance(options, Mapping | None):
        raise TypeError(f"options = {options!r}: must be a mapping such as {{'split': 'test'}}")
    return dict(options or {})


def read_options(
    options: Mapping[str, Any] | None, default: Split | None, lanes: int = 1, also: tuple[str, ...] = ()
) -> Given:
    """Read the options of a reset.

    Parameters
    ----------
    options : mapping, optional
        ``context``: fields of the contexts, the others being drawn: a mapping of names to values, each a number or
        an array of shape (lanes,), or a whole context or one per lane, shape (12,) or (lanes, 12), of a Series or a
        DataFrame by its names; or a list of one per lane, each a mapping, a whole context or None.
        ``split``: in place of that of the task, for the episodes that this reset begins; or a list of one per lane.
    default : str, optional
        The split where the options name none.
    lanes : int
    also : tuple of str
        Options that the caller has taken out, for the message.

    Raises
    ------
    TypeError, ValueError
        For an unknown option or field, or a wrong shape, or naming the field, its value and the allowed range.
    """
    given = checked_options(options)
    context, split = given.pop("context", None), given.pop("split", default)
    if given:
        known = ", ".join(map(repr, ("context", "split", *also)))
        raise ValueError(f"unknown option {next(iter(given))!r}: must be one of {known}")
    splits = tuple(split) if isinstance(split, list | tuple) else (split,)
    if len(splits) not in (1, lanes):
        raise ValueError(f"split has {len(splits)} entries: must be one, or one per lane, {lanes}")
    for one in splits:
        if one is not None:
            check_split(one)
    fixed = _fixed(context, lanes)
    return Given(fixed, splits if len(set(splits)) > 1 else splits[0])
