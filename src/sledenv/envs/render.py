"""Pictures and a window of a descent, drawn with pygame on a surface in memory."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator

import numpy as np
from gymnasium.error import DependencyNotInstalled

from sledenv.envs.canvas import Camera, Canvas, panel_height
from sledenv.plot.grounds import surface
from sledenv.plot.riders import strobe_poses
from sledenv.plot.shapes import Push, contact_paths, film_times, push_at, to_world
from sledenv.simulation.bodies import Body
from sledenv.simulation.interpolation import drawable_rows, states_at
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.records import Status
from sledenv.simulation.scene import Slope, State
from sledenv.simulation.words import mode_name, motion_words, part_name, quantity

_SMALLEST = (160, 90)  # [px]
_STROBE_POSES = 18
_PLACES = 65  # of which the camera takes the mean height


class DescentRenderer:
    """Draws descents of one body as RGB arrays and shows them in a window.

    All pictures depend on their arguments alone.

    Parameters
    ----------
    body : Body
        Its shape and size.
    size : tuple of int
        Width and height of the pictures [px], at least 160 x 90.
    fps : int
        Pictures a second of a film, >= 1.

    Raises
    ------
    gymnasium.error.DependencyNotInstalled
        If pygame is missing.
    ValueError
        Naming the argument, its value and the allowed range.
    """

    def __init__(self, body: Body, *, size: tuple[int, int] = (960, 540), fps: int = 30):
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        try:
            import pygame  # noqa: F401
        except ImportError as error:
            raise DependencyNotInstalled("rendering needs pygame: pip install 'sledenv[render]'") from error
        if size[0] < _SMALLEST[0] or size[1] < _SMALLEST[1]:
            raise ValueError(f"size = {size!r}: must be at least {_SMALLEST[0]} x {_SMALLEST[1]} px")
        if fps < 1:
            raise ValueError(f"fps = {fps!r}: must be >= 1")
        self.size = (int(size[0]), int(size[1]))
        self.fps = int(fps)
        self.draw(body)
        self._open = False  # whether the window is this one's; pygame has one window for all of a process
        self._dismissed = False

    def draw(self, body: Body) -> None:
        """Draw descents of another body from here on, in the same window."""
        self.body = body
        self._reach = max(body.size, 1e-6)  # a point mass has none

    def frame(self, descent: Descent, time: float) -> np.ndarray:
        """Draw the sled at one time of a descent.

        Parameters
        ----------
        descent : Descent
            Simulated with ``record="trajectory"``.
        time : float
            Since the launch [s]; clipped to the duration of the descent, whose outcome is shown from its end on.

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
        """
        if math.isnan(time):
            raise ValueError(f"time = {time!r}: must be a number")
        rows = drawable_rows(descent)
        now = min(max(float(time), 0.0), descent.time)
        state = State.found(states_at(rows, [now])[0].tolist())
        camera = self.camera(descent, now)
        canvas = Canvas(self.size, camera, descent.slope)
        canvas.ground(descent.law.friction, self._reach)
        past = rows[rows["t"] <= now]
        canvas.path(np.stack([np.append(past["x"], state.x), np.append(past["y"], state.y)], axis=-1))
        canvas.contacts(contact_paths(descent, now))
        push = push_at(descent, now)
        if push is not None:
            canvas.cones(push, _frictions(descent, push))
        canvas.sled(self.body, state, 1.0, () if push is None else set(push.touches["part"].tolist()))
        if push is not None:
            canvas.push(push, _frictions(descent, push), self._reach)
            canvas.note(*_push_words(descent, push))
        return canvas.picture(_numbers(descent, now, state))

    def film(self, descent: Descent, *, after: float = -1.0, speed: float = 1.0) -> Iterator[np.ndarray]:
        """Draw a film of a descent at its own rate, in which every impact is held until one has seen it.

        Parameters
        ----------
        descent : Descent
            Simulated with ``record="trajectory"``.
        after : float
            Leave out what had been shown when the descent was at this time [s].
        speed : float
            Simulated seconds a second outside impacts, > 0.

        Yields
        ------
        ndarray of uint8, shape (height, width, 3)
            Each as :meth:`frame` draws it, ``fps`` of them a second; the last shows the outcome.
        """
        if not 0.0 < speed < math.inf:
            raise ValueError(f"speed = {speed!r}: must be in (0, inf)")
        for time in film_times(descent, self.fps, after=after, speed=speed).tolist():
            yield self.frame(descent, time)

    def strobe(self, descent: Descent) -> np.ndarray:
        """Draw a whole descent in one picture: the sled at equal intervals of time, the earlier the paler.

        Parameters
        ----------
        descent : Descent
            Simulated with ``record="trajectory"``.

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
        """
        rows = drawable_rows(descent)
        canvas = Canvas(self.size, self._whole(descent.slope, rows), descent.slope)
        canvas.ground(descent.law.friction, self._reach)
        interval = float(rows["t"][-1]) / (_STROBE_POSES - 1)
        states = strobe_poses(self.body, rows, interval if interval > 0.0 else 1.0)
        for i, state in enumerate(states.tolist(), start=1):
            canvas.sled(self.body, State.found(state), 0.25 + 0.75 * (i / len(states)) ** 2)
        canvas.path(np.stack([rows["x"], rows["y"]], axis=-1))
        canvas.contacts(contact_paths(descent))
        return canvas.picture(_numbers(descent, descent.time, State.found(states[-1].tolist())))

    def launch_frame(self, slope: Slope, state: State, friction: float = 0.0) -> np.ndarray:
        """Draw the sled as it is about to be let go, before anything is simulated.

        Parameters
        ----------
        slope : Slope
            Where.
        state : State
            At launch.
        friction : float
            Of the ground around the zones of the slope [-].

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
        """
        rows = np.array([(0.0, *state)], dtype=[(name, "f8") for name in ("t", *State._fields)])
        canvas = Canvas(self.size, self._camera(slope, rows, state), slope)
        canvas.ground(friction, self._reach)
        canvas.sled(self.body, state, 1.0)
        return canvas.picture(_motion(0.0, state) | {"status": "launch", "reward": "-"})

    def camera(self, descent: Descent, time: float) -> Camera:
        """Return the camera of :meth:`frame` at ``time`` [s].

        It stands still and shows the whole slope, its profile and all hops unless the sled would be too small to see;
        then it follows the sled.
        """
        rows = drawable_rows(descent)
        return self._camera(descent.slope, rows, State.found(states_at(rows, [time])[0].tolist()))

    def _camera(self, slope: Slope, rows: np.ndarray, state: State) -> Camera:
        whole = self._whole(slope, rows)
        if whole.scale * self._reach >= whole.height / 48.0:
            return whole
        scale = whole.height / (10.0 * self._reach)
        # The surface stays in sight while the sled is low: its mean height, so that the camera moves gently.
        ahead = np.linspace(-0.5, 0.5, _PLACES) * whole.width / scale
        ground, low = float(slope.height_at(state.x + ahead).mean()), 0.3 * whole.height / scale
        y = max(min(state.y, ground + low), state.y - low)
        return Camera(state.x, y, slope.angle, scale, whole.width, whole.height)

    def _whole(self, slope: Slope, rows: np.ndarray) -> Camera:
        """Camera that shows the slope, if it ends, and every place of the sled."""
        width, height = self.size[0], self.size[1] - panel_height(self.size)
        ends = np.array([0.0] + ([slope.length] if math.isfinite(slope.length) else []))
        # Room for a sled at either end, so that launch and descent share one picture as a rule.
        room = np.stack([ends, slope.height_at(ends) + 2.0 * self._reach], axis=-1)
        path = np.stack([rows["x"], rows["y"]], axis=-1)
        places = np.append(rows["x"], ends)
        ground = surface(slope.vertices, float(places.min()), float(places.max()))
        world = to_world(np.concatenate([path, ground, room]), slope.angle)
        margin = max(1.2 * self._reach, 0.03 * float(np.ptp(world, axis=0).max()))
        low, high = world.min(axis=0) - margin, world.max(axis=0) + margin
        right, up = 0.5 * (low + high)
        scale = min(width / float(high[0] - low[0]), height / float(high[1] - low[1]), 0.15 * height / self._reach)
        x, y = to_world([(right, up)], -slope.angle)[0].tolist()
        return Camera(x, y, slope.angle, scale, width, height)

    def show(self, image: np.ndarray) -> bool:
        """Show a picture in the window, which is opened if need be.

        Parameters
        ----------
        image : ndarray of uint8, shape (height, width, 3)
            As returned by :meth:`frame`.

        Returns
        -------
        bool
            False if the user has closed the window; nothing is shown then until :meth:`close` is called.
        """
        import pygame

        if self._dismissed:
            return False
        height, width = image.shape[:2]
        window = pygame.display.get_surface()  # somebody else may have closed it
        if window is None or window.get_size() != (width, height):
            pygame.display.init()
            window = pygame.display.set_mode((width, height))
            pygame.display.set_caption("sledenv")
        self._open = True
        window.blit(pygame.image.frombuffer(image.tobytes(), (width, height), "RGB"), (0, 0))
        pygame.display.flip()
        if any(event.type == pygame.QUIT for event in pygame.event.get()):
            self.close()
            self._dismissed = True
        return not self._dismissed

    def play(self, images: Iterable[np.ndarray]) -> None:
        """Show pictures in the window, ``fps`` of them a second, until there are no more or the user closes it.

        Parameters
        ----------
        images : iterable of ndarray of uint8, shape (height, width, 3)
            As :meth:`film` draws them.
        """
        import pygame

        clock = pygame.time.Clock()
        for image in images:
            if not self.show(image):
                return
            clock.tick(self.fps)

    def close(self) -> None:
        """Close the window, if there is one; a later :meth:`show` opens a new one."""
        import pygame

        if self._open:
            pygame.display.quit()
        self._open = False
        self._dismissed = False


def _motion(time: float, state: State) -> dict[str, str]:
    """What the panel says about the motion, by name."""
    return {
        "time": _number(time, " s"),
        "position": _number(state.x, " m"),
        "speed": _number(math.hypot(state.u, state.v), " m/s"),
        "spin": _number(state.omega, " rad/s"),
    }


def _number(value: float, unit: str) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:z.2f}{unit}" if abs(value) < 1e4 else f"{value:.1e}{unit}"


def _frictions(descent: Descent, push: Push) -> np.ndarray:
    """Coulomb coefficient [-] of each contact."""
    return descent.slope.friction_at(push.touches["x"], descent.law.friction)


def _push_words(descent: Descent, push: Push) -> tuple[str, ...]:
    """How the contact will end, what it does now and with which force."""
    name = f"contact {push.number + 1}, {part_name(descent.body, push.feature)}: "
    available = float((_frictions(descent, push) * push.touches["normal"]).sum())
    grip = f"   grip {abs(push.tangential) / available:.2f}" if available > 0.0 else ""
    mode = mode_name(int(descent.rebounds[push.number]["mode"]))
    if push.instantaneous:
        return name + mode, f"impulse {quantity(push.normal, 'N s')}{grip}"
    return name + mode, motion_words(push.slip, push.spin), f"force {quantity(push.normal, 'N')}{grip}"


def _numbers(descent: Descent, time: float, state: State) -> dict[str, str]:
    """What the panel says at ``time`` [s]: the motion and, from the end on, the outcome."""
    over = time >= descent.time and descent.status != Status.RUNNING
    return _motion(time, state) | {
        "status": str(descent.status) if over else "under way",
        "reward": _number(float(descent.jam.reward), "") if over else "-",
    }
