"""Pictures, films and words of the episode in one lane."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from gymnasium.core import RenderFrame
from numpy.typing import NDArray

from sledenv.envs.render import DescentRenderer
from sledenv.envs.task import Task
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.records import Status
from sledenv.simulation.ride import Ride
from sledenv.simulation.rules import checked_choice
from sledenv.simulation.scenes import Scenes
from sledenv.simulation.words import setting, story

_FPS: Final = 30


class _RenderModes(list[str]):
    """The words that there are. Gymnasium asks for a mode before an environment does: what is no word is named here."""

    def __contains__(self, mode: Any) -> bool:
        if mode is not None and not isinstance(mode, str):
            checked_render_mode(mode)
        return super().__contains__(mode)


RENDER_MODES: Final = _RenderModes(["human", "rgb_array", "rgb_array_list", "ansi"])
METADATA: Final[dict[str, Any]] = {"render_modes": RENDER_MODES, "render_fps": _FPS}


def checked_render_mode(mode: str | None) -> str | None:
    """Return a render mode, or raise ValueError."""
    return None if mode is None else checked_choice("render_mode", mode, tuple(RENDER_MODES))


class Past(NamedTuple):
    """What has happened in an episode."""

    launched: bool = False  # False while a launch is awaited
    trims: tuple[float, ...] = ()  # [rad/s] of each step of a ride
    shown: float = -1.0  # [s] up to which the film has been shown, below 0 before the launch has been


class Viewer:
    """Shows one lane. It simulates what it is asked to show once more, for the trajectory.

    Parameters
    ----------
    task : Task
    mode : str or None
        One of ``RENDER_MODES``.
    by_hops : bool
        Whether a step is a flight with a trim, and not the whole descent.
    """

    def __init__(self, task: Task, mode: str | None, *, by_hops: bool) -> None:
        self.past = Past()
        self._task = task
        self._mode = mode
        self._by_hops = by_hops
        self._renderer: DescentRenderer | None = None

    def enter(self, scenes: Scenes, past: Past | None = None) -> None:
        """Turn to another episode, which begins in a scene, or goes on from a past."""
        self.past = past or Past()
        self._scenes = scenes
        self._ride: Ride | None = None
        self._followed = 0  # trims
        if past is None:
            self._play()

    def step(self, scenes: Scenes, trim: float) -> None:
        """Take note of a step: of the scene with its launch, and of the trim [rad/s] if a step is a flight."""
        trims = (*self.past.trims, trim) if self._by_hops else ()
        self._scenes, self.past = scenes, self.past._replace(launched=True, trims=trims)
        self._play()

    def render(self) -> RenderFrame | list[RenderFrame] | None:
        """Return what the render mode asks for, see :meth:`sledenv.envs.launch.SledLaunch.render`."""
        launched = self.past.launched
        match self._mode:
            case "rgb_array":
                return self._drawing().strobe(self._recorded()) if launched else self._launch_frame()
            case "rgb_array_list":
                return list(self.film())
            case "ansi":
                return story(self._recorded()) if launched else setting(*self._awaited())
        return None

    def film(self) -> Iterator[NDArray[np.uint8]]:
        """Draw what has happened since the last call: the launch, or the film of the descent."""
        shown = self.past.shown
        if self.past.launched:
            descent = self._recorded()
            self.past = self.past._replace(shown=descent.time)
            yield from self._drawing().film(descent, after=shown)
        elif shown < 0.0:
            self.past = self.past._replace(shown=0.0)
            yield self._launch_frame()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _play(self) -> None:
        if self._mode == "human":
            self._drawing().play(self.film())

    def _drawing(self) -> DescentRenderer:
        body = self._task.body(self._scenes)
        if self._renderer is None:
            self._renderer = DescentRenderer(body, fps=_FPS)
        elif self._renderer.body != body:
            self._renderer.draw(body)
        return self._renderer

    def _launch_frame(self) -> NDArray[np.uint8]:
        _, law, slope, launch = self._awaited()
        return self._drawing().launch_frame(slope, launch, law.friction)

    def _awaited(self) -> Any:
        """Return body, law, slope and the launch of the context, which nobody has chosen yet."""
        return self._task.scenario.given(self._task.context(self._scenes))

    def _recorded(self) -> Descent:
        """Return the descent so far with its trajectory."""
        trims = self.past.trims
        if not self._by_hops:
            return self._task.descent(self._scenes, record="trajectory")
        if self._ride is None:
            self._ride = self._task.ride(self._scenes, record="trajectory")
            self._ride.await_flight()
        for trim in trims[self._followed :]:
            if self._ride.status != Status.RUNNING:  # no flight was worth a decision
                break
            if self._task.scenario.rider is not None:
                self._ride.trim(trim)
            self._ride.hop()
        self._followed = len(trims)
        return self._ride.descent()
