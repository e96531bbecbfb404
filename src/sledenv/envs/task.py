"""Tasks, which every environment shares: scenes, their observation, launch of an action, spins that riders lend.

Scenes, observations, actions and flights have one row per lane; the scalar environments have one lane.
"""

from __future__ import annotations

import inspect
import math
import os
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final, Literal, TypedDict, get_args

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sledenv.envs.columns import GROUPS, Columns
from sledenv.envs.inputs import FIELDS, SEEN, Contexts, Given
from sledenv.scenarios.scenario import NOISY, Context, Scenario, ScenarioError, Split, check_split, load_scenario
from sledenv.scenarios.sections import CONTROLS, control_words
from sledenv.scenarios.tracks import normal_pairs
from sledenv.simulation.bodies import Body, Segment
from sledenv.simulation.checks import limits_of
from sledenv.simulation.grounds import Grounds
from sledenv.simulation.lanes import NO_LOGS, new_logs
from sledenv.simulation.outcomes import Descent, DescentBatch, Record
from sledenv.simulation.outlook import AHEAD
from sledenv.simulation.records import Status
from sledenv.simulation.ride import Ride
from sledenv.simulation.rules import (
    NOT_NEGATIVE,
    checked,
    checked_choice,
    checked_names,
    checked_rows,
    has_no_length,
)
from sledenv.simulation.scenes import Scenes
from sledenv.simulation.settings import Solver
from sledenv.simulation.simulate import simulate
from sledenv.simulation.simulator import Simulator, at_launch
from sledenv.simulation.support import support_heights

TRIM: Final = "trim"  # the control of a ride

_SHAPE = Context._fields.index("shape")
_RARE = 4.0  # standard deviations by which what a rider lends is seen to miss what was asked for


class TaskOptions(TypedDict, total=False):
    """Keywords of :class:`Task` that environments hand on."""

    solver: Solver
    split: Split | None
    launch_noise: tuple[float, float] | None
    observe: Literal["all"] | Sequence[str]
    columns: Sequence[str]


def check_options(environment: type, given: Iterable[str]) -> None:
    """Raise TypeError, with all arguments of an environment, if it is given one that it hands on and no task has."""
    known = TaskOptions.__annotations__
    wrong = [name for name in given if name not in known]
    if wrong:
        own = [
            one.name for one in inspect.signature(environment).parameters.values() if one.kind is not one.VAR_KEYWORD
        ]
        # The words are Python's own: others look for them, TorchRL to find out who repeats actions.
        unexpected = f"{environment.__name__}.__init__() got an unexpected keyword argument {wrong[0]!r}"
        raise TypeError(f"{unexpected}; it has {', '.join([*own, *known])}")


class Task:
    """The contexts of a scenario as an agent sees them, what it does there, and the descents that follow.

    Environments and problems have one; nobody else needs it.

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    control : str, optional
        What of the launch the agent chooses, a word of :func:`sledenv.scenarios.sections.control_words`; the rest is
        part of the context. What the scenario says by default. Of a ride it is "trim".
    ride : bool
        Whether the agent does not choose the launch, which is drawn with the context (:meth:`Scenario.ride`), but trims
        every flight worth a decision.
    solver : {"compliant", "rigid"}
        As for :func:`sledenv.simulate`.
    split : {"train", "validation", "test"}, optional
        Which contexts are drawn, see :meth:`sledenv.scenarios.Scenario.contexts`; all by default.
    launch_noise : pair of float, optional
        Standard deviations of normal errors of the orientation [rad] and of the spin [rad/s] at launch, >= 0; those of
        the scenario by default.
    observe : "all" or sequence of str
        Fields of :class:`sledenv.scenarios.Context` that an agent sees; the others vary as before, but read 0.
    columns : sequence of str
        Groups of columns that an observation has: of "context", "state", "ground" and "landing", told in this order;
        all by default. A launch has no state and no landing.

    Attributes
    ----------
    controlled : tuple of str
        What the agent chooses, in the order of its actions: of ``CONTROLS`` in :mod:`sledenv.scenarios.sections`.
    control : str
        The first word for it, so that tasks with the same choice have the same.
    bounds : dict of ndarray, shape (2,)
        Lowest and highest value of all that an agent may choose here, in the units of a context.
    bodies : tuple of Body
        Those of the scenario; ``shape`` of a context is the place of its body among them.
    settings : Settings
        How descents are simulated, those of the scenario with the solver of the task.
    draws : int
        Doubles that the context and the launch noise of one episode take from a random stream.
    columns : Columns
        Of an observation.
    observation_space, action_space : Box
        Behind the context a ride tells the flight, and whatever has a profile the vertices around.
    observation_names, action_names : tuple of str
        What their entries are.
    varies : ndarray of bool, shape (11,)
        Which of the fields that agents may see vary, are not chosen, and are among those that ``observe`` names.
    hidden : ndarray of bool, shape (12,)
        Which fields vary and are not chosen, but are not seen. The track is none of them: its ground is seen.
    observed : tuple of str
        The fields that ``observe`` names.

    Raises
    ------
    ScenarioError, TypeError, ValueError
        For an unknown scenario, control, solver, split or field to observe, or wrong noise.
    """

    def __init__(
        self,
        scenario: str | os.PathLike[str] | Scenario,
        control: str | None = None,
        *,
        ride: bool = False,
        solver: Solver = "compliant",
        split: Split | None = None,
        launch_noise: tuple[float, float] | None = None,
        observe: Literal["all"] | Sequence[str] = "all",
        columns: Sequence[str] = GROUPS,
    ) -> None:
        scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
        self.scenario = scenario.ride() if ride else scenario
        section = self.scenario.control
        if control is None:
            control = TRIM if ride else section.chosen
        if launch_noise is None:
            launch_noise = math.radians(section.noise_orientation_deg), section.noise_spin_rad_s
        bounds = {name: np.array(pair) for name, pair in self.scenario.control_bounds.items()}
        bounds |= {name: np.radians(pair) for name, pair in bounds.items() if CONTROLS[name].unit == "deg"}
        words = {TRIM: ()} if ride else control_words(bounds)
        for name, value, allowed in (("control", control, tuple(words)), ("solver", solver, get_args(Solver))):
            checked_choice(name, value, allowed)
        if split is not None:
            check_split(split)
        if not isinstance(launch_noise, Sequence | np.ndarray) or has_no_length(launch_noise) or len(launch_noise) != 2:
            raise ValueError(f"launch_noise = {launch_noise!r}: must be two numbers, of {' and '.join(NOISY)}")
        named = zip(NOISY, launch_noise, strict=True)
        self.noise = np.array([checked("launch_noise", name, sigma, NOT_NEGATIVE) for name, sigma in named])
        self.bounds = bounds
        self.controlled = words[control]
        self.control = next(word for word, names in words.items() if names == self.controlled)
        self.solver = solver
        self.split = split
        self.draws = self.scenario.draws + len(NOISY) * bool(self.noise.any())
        self.bodies = self.scenario.all_bodies()
        self.settings = self.scenario.settings(solver)
        self._context_low, self._context_high = self.scenario.ranges
        self._chosen = [Context._fields.index(name) for name in self.controlled]
        width = self._context_high - self._context_low
        width[self._chosen] = 0.0  # as if it did not vary
        self.observed = _observed(observe)
        shown = np.isin(Context._fields, self.observed)
        self.varies: NDArray[np.bool_] = ((width > 0.0) & shown)[:SEEN]
        self.hidden: NDArray[np.bool_] = (width > 0.0) & ~shown & (np.arange(FIELDS) < SEEN)
        self._action_low, self._action_high = np.array([bounds[name] for name in self.controlled]).reshape(-1, 2).T
        rider = self.scenario.rider
        lent = 1.0 if rider is None else rider.trim_rad_s + _RARE * rider.noise_rad_s
        self._shortest = 0.0 if rider is None else rider.shortest_flight_s
        self._limits = limits_of(self.bodies, self.settings)._replace(shortest_flight=self._shortest)
        speed, groups = self._fastest(bounds), _grouped(columns, ride)
        self.columns = Columns(groups, self.scenario, ride=ride, speed=speed, lent=lent, varies=self.varies)
        self.groups, self.observation_names = self.columns.groups, self.columns.names
        if not self.observation_names:
            raise ValueError(f"columns = {columns!r}: must have another group in scenario {self.scenario.id}, a plane")
        self.action_names = (TRIM,) if ride else self.controlled
        bound = self.columns.bound.astype(np.float32)
        self.observation_space = spaces.Box(-bound, bound)
        self.action_space = spaces.Box(-1.0, 1.0, (len(self.action_names),), np.float32)

    @property
    def identity(self) -> dict[str, Any]:
        """All that two tasks have in common if each can go on where the other stands."""
        return {
            "scenario": (self.scenario.id, self.scenario.hash),
            "control": self.control,
            "solver": self.solver,
            "launch_noise": tuple(self.noise.tolist()),
            "observe": self.observed,
            "columns": self.groups,
        }

    def begin(self, given: Given, draw: Callable[[NDArray[np.intp]], NDArray[np.float64]]) -> Scenes:
        """Return the scenes of new episodes.

        Parameters
        ----------
        given : Given
            Of n episodes.
        draw : callable
            Returns the doubles in [0, 1) of episodes whose numbers it is given, shape (len(numbers), draws). It is not
            asked for an episode of which nothing is left to be drawn: its random stream stays where it is.
        """
        contexts, errors, own = given.fixed.copy(), np.zeros((len(given.fixed), len(NOISY))), self.scenario.draws
        left = np.isnan(contexts)
        noisy = self.draws > own
        drawn = np.flatnonzero(left.any(axis=1) | noisy)
        if drawn.size:
            draws = draw(drawn)
            contexts[drawn] = np.where(left[drawn], self._drawn(draws[:, :own], given.of(drawn).split), contexts[drawn])
            if noisy:
                errors[drawn] = self.noise * np.stack(normal_pairs(draws[:, own], draws[:, own + 1]), axis=-1)
        return self.scenario.scenes(contexts, errors)

    def _drawn(self, draws: NDArray[np.float64], split: Split | tuple[Split | None, ...] | None) -> Contexts:
        """Return the contexts that doubles mean, all of one split or each of its own."""
        if not isinstance(split, tuple):
            return self.scenario.contexts(draws, split)
        contexts = np.empty((len(draws), FIELDS))
        for one in set(split):
            own = np.array([other == one for other in split])
            contexts[own] = self.scenario.contexts(draws[own], one)
        return contexts

    def check(self, given: Given) -> None:
        """Raise ValueError if episodes are to begin with what the scenario cannot have: :meth:`Scenario.check`."""
        if not np.isnan(given.fixed).all():
            self.scenario.check(given.fixed)

    def scenes(self, contexts: Contexts) -> Scenes:
        """Return the scenes of contexts of shape (n, 12), or (n, 14) with errors of the launch.

        What is chosen may be NaN: it is nobody's choice yet.

        Raises
        ------
        ValueError
            Naming the context, its field, the value and the allowed range.
        """
        given = contexts[:, :FIELDS].copy()
        given[:, self._chosen] = np.nan_to_num(given[:, self._chosen])
        checked_rows("contexts[{lane}]", Context, given)
        self.scenario.check(given)
        errors = contexts[:, FIELDS:] if contexts.shape[1] > FIELDS else None
        return self.scenario.scenes(contexts[:, :FIELDS], errors)

    def support_heights(self, contexts: Contexts, phi: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the support height [m] of the body of each context at an orientation [rad], shapes (n,)."""
        return support_heights(self.scenario.outlines, phi, contexts[:, _SHAPE])

    @staticmethod
    def context(scenes: Scenes) -> Context:
        """Return the context of the first lane."""
        return Context(*scenes.drawn[0, :FIELDS].tolist())

    def body(self, scenes: Scenes) -> Body:
        """Return the body of the first lane."""
        return self.bodies[int(scenes.rows["body"][0])]

    def observe(
        self, scenes: Scenes, flights: np.ndarray | None = None, *, bounded: bool = True
    ) -> NDArray[np.float32]:
        """Return what agents see, float32 within the bounds of the space, shape (n, len(observation_names)).

        Contexts are scaled by the ranges of the scenario. What does not vary, what is not observed and what the agent
        controls reads 0; the track is left out, but the vertices around are told where there is a profile.

        Parameters
        ----------
        scenes : Scenes
            Of n lanes.
        flights : ndarray of OUTCOME, shape (n,)
            Where descents stand; at their launches by default.
        bounded : bool
            Whether what lies outside the bounds is put onto them; of a scenario other than this one
            (:meth:`Scenario.shifted`) it may lie outside.
        """
        seen = self.columns.fill(scenes, at_launch(scenes) if flights is None else flights)
        seen[np.isnan(seen)] = 0.0  # a descent that overflowed has ended, but must still be seen
        bound = self.columns.bound
        return np.asarray(np.minimum(np.maximum(seen, -bound), bound) if bounded else seen, np.float32)

    def masked(self, scenes: Scenes, flights: np.ndarray | None = None) -> Scenes:
        """Return scenes as far as they are seen where flights begin, at their launches by default.

        Hidden fields are in the middle of their ranges, the errors of launch and rider are none, the track has the
        number 0, and the ground behind the last vertex that is told counts as level. The launch of a flight is past: it
        stays, as the ledger counts from there.
        """
        drawn = scenes.drawn.copy()
        drawn[:, :FIELDS][:, self.hidden] = 0.5 * (self._context_low + self._context_high)[self.hidden]
        drawn[:, _SHAPE] = np.floor(drawn[:, _SHAPE])
        drawn[:, FIELDS - 1 :] = 0.0
        known = self.scenes(drawn)
        x = np.zeros(len(drawn)) if flights is None else flights["x"]
        ground = Grounds.of([_told(*each) for each in zip(scenes.grounds(), x.tolist(), strict=True)])
        known.rows["ground"], known.rows["ground_end"] = ground.places.T
        if flights is not None:
            known.launches[:] = scenes.launches
        return known._replace(pieces=ground.pieces)

    def contexts_seen(self, observations: NDArray[np.float32]) -> Contexts:
        """Return the contexts behind observations, up to the rounding of float32.

        What the agent controls is NaN: it is nobody's choice yet. What is hidden is in the middle of its range, and the
        track number 0.

        Raises
        ------
        ValueError
            If observations have no context.
        """
        if "context" not in self.groups:
            raise ValueError(f"columns = {self.groups!r}: must have 'context' where that is read from observations")
        contexts = np.tile(0.5 * (self._context_low + self._context_high), (len(observations), 1))
        contexts[:, FIELDS - 1] = self._context_low[-1]
        told = (observations[:, :SEEN] * self.columns.scale[:SEEN] + self.columns.middle[:SEEN])[:, self.varies]
        contexts[:, :SEEN][:, self.varies] = told
        low, high = self._context_low[_SHAPE], self._context_high[_SHAPE]
        contexts[:, _SHAPE] = np.rint(np.clip(contexts[:, _SHAPE], low, high))
        contexts[:, self._chosen] = np.nan
        return contexts

    def _fastest(self, bounds: dict[str, NDArray[np.float64]]) -> float:
        """Speed [m/s] of a body that has all energy which the scenario can supply to a launch, the largest of all."""
        most = np.maximum(np.abs(self._context_low), np.abs(self._context_high))
        for name, pair in bounds.items():
            i = Context._fields.index(name)
            most[i] = max(most[i], *np.abs(pair))
        _, _, _, speed, drop, fall, _, spin, *_ = most.tolist()
        section = self.scenario.slope_section
        below = (section.length_m + self.settings.run_out) * max(0.0, np.sin(self._context_high[0]))
        below += self.scenario.extent[1]
        speeds = []
        for body in self.bodies:
            height = drop + highest_support(body) + below
            square = speed * speed + fall * fall + body.inertia / body.mass * spin * spin
            square += 2.0 * section.gravity_m_s2 * height
            if not 0.0 <= square < math.inf:
                at_most = f"speed {speed:g} m/s, fall {fall:g} m/s, spin {spin:g} rad/s, drop {drop:g} m"
                raise ScenarioError(f"scenario {self.scenario.id}: its launches have no finite energy: {at_most}")
            speeds.append(math.sqrt(square) or 1.0)
        return max(speeds)

    def chosen(self, contexts: Contexts, actions: NDArray[np.float64]) -> Contexts:
        """Return contexts, shape (n, 12) or (n, 14), with what actions of shape (n, k) choose in its place."""
        chosen = contexts.copy()
        chosen[:, self._chosen] = self._action_low + 0.5 * (actions + 1.0) * (self._action_high - self._action_low)
        return chosen

    def aimed(self, scenes: Scenes, actions: NDArray[np.float64]) -> Scenes:
        """Return scenes with the launches that actions ask for, their errors included.

        Parameters
        ----------
        scenes : Scenes
            Of n lanes.
        actions : ndarray, shape (n, k)
            Out of :func:`sledenv.envs.inputs.checked_actions`, scaled to the control bounds of the scenario: a column
            for each of ``controlled``.
        """
        aimed = scenes._replace(rows=scenes.own_rows())
        self.scenario.let_go(aimed, self.chosen(scenes.drawn, actions))
        return aimed

    def descend(self, scenes: Scenes, *, keep_rebounds: bool = False) -> DescentBatch:
        """Simulate the descents of scenes to their ends, on all cores."""
        simulator = self.simulator(scenes, keep_rebounds=keep_rebounds)
        simulator.run()
        return simulator.descents()

    def rides(self, scenes: Scenes) -> Simulator:
        """Return the descents of scenes, each at its first flight worth a decision."""
        simulator = self.simulator(scenes)
        simulator.wait()
        return simulator

    def simulator(self, scenes: Scenes, *, keep_rebounds: bool = False) -> Simulator:
        """Return the descents of scenes at their launches."""
        logs = new_logs(len(scenes.rows), self.settings.max_rebounds) if keep_rebounds else NO_LOGS
        return Simulator(scenes, self.solver == "rigid", self._limits, logs)

    def descent(self, scenes: Scenes, record: Record = "rebounds") -> Descent:
        """Simulate the descent of the first lane."""
        return simulate(*self.scenario.given_in(scenes), self.settings, record=record)

    def ride(self, scenes: Scenes, record: Record = "rebounds") -> Ride:
        """Return the descent of the first lane at its launch, to be followed flight by flight."""
        rotor = None if self.scenario.rider is None else self.scenario.rider.rotor_inertia_kg_m2
        given = *self.scenario.given_in(scenes), self.settings
        return Ride(*given, record=record, rotor_inertia=rotor, shortest_flight=self._shortest)

    def ridden(self, scenes: Scenes, trims: Sequence[float], record: Record = "rebounds") -> Descent:
        """Return the ride of trims in [-1, 1], of one flight after the other, in the first lane.

        Flights behind the last of them are ridden with what it lends.
        """
        ride, alone = self.ride(scenes, record), scenes.take(slice(1))
        if ride.status == Status.RUNNING:
            ride.await_flight()
        for decision, trim in enumerate(trims):
            if ride.status != Status.RUNNING:
                break
            (spin,) = self.spins(alone, np.array([[trim]]), np.array([decision])).tolist()
            if ride.rotor_inertia is not None:
                ride.trim(spin)
            ride.hop()
        return ride.run()

    def spins(self, scenes: Scenes, actions: NDArray[np.float64], decisions: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the spins [rad/s] that riders lend in flights, their errors included; 0 without a rider.

        Parameters
        ----------
        scenes : Scenes
            Of n lanes.
        actions : ndarray, shape (n, 1)
            Trims in [-1, 1].
        decisions : ndarray of int, shape (n,)
            Which decision of the ride each is, counted from 0.
        """
        rider = self.scenario.rider
        if rider is None:
            return np.zeros(len(actions))
        asked: NDArray[np.float64] = rider.trim_rad_s * actions[:, 0]
        return asked + self.scenario.errors(scenes.rows["stream"], decisions) if rider.noise_rad_s else asked


def _told(vertices: np.ndarray, x: float) -> NDArray[np.float64]:
    """Return the vertices that are told at a place [m], of records with x, y and radius; shape (k, 3), the last sharp.

    A last one without a turn is none.
    """
    last = int(np.searchsorted(vertices["x"], x, side="right")) + AHEAD
    told = np.column_stack([vertices[name][:last] for name in ("x", "y", "radius")])
    if len(told) == last:
        told[-1, 2] = 0.0
    if 2 < len(told) < len(vertices) and told[-1, 1] == told[-2, 1]:
        return told[:-1]
    return told


def _grouped(columns: Sequence[str], ride: bool) -> tuple[str, ...]:
    """Return the groups of columns that an observation has, in their order, or raise ValueError."""
    known = GROUPS if ride else (GROUPS[0], GROUPS[2])
    if not ride and isinstance(columns, tuple | list) and tuple(columns) == GROUPS:  # all that there are
        return known
    given = checked_names("columns", columns, known)
    if not given:
        raise ValueError(f"columns = {columns!r}: must be a sequence of any of {', '.join(map(repr, known))}")
    return tuple(name for name in known if name in given)


def _observed(observe: Literal["all"] | Sequence[str]) -> tuple[str, ...]:
    """Return the fields of a context that are named, in their order, or raise ValueError."""
    fields = Context.seen
    if isinstance(observe, str) and observe == "all":
        return fields
    given = checked_names("observe", observe, fields, "'all' or a sequence of any of")
    return tuple(name for name in fields if name in given)


def highest_support(body: Body) -> float:
    """Bound [m] of the height of the mass centre where a body touches, in whatever pose.

    Of a segment it is that of its whole disc: agents are told speeds by it, and those that are trained know them so.
    """
    return body.radius + body.eccentricity if isinstance(body, Segment) else body.size
