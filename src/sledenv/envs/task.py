"""What every environment shares: contexts, their observation, launch of an action, reward and info.

Contexts, observations, actions and launches are arrays with one row a lane; the scalar environments have one lane.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any, Final, Literal, get_args

import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction
from numpy.typing import ArrayLike, NDArray

from sledenv.descent import Descent, DescentBatch, Record, simulate, simulate_batch
from sledenv.kernel.params import ContactLaw, Slope, State, checked_rows
from sledenv.kernel.records import FINISH, LEDGER_FIELDS, REBOUND, STATUS_OF_CODE
from sledenv.scenario import Context, Scenario, load_scenario

Control = Literal["both", "orientation", "spin"]
Contexts = NDArray[np.float64]  # (n, 8), columns as in Context

INFO_KEYS: Final = ("context", "rebounds", "jam", "is_success", "descent")

_CONTROLLED: dict[str, tuple[str, ...]] = {
    "both": ("orientation", "spin"),
    "orientation": ("orientation",),
    "spin": ("spin",),
}
_STATUS = np.array([str(status) for status in STATUS_OF_CODE], dtype=object)


class Task:
    """A scenario and what the agent controls of its launch.

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    control : {"both", "orientation", "spin"}
        Which of the launch the agent chooses; the rest is part of the context.

    Attributes
    ----------
    draws : int
        Doubles that the context of one episode takes from a random stream.

    Raises
    ------
    ScenarioError, ValueError
        For an unknown scenario or control.
    """

    draws = len(Context._fields)

    def __init__(self, scenario: str | os.PathLike[str] | Scenario, control: Control) -> None:
        if control not in get_args(Control):
            raise ValueError(f"control = {control!r}: must be one of {', '.join(map(repr, get_args(Control)))}")
        self.scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
        self.controlled = _CONTROLLED[control]
        self.body = self.scenario.body()
        self._context_low, self._context_high = self.scenario.ranges
        self._chosen = [Context._fields.index(name) for name in self.controlled]
        self._width = self._context_high - self._context_low
        self._width[self._chosen] = 0.0  # as if it did not vary
        bounds = {
            "orientation": np.radians(self.scenario.control.orientation_deg),
            "spin": np.array(self.scenario.control.spin_rad_s),
        }
        self._action_low, self._action_high = np.array([bounds[name] for name in self.controlled]).T.copy()
        self.observation_space = spaces.Box(-1.0, 1.0, (len(Context._fields),), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (len(self.controlled),), np.float32)

    def draw(self, draws: NDArray[np.float64]) -> Contexts:
        """Return the contexts of ``draws`` in [0, 1), shape (n, 8)."""
        return self.scenario.contexts(draws)

    def given(self, context: ArrayLike, lanes: int = 1) -> Contexts:
        """Return contexts that a user gives, shape (lanes, 8).

        Parameters
        ----------
        context : array_like, shape (8,) or (lanes, 8)
            One for all lanes or one a lane, fields as in :class:`sledenv.Context`.
        lanes : int

        Raises
        ------
        ValueError
            If it has another shape, or naming the field, its value and the allowed range.
        """
        shape = (lanes, len(Context._fields))
        rows = np.array(context, dtype=np.float64, order="C")
        if rows.shape not in (shape, shape[1:]):
            raise ValueError(f"context has shape {rows.shape}: must be {shape[1:]} or {shape}")
        single = rows.ndim == 1
        checked_rows("context" if single else "context[{lane}]", Context, np.atleast_2d(rows))
        return np.array(np.broadcast_to(rows, shape))

    def observe(self, contexts: Contexts) -> NDArray[np.float32]:
        """Scale contexts to [-1, 1] by the ranges of the scenario, float32 of shape (n, 8).

        What does not vary and what the agent controls reads 0.
        """
        varies = self._width > 0.0
        centred = 2.0 * (contexts - self._context_low) / np.where(varies, self._width, 1.0) - 1.0
        return np.where(varies, np.clip(centred, -1.0, 1.0), 0.0).astype(np.float32)

    def launches(self, contexts: Contexts, actions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the states at launch that actions ask for, shape (n, 6), columns as in :class:`sledenv.State`.

        Parameters
        ----------
        contexts : ndarray, shape (n, 8)
        actions : ndarray, shape (n, 1) or (n, 2)
            Out of :func:`checked_actions`, scaled to the control bounds of the scenario: orientation and/or spin.
        """
        chosen = contexts.copy()
        chosen[:, self._chosen] = self._action_low + 0.5 * (actions + 1.0) * (self._action_high - self._action_low)
        return self.scenario.launches(chosen)

    def descend(self, contexts: Contexts, launches: NDArray[np.float64], record: Record = "rebounds") -> Descent:
        """Simulate the one descent of contexts and launches with one row."""
        (law,), (slope,) = self.scenario.laws(contexts).tolist(), self.scenario.slopes(contexts).tolist()
        return simulate(
            self.body,
            ContactLaw._make(law),
            Slope._make(slope),
            State._make(launches[0].tolist()),
            max_time=self.scenario.limits.max_time_s,
            max_rebounds=self.scenario.limits.max_rebounds,
            record=record,
        )

    def descend_batch(
        self, contexts: Contexts, launches: NDArray[np.float64], *, keep_rebounds: bool = False
    ) -> DescentBatch:
        """Simulate one descent a row, on all cores; row i equals :meth:`descend` of row i bit for bit."""
        return simulate_batch(
            self.body,
            self.scenario.laws(contexts),
            self.scenario.slopes(contexts),
            launches,
            max_time=self.scenario.limits.max_time_s,
            max_rebounds=self.scenario.limits.max_rebounds,
            keep_rebounds=keep_rebounds,
        )

    def info(self, contexts: Contexts, batch: DescentBatch, keys: Iterable[str] = INFO_KEYS) -> dict[str, Any]:
        """Everything about descents that an agent may not see but its user wants to.

        Parameters
        ----------
        contexts : ndarray, shape (n, 8)
        batch : DescentBatch
            Of n descents; with their logs, if "rebounds" is among the keys.
        keys : iterable of str
            Which of ``INFO_KEYS`` to give.

        Returns
        -------
        dict
            Arrays of shape (n,), in dicts. Columns of rebounds and the status are arrays of objects: of lists, because
            logs differ in length, and of strings.
        """
        outcomes, jam = batch.outcomes, batch.jam
        info: dict[str, Any] = {}
        for key in keys:
            match key:
                case "context":
                    info[key] = self.context_info(contexts)
                case "rebounds":
                    info[key] = _lists(batch)
                case "jam":
                    info[key] = {
                        "progress": jam.progress,
                        "retention": jam.retention,
                        "jam_index": jam.jam_index,
                    }
                case "is_success":
                    info[key] = outcomes["status"] == FINISH
                case "descent":
                    energy = {name: outcomes[name].copy() for name in LEDGER_FIELDS}
                    info[key] = {
                        "status": _STATUS[outcomes["status"]],
                        "time": outcomes["t"].copy(),
                        "energy": energy,
                    }
        return info

    @staticmethod
    def context_info(contexts: Contexts) -> dict[str, Any]:
        """Return the fields of contexts, arrays of shape (n,)."""
        return dict(zip(Context._fields, contexts.T.copy(), strict=True))


def checked_actions(
    space: spaces.Box, actions: Any, lanes: int, acting: slice | NDArray[np.intp] = slice(None)
) -> NDArray[np.float64]:
    """Return actions as numbers, shape (lanes, k).

    Parameters
    ----------
    space : Box
        Of one lane, shape (k,).
    actions : array_like, shape (lanes, k)
    lanes : int
    acting : ndarray of int, optional
        Lanes whose actions count; all by default.

    Raises
    ------
    gymnasium.error.InvalidAction
        If they have another shape, or naming the first that is not a number or lies outside the box.
    """
    shape = (lanes, *space.shape)
    try:
        given = np.asarray(actions, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidAction(f"actions = {actions!r}: must be numbers of shape {shape}") from error
    if given.shape[:1] != shape[:1]:
        raise InvalidAction(f"actions have shape {given.shape}: must be {shape}")
    if given.shape != shape:
        raise InvalidAction(f"action has shape {given.shape[1:]}: must be {shape[1:]}")
    inside = np.ones(lanes, np.bool_)
    inside[acting] = np.all((given[acting] >= space.low) & (given[acting] <= space.high), axis=1)  # NaN is not
    if not inside.all():
        lane = int(np.argmin(inside))
        name = "action" if lanes == 1 else f"actions[{lane}]"
        raise InvalidAction(f"{name} = {given[lane].tolist()}: must be within [{space.low.min()}, {space.high.max()}]")
    return given


def only_lane(columns: dict[str, Any]) -> dict[str, Any]:
    """Return plain values in place of arrays of one lane, in a dict of dicts and arrays."""
    return {key: only_lane(value) if isinstance(value, dict) else value.item() for key, value in columns.items()}


def _lists(batch: DescentBatch) -> dict[str, np.ndarray]:
    """Fields of the rebounds of many descents: arrays of lists, because logs differ in length."""
    counts = batch.outcomes["rebounds"]
    rows = batch.rebounds[np.arange(batch.rebounds.shape[1]) < counts[:, np.newaxis]]
    ends = np.cumsum(counts).tolist()
    return {name: _split(rows[name].tolist(), ends) for name in REBOUND.names or ()}


def _split(values: list[float], ends: list[int]) -> np.ndarray:
    """Return an array of lists, each of which ends where ``ends`` says."""
    lists = np.empty(len(ends), dtype=object)
    start = 0
    for i, end in enumerate(ends):
        lists[i] = values[start:end]
        start = end
    return lists
