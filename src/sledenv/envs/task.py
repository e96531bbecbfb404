"""What every environment shares: contexts, their observation, launch of an action, the spins that riders lend.

Contexts, observations, actions and launches are arrays with one row a lane; the scalar environments have one lane.
"""

from __future__ import annotations

import inspect
import math
import os
from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter
from typing import Any, Final, Literal, NamedTuple, TypedDict, get_args

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from sledenv.envs.inputs import FIELDS, SEEN, Contexts, Given
from sledenv.scenarios.scenario import NOISY, Context, Scenario, ScenarioError, Split, check_split, load_scenario
from sledenv.scenarios.sections import CONTROLS, control_words
from sledenv.scenarios.tracks import normal_pairs
from sledenv.simulation.bodies import Body, Segment, records_of
from sledenv.simulation.jam import DescentJam
from sledenv.simulation.outcomes import Descent, DescentBatch, Record
from sledenv.simulation.outlook import AHEAD, BEHIND, LANDING, PLACES, VERTEX, Ground, ground_of, look_out
from sledenv.simulation.records import OUTCOME, REBOUND, Status
from sledenv.simulation.ride import Ride, RideBatch
from sledenv.simulation.rules import NOT_NEGATIVE, checked, checked_choice
from sledenv.simulation.scene import ContactLaw, Profile, Slope, State, Tracks
from sledenv.simulation.settings import Solver
from sledenv.simulation.simulate import simulate, simulate_batch
from sledenv.simulation.support import directions, resting_heights, support_heights

# What is told of a flight that begins, and of each vertex of the ground around.
FLIGHT: Final = (
    *("left", "height", "sine", "cosine", "u", "v", "omega"),
    *("trim", "supplied", "time", "rebounds"),
)
# Groups of columns of an observation, and those that an environment tells unless it is asked for others.
GROUPS: Final = ("context", "state", "ground", "landing")
USUAL: Final = GROUPS[:3]
# By which landings are scaled, s, m, rad, m/s, m/s, rad and rad/s: so that entries vary by 0.1 to 0.7 (their standard
# deviation over rides of the shipped scenarios with random trims). Then angles [rad] of the ground there, and its
# heights by these parts of the height of the bumps, the further away the more.
_LANDING: Final = (1.28, 10.0, 0.35, 6.0, 12.0, 3.0, 10.0)
_RISE: Final = 0.4
_HEIGHTS: Final = 0.2 + 0.2 * np.minimum(np.abs(PLACES), 4.0)
TRIM: Final = "trim"  # the control of a ride

_DISTURBED = [Context._fields.index(name) for name in NOISY]
_SHAPE = Context._fields.index("shape")
_RARE = 4.0  # standard deviations by which what a rider lends is seen to miss what was asked for


class Seen(NamedTuple):
    """Where rides stand, as far as it is seen."""

    states: NDArray[np.float64]  # (n, 6), columns as in State; y counts from the ground under the mass centre
    lent: NDArray[np.float64]  # [rad/s] spin that the rider's rotor lends to the body, (n,)
    supplied: NDArray[np.float64]  # [J] energy so far, (n,)
    profiles: list[Profile]  # ground of each, or of none on a plane


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
    """What an agent sees of the contexts of a scenario, what it does there, and the descents that follow.

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
        Which contexts are drawn, see :meth:`sledenv.Scenario.contexts`; all by default.
    launch_noise : pair of float, optional
        Standard deviations of normal errors of the orientation [rad] and of the spin [rad/s] at launch, >= 0; those of
        the scenario by default.
    observe : "all" or sequence of str
        Fields of :class:`sledenv.Context` that an agent sees; the others vary as before, but read 0.
    columns : sequence of str
        Groups of columns that an observation has: of "context", "state", "ground" and "landing", told in this order.
        A launch has no state and no landing.

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
    columns : int
        Of contexts with their launch noise.
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
        columns: Sequence[str] = USUAL,
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
        if not isinstance(launch_noise, Sequence | np.ndarray) or len(launch_noise) != 2:
            raise ValueError(f"launch_noise = {launch_noise!r}: must be two numbers, of {' and '.join(NOISY)}")
        named = zip(NOISY, launch_noise, strict=True)
        self.noise = np.array([checked("launch_noise", name, sigma, NOT_NEGATIVE) for name, sigma in named])
        self.bounds = bounds
        self.controlled = words[control]
        self.control = next(word for word, names in words.items() if names == self.controlled)
        self.solver = solver
        self.split = split
        errors = len(NOISY) * bool(self.noise.any())
        self.draws, self.columns = self.scenario.draws + errors, FIELDS + errors
        self.bodies = self.scenario.all_bodies()
        self.settings = self.scenario.settings(solver)
        self._context_low, self._context_high = self.scenario.ranges
        self._chosen = [Context._fields.index(name) for name in self.controlled]
        self._width = self._context_high - self._context_low
        self._width[self._chosen] = 0.0  # as if it did not vary
        self.observed = _observed(observe)
        shown = np.isin(Context._fields, self.observed)
        self.varies: NDArray[np.bool_] = ((self._width > 0.0) & shown)[:SEEN]
        self.hidden: NDArray[np.bool_] = (self._width > 0.0) & ~shown & (np.arange(FIELDS) < SEEN)
        self._divisor = np.where(self.varies, self._width[:SEEN], 1.0)
        self._action_low, self._action_high = np.array([bounds[name] for name in self.controlled]).reshape(-1, 2).T
        self._way = self.scenario.slope_section.length_m + self.settings.run_out  # [m]
        self._reach, self._relief = self.scenario.extent
        self._speed, self._spin = self._scales(bounds)
        self._height = self._context_high[Context._fields.index("drop")] + 2.0 * max(map(highest_support, self.bodies))
        self._height += self._relief
        rider = self.scenario.rider
        self._lent = 1.0 if rider is None else rider.trim_rad_s + _RARE * rider.noise_rad_s
        self._rotor = None if rider is None else rider.rotor_inertia_kg_m2
        self._shortest = 0.0 if rider is None else rider.shortest_flight_s
        self.groups = _grouped(columns, ride)
        # Of which of the vertices around an agent is told.
        self._told = slice(0 if ride else BEHIND, BEHIND + AHEAD if self._reach > 0.0 else 0)
        self._vertices = len(range(BEHIND + AHEAD)[self._told])
        places = [*(f"behind_{i}" for i in range(BEHIND, 0, -1)), *(f"ahead_{i}" for i in range(1, AHEAD + 1))]
        names = {
            "context": Context.seen,
            "state": FLIGHT if ride else (),
            "ground": tuple(f"{place}_{entry}" for place in places[self._told] for entry in VERTEX),
            "landing": (
                *(f"landing_{entry}" for entry in LANDING),
                *(f"landing_{entry}_{place:+g}" for entry in ("height", "rise") for place in PLACES),
            ),
        }
        self._landing = np.array([*_LANDING, *(_HEIGHTS * (self._relief or 1.0)), *[_RISE] * len(PLACES)])
        self._lying = np.array([support_heights(body, np.zeros(1))[0] for body in self.bodies])
        self.observation_names = tuple(name for group in self.groups for name in names[group])
        self.action_names = (TRIM,) if ride else self.controlled
        self.observation_space = spaces.Box(-1.0, 1.0, (len(self.observation_names),), np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (len(self.action_names),), np.float32)

    @property
    def identity(self) -> dict[str, Any]:
        """What two tasks have in common if each can go on where the other stands."""
        return {
            "scenario": (self.scenario.id, self.scenario.hash),
            "control": self.control,
            "solver": self.solver,
            "launch_noise": tuple(self.noise.tolist()),
            "observe": self.observed,
            "columns": self.groups,
        }

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
        own = self.scenario.draws
        drawn = np.flatnonzero(left.any(axis=1) | (self.draws > own))
        if not drawn.size:
            return contexts
        draws = draw(drawn)
        contexts[drawn] = np.where(left[drawn], self._drawn(draws[:, :own], given.of(drawn).split), contexts[drawn])
        if self.draws == own:
            return contexts
        errors = np.stack(normal_pairs(draws[:, own], draws[:, own + 1]), axis=-1)
        return np.hstack([contexts, self.noise * errors])

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
        self.scenario.check(given.fixed)

    @staticmethod
    def context(contexts: Contexts) -> Context:
        """Return the first of contexts."""
        return Context(*contexts[0, :FIELDS].tolist())

    def body(self, contexts: Contexts) -> Body:
        """Return the body of the first of contexts."""
        return self.bodies[int(self.scenario.shapes(contexts[:1])[0])]

    def bodies_of(self, contexts: Contexts) -> Body | list[Body]:
        """Return the body of all contexts if the scenario has but one, or one a context."""
        shapes = self.scenario.shapes(contexts).tolist()
        return self.bodies[0] if len(self.bodies) == 1 else [self.bodies[i] for i in shapes]

    def by_body(self, contexts: Contexts) -> list[tuple[Body, slice | NDArray[np.intp]]]:
        """Return bodies, each with the rows of the contexts that have it: what a body is takes kilobytes a row."""
        shapes = self.scenario.shapes(contexts)
        rows = [np.flatnonzero(shapes == i) for i in range(len(self.bodies))]
        found = [i for i, own in enumerate(rows) if own.size]
        if len(found) < 2:
            return [(self.bodies[found[0] if found else 0], slice(None))]
        return [(self.bodies[i], rows[i]) for i in found]

    def of_bodies(self, contexts: Contexts, quantity: Callable[[Body], float]) -> NDArray[np.float64]:
        """Return a quantity of the body of each context, shape (n,)."""
        return np.array([quantity(body) for body in self.bodies])[self.scenario.shapes(contexts)]

    def support_heights(self, contexts: Contexts, phi: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the support height [m] of the body of each context at an orientation [rad], shapes (n,)."""
        heights = np.empty(len(contexts))
        for body, rows in self.by_body(contexts):
            heights[rows] = support_heights(body, phi[rows])
        return heights

    def observe(
        self,
        contexts: Contexts,
        flights: np.ndarray | None = None,
        elsewhere: Scenario | None = None,
        ground: Ground | None = None,
    ) -> NDArray[np.float32]:
        """Return what agents see, float32 in [-1, 1], shape (n, len(observation_names)).

        Contexts are scaled by the ranges of the scenario. What does not vary, what is not observed and what the agent
        controls reads 0; the track is left out, but the vertices around are told where there is a profile.

        Parameters
        ----------
        contexts : ndarray, shape (n, 12) or (n, 14)
        flights : ndarray of OUTCOME, shape (n,)
            Where the descents of a ride stand.
        elsewhere : Scenario, optional
            To which contexts and flights belong, if not to this one, see :meth:`Scenario.shifted`: what is seen is
            scaled as here, and may lie outside [-1, 1].
        ground : pair of ndarray, optional
            As of :func:`sledenv.simulation.outlook.ground_of`; that of the contexts by default. Who has only seen
            contexts does not know their tracks.
        """
        scenario = elsewhere or self.scenario
        parts = {"context": self._centred(contexts)} if "context" in self.groups else {}
        if flights is None:
            flights = np.zeros(len(contexts), OUTCOME)
        if self._reach > 0.0 or self.groups != GROUPS[:1]:
            ahead = "landing" in self.groups
            seen = look_out(
                ground_of(scenario.vertices(contexts)) if ground is None else ground,
                flights,
                contexts[:, 0] if ahead else None,
                scenario.slope_section.gravity_m_s2,
                self._lying[self.scenario.shapes(contexts)] if ahead else None,
            )
            if "state" in self.groups:
                parts["state"] = self._scaled(contexts, flights, seen.under)
            if "ground" in self.groups and self._reach > 0.0:
                blocks = seen.around[:, self._told] / (self._reach, self._relief, 1.0)
                parts["ground"] = blocks.reshape(len(contexts), -1)
            if ahead:
                parts["landing"] = seen.landings / self._landing
        scaled = np.hstack([parts[group] for group in self.groups if group in parts])
        scaled[np.isnan(scaled)] = 0.0  # a descent that overflowed has ended, but must still be seen
        return np.asarray(np.minimum(np.maximum(scaled, -1.0), 1.0) if elsewhere is None else scaled, np.float32)

    def _centred(self, contexts: Contexts) -> NDArray[np.float64]:
        """Scale the fields of contexts that agents may see, shape (n, 11)."""
        centred = 2.0 * (contexts[:, :SEEN] - self._context_low[:SEEN]) / self._divisor - 1.0
        return np.where(self.varies, centred, 0.0)

    def contexts_seen(self, observations: NDArray[np.float32]) -> Contexts:
        """Return the contexts behind observations, up to the rounding of float32.

        What the agent controls is NaN: it is nobody's choice yet. What is hidden is in the middle of its range, and the
        track number 0.

        Raises
        ------
        ValueError
            If observations have no context.
        """
        self._need("context")
        scaled = np.zeros((len(observations), FIELDS))
        scaled[:, :SEEN] = 0.5 * (observations[:, :SEEN].astype(np.float64) + 1.0)
        contexts = np.clip(self._context_low + scaled * self._width, self._context_low, self._context_high)
        contexts[:, _SHAPE] = np.rint(contexts[:, _SHAPE])
        contexts[:, self._chosen] = np.nan
        return contexts

    def _scaled(self, contexts: Contexts, flights: np.ndarray, ground: NDArray[np.float64]) -> NDArray[np.float64]:
        """Scale where descents stand, over ground of a height [m], shape (n, 11), columns ``FLIGHT``."""
        cosine, sine = directions(flights["phi"])
        limits = self.scenario.limits
        columns = (
            1.0 - flights["x"] / self._way,
            (flights["y"] - ground) / self._height,
            sine,
            cosine,
            flights["u"] / self._speed,
            flights["v"] / self._speed,
            flights["omega"] / self._spin,
            flights["trim"] / self._lent,
            flights["supplied"] / self._energies(contexts),
            flights["t"] / limits.max_time_s,
            flights["rebounds"] / limits.max_rebounds,
        )
        return np.stack(columns, axis=-1)

    def _energies(self, contexts: Contexts) -> NDArray[np.float64]:
        """Return the energies [J] by which those supplied are scaled, shape (n,): twice those of launches at most."""
        return self._speed * self._speed * self.of_bodies(contexts, attrgetter("mass"))

    def flights_seen(self, observations: NDArray[np.float32]) -> Seen:
        """Return where rides stand, from what is seen of them, up to the rounding of float32.

        Heights count from the ground under the mass centre. The ground is level with the plane before the first vertex
        that is seen and behind the last one, and a body that would not be clear of it is lifted.

        Raises
        ------
        ValueError
            If observations have no context, state or ground.
        """
        self._need(*USUAL)
        block = observations[:, SEEN : SEEN + len(FLIGHT) + len(VERTEX) * self._vertices].astype(np.float64)
        left, height, sine, cosine, u, v, omega, trim, supplied, *_ = block[:, : len(FLIGHT)].T
        contexts = self.contexts_seen(observations)
        x, phi = (1.0 - left) * self._way, np.arctan2(sine, cosine)
        around = block[:, len(FLIGHT) :].reshape(len(block), -1, len(VERTEX))
        profiles: list[Profile] = [
            tuple(
                (at + self._reach * ahead, self._relief * y, 0.0)
                for ahead, y, there in row
                if there and abs(ahead) < 1.0
            )
            for at, row in zip(x.tolist(), around.tolist(), strict=True)
        ]
        profiles = [profile if len(profile) > 1 else () for profile in profiles]
        # A body has just taken off: not even rounding must press it in.
        records = records_of(self.bodies_of(contexts), len(x))
        lowest = resting_heights(records, x, phi, Tracks.of(profiles))
        y = np.maximum(height * self._height, lowest)
        states = np.stack([x, y, phi, u * self._speed, v * self._speed, omega * self._spin], axis=-1)
        return Seen(states, trim * self._lent, supplied * self._energies(contexts), profiles)

    def _need(self, *groups: str) -> None:
        """Raise ValueError unless observations have some groups of columns."""
        for group in groups:
            if group not in self.groups:
                raise ValueError(f"columns = {self.groups!r}: must have {group!r} where that is read from observations")

    def _scales(self, bounds: dict[str, NDArray[np.float64]]) -> tuple[float, float]:
        """Speed [m/s] and spin [rad/s] of a body that has all energy that the scenario can supply to a launch.

        Of several bodies they are the largest.
        """
        most = np.maximum(np.abs(self._context_low), np.abs(self._context_high))
        for name, pair in bounds.items():
            i = Context._fields.index(name)
            most[i] = max(most[i], *np.abs(pair))
        _, _, _, speed, drop, fall, _, spin, *_ = most.tolist()
        below, gravity = self._way * max(0.0, np.sin(self._context_high[0])), self.scenario.slope_section.gravity_m_s2
        below += self._relief
        scales = []
        for body in self.bodies:
            height = drop + highest_support(body) + below
            gyration = body.inertia / body.mass  # [m^2]
            square = speed * speed + fall * fall + gyration * spin * spin + 2.0 * gravity * height
            if not 0.0 <= square < math.inf:
                at_most = f"speed {speed:g} m/s, fall {fall:g} m/s, spin {spin:g} rad/s, drop {drop:g} m"
                raise ScenarioError(f"scenario {self.scenario.id}: its launches have no finite energy: {at_most}")
            fastest = math.sqrt(square) or 1.0
            scales.append((fastest, fastest / float(np.sqrt(gyration))))
        speeds, spins = zip(*scales, strict=True)
        return max(speeds), max(spins)

    def chosen(self, contexts: Contexts, actions: NDArray[np.float64]) -> Contexts:
        """Return contexts, shape (n, 12), with what actions of shape (n, k) choose in its place, without noise."""
        chosen = contexts[:, :FIELDS].copy()
        chosen[:, self._chosen] = self._action_low + 0.5 * (actions + 1.0) * (self._action_high - self._action_low)
        return chosen

    def launches(self, contexts: Contexts, actions: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return the states at launch that actions ask for, shape (n, 6), columns as in :class:`sledenv.State`.

        Without actions they are those that the contexts say.

        Parameters
        ----------
        contexts : ndarray, shape (n, 12) or (n, 14)
        actions : ndarray, shape (n, k)
            Out of :func:`sledenv.envs.inputs.checked_actions`, scaled to the control bounds of the scenario: a column
            for each of ``controlled``.
        """
        chosen = contexts[:, :FIELDS].copy() if actions is None else self.chosen(contexts, actions)
        if contexts.shape[1] > FIELDS:
            chosen[:, _DISTURBED] += contexts[:, FIELDS:]
        launches = np.empty((len(chosen), len(State._fields)))
        for body, rows in self.by_body(chosen):
            launches[rows] = self.scenario.launches(chosen[rows], body)
        return launches

    def launch(self, contexts: Contexts, actions: NDArray[np.float64]) -> State:
        """Return the state at launch of the first row of contexts and actions."""
        return State(*self.launches(contexts[:1], actions[:1])[0].tolist())

    def descend(self, contexts: Contexts, launch: State, record: Record = "rebounds") -> Descent:
        """Simulate the one descent of a launch in contexts with one row."""
        return simulate(*self._scene(contexts), launch, self.settings, record=record)

    def ride(self, contexts: Contexts, launch: State, record: Record = "rebounds") -> Ride:
        """Return the descent that :meth:`descend` simulates at its launch, to be followed flight by flight."""
        given = *self._scene(contexts), launch, self.settings
        return Ride(*given, record=record, rotor_inertia=self._rotor, shortest_flight=self._shortest)

    def ridden(self, contexts: Contexts, trims: Sequence[float], record: Record = "rebounds") -> Descent:
        """Return the ride of trims in [-1, 1], of one flight after the other, in contexts with one row.

        Flights behind the last of them are ridden with what it lends.
        """
        ride = self.ride(contexts, State.found(self.launches(contexts)[0].tolist()), record)
        if ride.status == Status.RUNNING:
            ride.await_flight()
        for decision, trim in enumerate(trims):
            if ride.status != Status.RUNNING:
                break
            (spin,) = self.spins(contexts, np.array([[trim]]), np.array([decision])).tolist()
            if self._rotor is not None:
                ride.trim(spin)
            ride.hop()
        return ride.run()

    def _scene(self, contexts: Contexts) -> tuple[Body, ContactLaw, Slope]:
        """Return what the first row of contexts is a descent of."""
        context = self.context(contexts)
        return self.body(contexts), self.scenario.law(context), self.scenario.slope(context)

    def descend_batch(
        self, contexts: Contexts, launches: NDArray[np.float64], *, keep_rebounds: bool = False
    ) -> DescentBatch:
        """Simulate one descent a row, on all cores; row i equals :meth:`descend` of row i bit for bit."""
        if len(contexts) == 1:  # which is checked in half the time
            return self.descend(contexts, State.found(launches[0].tolist())).as_batch()
        parts = []
        for body, rows in self.by_body(contexts):
            laws, slopes = self.scenario.laws(contexts[rows]), self.scenario.slopes(contexts[rows])
            batch = simulate_batch(body, laws, slopes, launches[rows], self.settings, keep_rebounds=keep_rebounds)
            parts.append((rows, batch))
        return parts[0][1] if len(parts) == 1 else _joined(parts, len(contexts))

    def spins(
        self, contexts: Contexts, actions: NDArray[np.float64], decisions: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """Return the spins [rad/s] that riders lend in flights, errors of their contexts included; 0 without a rider.

        Parameters
        ----------
        contexts : ndarray, shape (n, 12) or (n, 14)
        actions : ndarray, shape (n, 1)
            Trims in [-1, 1].
        decisions : ndarray of int, shape (n,)
            Which decision of the ride each is, counted from 0.
        """
        rider = self.scenario.rider
        if rider is None:
            return np.zeros(len(contexts))
        return rider.trim_rad_s * actions[:, 0] + self.scenario.errors(contexts, decisions)

    def rides(self, contexts: Contexts, *, keep_rebounds: bool = False) -> RideBatch:
        """Return the descents of contexts at their drawn launch, to be followed flight by flight."""
        return RideBatch(
            self.bodies_of(contexts),
            self.scenario.laws(contexts),
            self.scenario.slopes(contexts),
            self.launches(contexts),
            self.settings,
            keep_rebounds=keep_rebounds,
            rotor_inertia=self._rotor,
            shortest_flight=self._shortest,
        )


def _joined(parts: Sequence[tuple[slice | NDArray[np.intp], DescentBatch]], count: int) -> DescentBatch:
    """Return batches as one, each in the rows that are its own."""
    _, first = parts[0]
    outcomes, jam = np.empty(count, OUTCOME), np.empty((len(DescentJam._fields), count))
    rebounds = np.empty((count if first.rebounds.size else 0, first.rebounds.shape[1]), REBOUND)
    for rows, part in parts:
        outcomes[rows], jam[:, rows] = part.outcomes, part.jam
        if rebounds.size:
            rebounds[rows] = part.rebounds
    return DescentBatch(outcomes, rebounds, DescentJam(*jam))


def _grouped(columns: Sequence[str], ride: bool) -> tuple[str, ...]:
    """Return the groups of columns that an observation has, in their order, or raise ValueError."""
    known = GROUPS if ride else (GROUPS[0], GROUPS[2])
    listed = not isinstance(columns, str) and isinstance(columns, Iterable)
    given = tuple(columns) if listed else ()
    if not ride and given == USUAL:  # a launch has none of a state
        return known
    if not given or not all(isinstance(name, str) and name in known for name in given):
        raise ValueError(f"columns = {columns!r}: must be a sequence of any of {', '.join(map(repr, known))}")
    return tuple(name for name in known if name in given)


def _observed(observe: Literal["all"] | Sequence[str]) -> tuple[str, ...]:
    """Return the fields of a context that are named, in their order, or raise ValueError."""
    fields = Context.seen
    if isinstance(observe, str) and observe == "all":
        return fields
    listed = not isinstance(observe, str) and isinstance(observe, Iterable)
    if not listed or not all(isinstance(name, str) and name in fields for name in observe):
        known = ", ".join(map(repr, fields))
        raise ValueError(f"observe = {observe!r}: must be 'all' or a sequence of any of {known}")
    return tuple(name for name in fields if name in set(observe))


def highest_support(body: Body) -> float:
    """Bound [m] of the height of the mass centre where a body touches, in whatever pose.

    Of a segment it is that of its whole disc: agents are told speeds by it, and those that are trained know them so.
    """
    return body.radius + body.eccentricity if isinstance(body, Segment) else body.size
