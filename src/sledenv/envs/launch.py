"""SledLaunch: choose how the sled is let go, then the whole descent runs in one step."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Unpack

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from gymnasium.core import RenderFrame
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from sledenv.envs.info import INFO_KEYS, checked_info, context_info, episode_info, only_lane
from sledenv.envs.inputs import Contexts, checked_actions, read_options
from sledenv.envs.render import DescentRenderer
from sledenv.envs.task import Task, TaskOptions, check_options
from sledenv.scenarios.scenario import Context, Scenario
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.rules import checked_choice, checked_seed
from sledenv.simulation.scene import State
from sledenv.simulation.words import setting, story

_NOTHING = -1.0  # [s] before any time of a film


class Snapshot(NamedTuple):
    """Where an environment stands, random stream included; opaque, picklable, may be restored any number of times."""

    task: dict[str, Any]  # of what
    episode: dict[str, Any]
    stream: Any  # np.random.Generator, or the Streams of a batch


def check_snapshot(
    snapshot: Any,
    task: dict[str, Any],
    episode: dict[str, tuple[type, ...]],
    arrays: dict[str, np.ndarray],
    stream: type,
) -> None:
    """Raise TypeError or ValueError unless a snapshot is one of a task, with the attributes that an episode has.

    ``arrays`` has some of the attributes as they may be, whatever their entries.
    """
    if not isinstance(snapshot, Snapshot):
        raise TypeError(f"snapshot = {snapshot!r}: must come from snapshot()")
    if not isinstance(snapshot.task, dict) or snapshot.task.keys() != task.keys():
        raise ValueError(f"snapshot.task = {snapshot.task!r}: the snapshot is of another task, must be {task}")
    for name, own in task.items():
        if snapshot.task[name] != own:
            given = snapshot.task[name]
            raise ValueError(f"snapshot.task[{name!r}] = {given!r}: the snapshot is of another task, must be {own!r}")
    held = snapshot.episode
    if not isinstance(held, dict) or held.keys() != episode.keys():
        raise ValueError(f"snapshot.episode = {held!r}: must hold {', '.join(episode)}")
    kinds = {f"episode[{name!r}]": (held[name], allowed) for name, allowed in episode.items()}
    for name, (value, allowed) in (kinds | {"stream": (snapshot.stream, (stream,))}).items():
        if not isinstance(value, allowed):
            raise TypeError(f"snapshot.{name} = {value!r}: must come from snapshot()")
    for name, own in arrays.items():
        value = held[name]
        if (value.dtype, value.shape) != (own.dtype, own.shape):
            have = f"is {value.dtype} of shape {value.shape}"
            raise ValueError(f"snapshot.episode[{name!r}] {have}: must be {own.dtype} of shape {own.shape}")


class SledLaunch(gym.Env[NDArray[np.float32], NDArray[np.float32]]):
    """A one-step environment: from the context of a launch to what an agent chooses of it.

    Observation
        ``Box(-1, 1, (11,), float32)``: slope angle, friction, restitution, speed, drop, fall, orientation, spin, begin
        and friction of the zone that is drawn, and number of the body of the context, scaled by the ranges of the
        scenario. What does not vary, what ``observe`` leaves out and what the agent controls reads 0.
    Action
        ``Box(-1, 1, (k,), float32)``: what ``control`` names of the launch, scaled to the control bounds.
    Reward
        progress / 2 + sqrt(retention) / 2 in [0, 1]; see :mod:`sledenv.simulation.jam` and docs/environments.md.
    Ending
        Every episode terminates after its one step.
    Info
        ``context``; ``launch``, the orientation [rad], spin [rad/s] and speed [m/s] with which the body was let go, its
        error included; ``rebounds`` (a dict of columns, one entry a rebound), ``jam``, ``is_success`` and ``descent``
        (status, an index of ``sledenv.STATUS_OF_CODE``, time, energy).

    Parameters
    ----------
    scenario : str, path or Scenario
        As for :func:`sledenv.load_scenario`.
    control : str, optional
        What the agent chooses, such as "both", orientation and spin; the rest is a disturbance that it observes.
        docs/environments.md lists the words. What the scenario says by default.
    render_mode : {"human", "rgb_array", "rgb_array_list", "ansi"}, optional
        A window that plays the descent, one picture of it, the pictures of a film of it, or its table of rebounds. Give
        ``gym.make`` a str: with anything else Gymnasium itself fails, in words of Python's.
    solver : {"compliant", "rigid"}
        Which contact is simulated, as for :func:`sledenv.simulate`.
    split : {"train", "validation", "test"}, optional
        Draw contexts of this split alone; no two splits have one in common, whatever the seeds.
    launch_noise : pair of float, optional
        Standard deviations of normal errors of the orientation [rad] and the spin [rad/s] at launch, the tremble of a
        hand; those of the scenario by default. (0, 0) launches exactly.
    observe : "all" or sequence of str
        Fields of the context that the agent sees; the others vary as before, but read 0.
    info : sequence of str
        Entries of info to give, all by default. Without "rebounds" every value has the same form at every step, as some
        collectors of other libraries need.

    Attributes
    ----------
    observation_names, action_names : tuple of str
        What the entries of an observation and of an action are.

    Notes
    -----
    ``reset(options={"context": {"friction": 0.3}})`` fixes part of the context, or all of it by a ``Context(...)``;
    ``options={"split": "test"}`` draws the rest from another split.
    """

    metadata = {"render_modes": ["human", "rgb_array", "rgb_array_list", "ansi"], "render_fps": 30}
    action_space: spaces.Box  # type: ignore[assignment]
    # Attributes that make up a snapshot, and what each may be.
    _episode: dict[str, tuple[type, ...]] = {
        "_context": (np.ndarray,),
        "_launch": (State, type(None)),
        "_seen": (float,),
    }

    def __init__(
        self,
        scenario: str | os.PathLike[str] | Scenario = "sled_snow",
        control: str | None = None,
        render_mode: str | None = None,
        *,
        info: Sequence[str] = INFO_KEYS,
        **task: Unpack[TaskOptions],
    ) -> None:
        check_options(type(self), task)
        if render_mode is not None:
            checked_choice("render_mode", render_mode, tuple(self.metadata["render_modes"]))
        self.task = Task(scenario, control, **task)
        self.observation_space = self.task.observation_space
        self.action_space = self.task.action_space
        self.observation_names: tuple[str, ...] = self.task.observation_names
        self.action_names: tuple[str, ...] = self.task.action_names
        self.info_keys = checked_info(info)
        self.render_mode = render_mode
        self._renderer: DescentRenderer | None = None
        self._context: Contexts | None = None  # one lane
        self._launch: State | None = None  # of the last step; None while a launch is awaited
        self._seen = _NOTHING  # time [s] up to which the film has been shown

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode in a new context.

        Parameters
        ----------
        seed : int, optional
            Of the random stream, which goes on without.
        options : dict, optional
            ``context`` and ``split``: what is fixed of the context, see :func:`sledenv.envs.inputs.read_options`. The
            random stream stays where it is if nothing is left to be drawn.

        Raises
        ------
        TypeError, ValueError
            For a wrong seed, an unknown option, or naming the field of a context that cannot be simulated; the episode
            goes on.
        """
        given = read_options(options, self.task.split)
        self.task.check(given)
        super().reset(seed=None if seed is None else checked_seed(seed))
        context = self.task.begin(given, lambda drawn: self.np_random.random((len(drawn), self.task.draws)))
        self.enter(context)
        info = {"context": context_info(context)} if "context" in self.info_keys else {}
        return self.task.observe(context)[0], only_lane(info)

    def enter(self, context: Contexts) -> None:
        """Begin an episode in a context that another environment has drawn, one row with its launch noise."""
        self._context = context.copy()
        self._launch = None
        self._seen = _NOTHING
        if self.render_mode == "human":
            self._drawing().play(self._unseen())

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Run the whole descent.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset and after the end of an episode.
        gymnasium.error.InvalidAction
            For an action outside the action space; the episode goes on.
        """
        if self._context is None or self._launch is not None:
            raise ResetNeeded("call reset before step: an episode has one step")
        launch = self.task.launch(self._context, checked_actions(self.action_space, [action], 1))
        descent = self.task.descend(self._context, launch)
        self._launch = launch
        if self.render_mode == "human":
            self._drawing().play(self._unseen())
        info = episode_info(self._context, np.array([launch]), descent.as_batch(), self.info_keys)
        return self.task.observe(self._context)[0], float(descent.jam.reward), True, False, only_lane(info)

    def render(self) -> RenderFrame | list[RenderFrame] | None:
        """Return what the render mode asks for.

        Returns
        -------
        ndarray of uint8, shape (H, W, 3), list of them, str or None
            "rgb_array": a picture of the launch, or a strobe picture of the descent so far. "rgb_array_list": the
            pictures, ``metadata["render_fps"]`` a second, of all that has happened since the last call or the reset.
            "ansi": the launch, and once there is one the descent so far, in words. "human": None, the window is drawn
            by ``reset`` and ``step``.
        """
        if self._context is None:
            raise ResetNeeded("call reset before render")
        match self.render_mode:
            case "rgb_array":
                return self._launch_frame() if self._launch is None else self._drawing().strobe(self._recorded())
            case "rgb_array_list":
                return list(self._unseen())
            case "ansi":
                return self._setting() if self._launch is None else story(self._recorded())
            case None:
                gym.logger.warn("render is called without a render_mode: give one to gym.make")
        return None

    def film(self) -> Iterator[NDArray[np.uint8]]:
        """Draw what "rgb_array_list" would list, one picture after the other, so that none needs to be kept.

        :func:`sledenv.envs.film.write_film` makes a file of it.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset.
        """
        if self._context is None:
            raise ResetNeeded("call reset before film")
        return self._unseen()

    def snapshot(self) -> Snapshot:
        """Return where the environment stands; what is done with it later does not change the snapshot.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first reset.
        """
        if self._context is None:
            raise ResetNeeded("call reset before snapshot")
        episode = {name: copy.deepcopy(getattr(self, name)) for name in self._episode}
        return Snapshot(self._identity(), episode, copy.deepcopy(self.np_random))

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot: what follows is, bit for bit, what would have followed there.

        Parameters
        ----------
        snapshot : Snapshot
            Of this environment or of another one with the same arguments.

        Raises
        ------
        TypeError, ValueError
            If it is no snapshot, or one of another task; the environment stays where it is.
        """
        arrays = {"_context": np.empty((1, self.task.draws))}
        check_snapshot(snapshot, self._identity(), self._episode, arrays, np.random.Generator)
        for name, value in copy.deepcopy(snapshot.episode).items():
            setattr(self, name, value)
        self.np_random = copy.deepcopy(snapshot.stream)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _drawing(self) -> DescentRenderer:
        assert self._context is not None
        body = self.task.body(self._context)
        if self._renderer is None:
            self._renderer = DescentRenderer(body, fps=self.metadata["render_fps"])
        elif self._renderer.body != body:
            self._renderer.draw(body)
        return self._renderer

    def _identity(self) -> dict[str, Any]:
        return {"environment": type(self).__name__} | self.task.identity

    def _launch_frame(self) -> NDArray[np.uint8]:
        scenario, context = self._given()
        return self._drawing().launch_frame(scenario.slope(context), scenario.launch(context), context.friction)

    def _setting(self) -> str:
        scenario, context = self._given()
        return setting(scenario.body(context), scenario.law(context), scenario.slope(context), scenario.launch(context))

    def _given(self) -> tuple[Scenario, Context]:
        assert self._context is not None
        return self.task.scenario, self.task.context(self._context)

    def _recorded(self) -> Descent:
        """Return the descent with its trajectory."""
        assert self._context is not None
        assert self._launch is not None
        return self.task.descend(self._context, self._launch, record="trajectory")

    def _unseen(self) -> Iterator[NDArray[np.uint8]]:
        """Draw what has happened since the last call: the launch, or the film of the descent."""
        seen = self._seen
        if self._launch is not None:
            descent = self._recorded()
            self._seen = descent.time
            yield from self._drawing().film(descent, after=seen)
        elif seen == _NOTHING:
            self._seen = 0.0
            yield self._launch_frame()
