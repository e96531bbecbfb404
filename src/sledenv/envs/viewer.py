"""Pictures and films of the episode in one lane."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from gymnasium.core import RenderFrame
from numpy.typing import NDArray

from sledenv.envs.task import Task
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.records import Status
from sledenv.simulation.ride import Ride
from sledenv.simulation.rules import checked_choice
from sledenv.simulation.scenes import Scenes

RENDER_MODES: Final = ["human", "rgb_array"]
_FPS: Final = 30
METADATA: Final[dict[str, Any]] = {"render_modes": RENDER_MODES, "render_fps": _FPS}


def checked_render_mode(mode: str | None) -> str | None:
    """Return a render mode, or raise ValueError."""
    return None if mode is None else checked_choice("render_mode", mode, tuple(RENDER_MODES))


class Past(NamedTuple):
    """Events of an episode so far."""

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
        self._dismissed = False  # whether the user has closed the window

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

    def render(self) -> RenderFrame | None:
        """Return what the render mode asks for, see :meth:`sledenv.envs.launch.SledLaunch.render`."""
        if self._mode != "rgb_array":
            return None
        from sledenv.envs.render import draw_frame  # which needs pygame

        descent = self.descent()
        return draw_frame(descent, descent.time if self.past.launched else 0.0)

    def film(self) -> Iterator[NDArray[np.uint8]]:
        """Draw what has happened since the last call: the launch, or the film of the descent."""
        from sledenv.envs.render import draw_film, draw_frame

        shown, descent = self.past.shown, self.descent()
        if self.past.launched:
            self.past = self.past._replace(shown=descent.time)
            yield from draw_film(descent, after=shown, fps=_FPS)
        elif shown < 0.0:
            self.past = self.past._replace(shown=0.0)
            yield draw_frame(descent, 0.0)

    def descent(self) -> Descent:
        """Return the descent so far with its trajectory."""
        if not self._by_hops:
            return self._task.descent(self._scenes, record="trajectory")
        if self._ride is None:
            self._ride = self._task.ride(self._scenes, record="trajectory")
            self._ride.await_flight()
        for trim in self.past.trims[self._followed :]:
            if self._ride.status != Status.RUNNING:  # no flight was worth a decision
                break
            if self._task.scenario.rider is not None:
                self._ride.trim(trim)
            self._ride.hop()
        self._followed = len(self.past.trims)
        return self._ride.descent()

    def close(self) -> None:
        """Close the window; what comes next opens a new one."""
        if self._mode == "human":
            import pygame

            pygame.display.quit()
        self._dismissed = False

    def _play(self) -> None:
        """Show the film in the window, until it ends or the user closes it: then nothing is shown until ``close``."""
        if self._mode != "human":
            return
        for picture in self.film():
            if self._dismissed:
                return
            self._show(picture)

    def _show(self, picture: NDArray[np.uint8]) -> None:
        """Show a picture, in its time, in the window of the process, which is opened if need be."""
        import pygame

        size = picture.shape[1::-1]
        window = pygame.display.get_surface()
        if window is None or window.get_size() != size:
            pygame.display.init()
            window = pygame.display.set_mode(size)
            pygame.display.set_caption("sledenv")
        window.blit(pygame.image.frombuffer(picture.tobytes(), size, "RGB"), (0, 0))
        pygame.display.flip()
        pygame.time.wait(1000 // _FPS)
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            pygame.display.quit()
            self._dismissed = True
