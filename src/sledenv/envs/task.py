"""What every environment shares: contexts, their observation, launch of an action, reward and info.

Contexts, observations, actions and launches are arrays with one row a lane; the scalar environments have one lane.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Final, Literal, NamedTuple, get_args

import numpy as np
from gymnasium import spaces
from gymnasium.error import InvalidAction
from numpy.typing import NDArray

from sledenv.kernel.records import (
    FINISH,
    LEDGER_FIELDS,
    LOG_FULL,
    REBOUND,
    RUNNING,
    STATUS_OF_CODE,
    STEP_BUDGET,
    TIMEOUT,
)
from sledenv.scenarios.scenario import NOISY, Context, Scenario, Split, check_split, load_scenario
from sledenv.scenarios.sections import CONTROLS, control_words
from sledenv.simulation.bodies import Body
from sledenv.simulation.outcomes import Descent, DescentBatch, Record
from sledenv.simulation.ride import Ride, RideBatch
from sledenv.simulation.rules import NOT_NEGATIVE, checked, checked_rows
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.simulate import simulate, simulate_batch
from sledenv.simulation.support import directions, support_heights

Solver = Literal["compliant", "rigid"]
# (n, 8), columns as in Context; (n, 10) in a task with launch noise, that of orientation [rad] and spin [rad/s] behind
Contexts = NDArray[np.float64]

FIELDS: Final = len(Context._fields)
FLIGHT: Final = ("progress", "sine", "cosine", "u", "v", "omega", "trim", "time", "rebounds")
INFO_KEYS: Final = ("context", "rebounds", "jam", "is_success", "descent")

_DISTURBED = [Context._fields.index(name) for name in NOISY]
_TRUNCATED = np.isin(np.arange(len(STATUS_OF_CODE)), (TIMEOUT, LOG_FULL, STEP_BUDGET))  # by status
_SLACK = 1e-6  # by which an action may lie outside the box: a few units in the last place of its float32


class Given(NamedTuple):
    """What a user fixes of episodes that begin."""

    fixed: NDArray[np.float64]  # (n, 8), columns as in Context; NaN where a field is to be drawn
    split: Split | tuple[Split | None, ...] | None  # a tuple has one an episode

    def of(self, rows: NDArray[np.intp]) -> Given:
        """Return what is given of some of the episodes."""
        split = tuple(self.split[i] for i in rows.tolist()) if isinstance(self.split, tuple) else self.split
        return Given(self.fixed[rows], split)


class Task:
    """A scenario, what the agent controls of its launch, and how contexts are drawn and descents simulated.

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    control : str, optional
        What of the launch the agent chooses, a word of :func:`sledenv.scenarios.sections.control_words`; the rest is
        part of the context. What the scenario says by default.
    solver : {"compliant", "rigid"}
        As for :func:`sledenv.simulate`.
    split : {"train", "validation", "test"}, optional
        Which contexts are drawn, see :meth:`sledenv.Scenario.contexts`; all by default.
    launch_noise : pair of float, optional
        Standard deviations of normal noise on the orientation [rad] and on the spin [rad/s] at launch, >= 0; those of
        the scenario by default.

    Attributes
    ----------
    controlled : tuple of str
        What the agent chooses, in the order of its actions: of ``CONTROLS`` in :mod:`sledenv.scenarios.scenario`.
    control : str
        The first word for it, so that tasks with the same choice have the same.
    bounds : dict of ndarray, shape (2,)
        Lowest and highest value of all that an agent may choose here, in the units of a context.
    draws : int
        Doubles that the context and the launch noise of one episode take from a random stream.
    observation_space, action_space : Box
        Of a launch.
    ride_observation_space, ride_action_space : Box
        Of a launch with the hops that follow: the flight is behind the context, the trim behind the launch.
    observation_names, ride_observation_names, action_names, ride_action_names : tuple of str
        What their entries are.
    varies : ndarray of bool, shape (8,)
        Which fields of a context an agent sees: those that vary and that it does not choose.

    Raises
    ------
    ScenarioError, TypeError, ValueError
        For an unknown scenario, control, solver or split, or wrong noise.
    """

    def __init__(
        self,
        scenario: str | os.PathLike[str] | Scenario,
        control: str | None = None,
        *,
        solver: Solver = "compliant",
        split: Split | None = None,
        launch_noise: tuple[float, float] | None = None,
    ) -> None:
        self.scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
        section = self.scenario.control
        if control is None:
            control = section.chosen
        if launch_noise is None:
            launch_noise = math.radians(section.noise_orientation_deg), section.noise_spin_rad_s
        bounds = {name: np.array(pair) for name, pair in self.scenario.control_bounds.items()}
        bounds |= {name: np.radians(pair) for name, pair in bounds.items() if CONTROLS[name].unit == "deg"}
        words = control_words(bounds)
        for name, value, allowed in (("control", control, tuple(words)), ("solver", solver, get_args(Solver))):
            if value not in allowed:
                raise ValueError(f"{name} = {value!r}: must be one of {', '.join(map(repr, allowed))}")
        if split is not None:
            check_split(split)
        if not isinstance(launch_noise, Sequence | np.ndarray) or len(launch_noise) != 2:
            raise ValueError(f"launch_noise = {launch_noise!r}: must be two numbers, of {' and '.join(NOISY)}")
        named = zip(NOISY, launch_noise, strict=True)
        self.noise = np.array([checked("launch_noise", name, sigma, NOT_NEGATIVE) for name, sigma in named])
        self.bounds = bounds
        self.controlled = words[control]
        self.control = next(word for word, names in words.items() if names == self.controlled)
        self.solver = solver
        self.split = split
        self.draws = FIELDS + 2 * bool(self.noise.any())
        self.body = self.scenario.body()
        self._followed: dict[str, Any] = {  # how descents are, by all that simulate them
            "solver": solver,
            "max_time": self.scenario.limits.max_time_s,
            "max_rebounds": self.scenario.limits.max_rebounds,
            "end_on_chord": self.scenario.ends.on_chord,
        }
        self._context_low, self._context_high = self.scenario.ranges
        self._chosen = [Context._fields.index(name) for name in self.controlled]
        self._width = self._context_high - self._context_low
        self._width[self._chosen] = 0.0  # as if it did not vary
        self.varies: NDArray[np.bool_] = self._width > 0.0
        self._action_low, self._action_high = np.array([bounds[name] for name in self.controlled]).T.copy()
        self._speed, self._spin = self._scales(bounds)
        self.observation_space = spaces.Box(-1.0, 1.0, (FIELDS,), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (len(self.controlled),), np.float32)
        self.ride_observation_space = spaces.Box(-1.0, 1.0, (FIELDS + len(FLIGHT),), np.float32)
        self.ride_action_space = spaces.Box(-1.0, 1.0, (len(self.controlled) + 1,), np.float32)
        self.observation_names, self.ride_observation_names = Context._fields, (*Context._fields, *FLIGHT)
        self.action_names, self.ride_action_names = self.controlled, (*self.controlled, "trim")

    def given(self, options: Mapping[str, Any] | None, lanes: int = 1, also: tuple[str, ...] = ()) -> Given:
        """Read the options of a reset.

        Parameters
        ----------
        options : mapping, optional
            ``context``: fields of the contexts, the others being drawn: a mapping of names to values, each a number or
            an array of shape (lanes,), or a whole context or one a lane, shape (8,) or (lanes, 8); or a list of one a
            lane, each a mapping, a whole context or None.
            ``split``: in place of that of the task, for the episodes that this reset begins; or a list of one a lane.
        lanes : int
        also : tuple of str
            Options that the caller has taken out, for the message.

        Raises
        ------
        TypeError, ValueError
            For an unknown option or field, or a wrong shape, or naming the field, its value and the allowed range.
        """
        if not isinstance(options, Mapping | None):
            raise TypeError(f"options = {options!r}: must be a mapping such as {{'split': 'test'}}")
        given = dict(options or {})
        context, split = given.pop("context", None), given.pop("split", self.split)
        if given:
            known = ", ".join(map(repr, ("context", "split", *also)))
            raise ValueError(f"unknown option {next(iter(given))!r}: must be one of {known}")
        splits = tuple(split) if isinstance(split, list | tuple) else (split,)
        if len(splits) not in (1, lanes):
            raise ValueError(f"split has {len(splits)} entries: must be one, or one a lane, {lanes}")
        for one in splits:
            if one is not None:
                check_split(one)
        fixed = _fixed(context, lanes)
        return Given(fixed, splits if len(set(splits)) > 1 else splits[0])

    def begin(self, given: Given, draw: Callable[[NDArray[np.intp]], NDArray[np.float64]]) -> Contexts:
        """Return the contexts of new episodes.

        Parameters
        ----------
        given : Given
            Of n episodes.
        draw : callable
            Returns the doubles in [0, 1) of episodes whose numbers it is given, shape (len(numbers), draws). It is not
            asked for an episode of which nothing is left to be drawn: its random stream stays where it is.
        """
        contexts = given.fixed.copy()
        left = np.isnan(contexts)
        drawn = np.flatnonzero(left.any(axis=1) | (self.draws > FIELDS))
        if not drawn.size:
            return contexts
        draws = draw(drawn)
        contexts[drawn] = np.where(left[drawn], self._drawn(draws[:, :FIELDS], given.of(drawn).split), contexts[drawn])
        if self.draws == FIELDS:
            return contexts
        # Box and Muller: two draws make two normal deviates, so that every episode takes the same number of doubles.
        length = np.sqrt([-2.0 * math.log1p(-draw) for draw in draws[:, FIELDS].tolist()])
        cosine, sine = directions(2.0 * np.pi * draws[:, FIELDS + 1])
        return np.column_stack([contexts, self.noise[0] * length * cosine, self.noise[1] * length * sine])

    def _drawn(self, draws: NDArray[np.float64], split: Split | tuple[Split | None, ...] | None) -> Contexts:
        """Return the contexts that doubles mean, all of one split or each of its own."""
        if not isinstance(split, tuple):
            return self.scenario.contexts(draws, split)
        contexts = np.empty((len(draws), FIELDS))
        for one in set(split):
            own = np.array([other == one for other in split])
            contexts[own] = self.scenario.contexts(draws[own], one)
        return contexts

    @staticmethod
    def context(contexts: Contexts) -> Context:
        """Return the first of contexts."""
        return Context(*contexts[0, :FIELDS].tolist())

    def observe(self, contexts: Contexts) -> NDArray[np.float32]:
        """Scale contexts to [-1, 1] by the ranges of the scenario, float32 of shape (n, 8).

        What does not vary and what the agent controls reads 0.
        """
        centred = 2.0 * (contexts[:, :FIELDS] - self._context_low) / np.where(self.varies, self._width, 1.0) - 1.0
        return np.where(self.varies, np.clip(centred, -1.0, 1.0), 0.0).astype(np.float32)

    def contexts_seen(self, observations: NDArray[np.float32]) -> Contexts:
        """Return the contexts behind observations of shape (n, 8) or (n, 17), up to the rounding of float32.

        What the agent controls is NaN: it is nobody's choice yet.
        """
        scaled = 0.5 * (observations[:, :FIELDS].astype(np.float64) + 1.0)
        contexts = np.clip(self._context_low + scaled * self._width, self._context_low, self._context_high)
        contexts[:, self._chosen] = np.nan
        return contexts

    def observe_flights(self, flights: np.ndarray) -> NDArray[np.float32]:
        """Scale where descents stand to [-1, 1], float32 of shape (n, 9), columns ``FLIGHT``.

        Parameters
        ----------
        flights : ndarray of OUTCOME, shape (n,)
        """
        scenario = self.scenario
        cosine, sine = directions(np.ascontiguousarray(flights["phi"]))
        columns = (
            flights["x"] / scenario.slope_section.length_m,
            sine,
            cosine,
            flights["u"] / self._speed,
            flights["v"] / self._speed,
            flights["omega"] / self._spin,
            flights["trim"] / (scenario.rider.trim_rad_s if scenario.rider else 1.0),
            flights["t"] / scenario.limits.max_time_s,
            flights["rebounds"] / scenario.limits.max_rebounds,
        )
        scaled = np.empty((len(flights), len(FLIGHT)), np.float32)
        for i, column in enumerate(columns):
            scaled[:, i] = np.clip(column, -1.0, 1.0)
        scaled[np.isnan(scaled)] = 0.0  # a descent that overflowed has ended, but must still be seen
        return scaled

    def flights_seen(self, observations: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where descents stand at a rebound, from observations of shape (n, 17), up to the rounding of float32.

        Returns
        -------
        states : ndarray, shape (n, 6)
            Columns as in :class:`sledenv.State`; at a rebound the body touches, so its height follows from its
            orientation.
        lent : ndarray, shape (n,)
            Spin [rad/s] that the rider's rotor lends to the body.
        """
        progress, sine, cosine, u, v, omega, trim, _, _ = observations[:, FIELDS:].astype(np.float64).T
        phi = np.arctan2(sine, cosine)
        columns = (
            progress * self.scenario.slope_section.length_m,
            support_heights(self.body, phi),
            phi,
            u * self._speed,
            v * self._speed,
            omega * self._spin,
        )
        return np.stack(columns, axis=-1), self.trims(trim)

    def _scales(self, bounds: dict[str, NDArray[np.float64]]) -> tuple[float, float]:
        """Speed [m/s] and spin [rad/s] of a body that has all energy that the scenario can supply to a launch."""
        most = np.maximum(np.abs(self._context_low), np.abs(self._context_high))
        for name, pair in bounds.items():
            i = Context._fields.index(name)
            most[i] = max(most[i], *np.abs(pair))
        _, _, _, speed, drop, fall, _, spin = most.tolist()
        angle, slope = self._context_high[0], self.scenario.slope_section
        height = drop + self.body.radius + self.body.eccentricity + slope.length_m * max(0.0, np.sin(angle))
        gyration = self.body.inertia / self.body.mass  # [m^2]
        square = speed**2 + fall**2 + gyration * spin**2 + 2.0 * slope.gravity_m_s2 * height
        fastest = float(np.sqrt(square)) or 1.0
        return fastest, fastest / float(np.sqrt(gyration))

    def chosen(self, contexts: Contexts, actions: NDArray[np.float64]) -> Contexts:
        """Return contexts, shape (n, 8), with what actions of shape (n, k) choose in its place, without noise."""
        chosen = contexts[:, :FIELDS].copy()
        chosen[:, self._chosen] = self._action_low + 0.5 * (actions + 1.0) * (self._action_high - self._action_low)
        return chosen

    def launches(self, contexts: Contexts, actions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the states at launch that actions ask for, shape (n, 6), columns as in :class:`sledenv.State`.

        Parameters
        ----------
        contexts : ndarray, shape (n, 8) or (n, 10)
        actions : ndarray, shape (n, k)
            Out of :func:`checked_actions`, scaled to the control bounds of the scenario: a column for each of
            ``controlled``.
        """
        chosen = self.chosen(contexts, actions)
        if contexts.shape[1] > FIELDS:
            chosen[:, _DISTURBED] += contexts[:, FIELDS:]
        return self.scenario.launches(chosen)

    def descend(self, contexts: Contexts, launches: NDArray[np.float64], record: Record = "rebounds") -> Descent:
        """Simulate the one descent of contexts and launches with one row."""
        return simulate(
            *self._scene(contexts, launches),
            **self._followed,
            record=record,
        )

    def ride(self, contexts: Contexts, launches: NDArray[np.float64], record: Record = "rebounds") -> Ride:
        """Return the descent that :meth:`descend` simulates at its launch, to be followed hop by hop."""
        rider = self.scenario.rider
        return Ride(
            *self._scene(contexts, launches),
            **self._followed,
            record=record,
            rotor_inertia=None if rider is None else rider.rotor_inertia_kg_m2,
        )

    def _scene(self, contexts: Contexts, launches: NDArray[np.float64]) -> tuple[Body, ContactLaw, Slope, State]:
        """Return what the first row of contexts and launches is a descent of."""
        (law,), (slope,) = self.scenario.laws(contexts[:1]).tolist(), self.scenario.slopes(contexts[:1]).tolist()
        return self.body, ContactLaw._make(law), Slope._make(slope), State._make(launches[0].tolist())

    def descend_batch(
        self, contexts: Contexts, launches: NDArray[np.float64], *, keep_rebounds: bool = False
    ) -> DescentBatch:
        """Simulate one descent a row, on all cores; row i equals :meth:`descend` of row i bit for bit."""
        return simulate_batch(
            self.body,
            self.scenario.laws(contexts),
            self.scenario.slopes(contexts),
            launches,
            **self._followed,
            keep_rebounds=keep_rebounds,
        )

    def rides(self, contexts: Contexts, launches: NDArray[np.float64], *, keep_rebounds: bool = False) -> RideBatch:
        """Return the descents of :meth:`descend_batch` at their launch; lane i equals :meth:`ride` of row i."""
        rider = self.scenario.rider
        return RideBatch(
            self.body,
            self.scenario.laws(contexts),
            self.scenario.slopes(contexts),
            launches,
            **self._followed,
            keep_rebounds=keep_rebounds,
            rotor_inertia=None if rider is None else rider.rotor_inertia_kg_m2,
        )

    def trims(self, actions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the spins [rad/s] that trims in [-1, 1] ask for, same shape; 0 without a rider."""
        rider = self.scenario.rider
        return actions * (0.0 if rider is None else rider.trim_rad_s)

    @staticmethod
    def verdict(batch: DescentBatch) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
        """Return rewards, terminated and truncated of hops: the reward of the descent where it has ended, 0 elsewhere.

        A descent that met a limit of its scenario is truncated.
        """
        status = batch.outcomes["status"]
        ended = status != RUNNING
        truncated = _TRUNCATED[status]
        return np.where(ended, batch.jam.reward, 0.0), ended & ~truncated, truncated

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
            Arrays of shape (n,), in dicts. The status is a code, an index of ``sledenv.STATUS_OF_CODE``. Columns of
            rebounds are arrays of lists, because logs differ in length.
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
                    info[key] = jam._asdict() | {"jam_index": jam.jam_index}
                    del info[key]["reward"]  # which the step returns
                case "is_success":
                    info[key] = outcomes["status"] == FINISH
                case "descent":
                    energy = {name: outcomes[name].copy() for name in LEDGER_FIELDS}
                    info[key] = {
                        "status": outcomes["status"].astype(np.int64),
                        "time": outcomes["t"].copy(),
                        "energy": energy,
                    }
        return info

    @staticmethod
    def context_info(contexts: Contexts) -> dict[str, Any]:
        """Return the fields of contexts, arrays of shape (n,)."""
        return dict(zip(Context._fields, contexts[:, :FIELDS].T.copy(), strict=True))


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

    Returns
    -------
    ndarray
        What lies outside the box by rounding, at most 1e-6, is on its bound.

    Raises
    ------
    gymnasium.error.InvalidAction
        If they have another shape, or naming the first that is not a number or lies outside the box.
    """
    shape = (lanes, *space.shape)
    try:
        given = np.asarray(actions)
    except (TypeError, ValueError) as error:  # rows of different lengths
        raise InvalidAction(f"actions = {actions!r}: must be numbers of shape {shape}") from error
    if given.dtype.kind not in "iuf":
        raise InvalidAction(f"actions = {actions!r}: must be numbers of shape {shape}")
    given = given.astype(np.float64)
    if given.shape[:1] != shape[:1]:
        raise InvalidAction(f"actions have shape {given.shape}: must be {shape}")
    if given.shape != shape:
        raise InvalidAction(f"action has shape {given.shape[1:]}: must be {shape[1:]}")
    within = (given >= space.low - _SLACK) & (given <= space.high + _SLACK)  # NaN is not
    inside = np.ones(lanes, np.bool_)
    inside[acting] = within[acting].all(axis=1)
    if not inside.all():
        lane = int(np.argmin(inside))
        name = "action" if lanes == 1 else f"actions[{lane}]"
        raise InvalidAction(f"{name} = {given[lane].tolist()}: must be within [{space.low.min()}, {space.high.max()}]")
    clipped: NDArray[np.float64] = np.clip(given, space.low, space.high)
    return clipped


def checked_info(info: Sequence[str]) -> tuple[str, ...]:
    """Return which entries of info are to be given, or raise ValueError."""
    listed = not isinstance(info, str) and isinstance(info, Iterable)
    if not listed or not set(info) <= set(INFO_KEYS):
        raise ValueError(f"info = {info!r}: must be a sequence of any of {', '.join(map(repr, INFO_KEYS))}")
    return tuple(info)


def _fixed(context: Any, lanes: int) -> NDArray[np.float64]:
    """Fields of contexts that a user fixes, shape (lanes, 8), NaN where one is to be drawn: see :meth:`Task.given`."""
    if isinstance(context, list | tuple) and any(isinstance(one, Mapping | None) for one in context):
        if len(context) != lanes:
            raise ValueError(f"context has {len(context)} entries: must be one a lane, {lanes}")
        return np.concatenate([_fixed(one, 1) for one in context])
    fixed = np.full((lanes, FIELDS), np.nan)
    if isinstance(context, Mapping):
        for name, value in context.items():
            if name not in Context._fields:
                raise ValueError(f"unknown field {name!r} of context: must be one of {', '.join(Context._fields)}")
            i = Context._fields.index(name)
            column = _array(f"context.{name}", value)
            if column.shape not in ((), (lanes,)):
                raise ValueError(f"context.{name} has shape {column.shape}: must be () or ({lanes},)")
            for number in column.reshape(-1).tolist():
                checked("context", name, number, Context.rules[i])
            fixed[:, i] = column
    elif context is not None:
        shape = (lanes, FIELDS)
        rows = _array("context", context)
        if rows.shape not in (shape, shape[1:]):
            raise ValueError(f"context has shape {rows.shape}: must be {shape[1:]} or {shape}")
        owner = "context" if rows.ndim == 1 else "context[{lane}]"
        checked_rows(owner, Context, np.atleast_2d(rows))
        fixed[:] = rows
    return fixed


def _array(name: str, value: Any) -> NDArray[np.float64]:
    """Return numbers as an array of floats, or raise TypeError."""
    try:
        array = np.asarray(value)
    except ValueError:  # rows of different lengths
        array = np.asarray(None)
    if array.dtype.kind not in "biuf":
        raise TypeError(f"{name} = {value!r}: must be a number, or an array of numbers")
    return np.asarray(array, np.float64)


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
