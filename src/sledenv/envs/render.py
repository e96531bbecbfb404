"""Pictures and a window of a descent, drawn with pygame on a surface in memory."""

from __future__ import annotations

import importlib
import importlib.util
import itertools
import math
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from gymnasium.error import DependencyNotInstalled

from sledenv.kernel.records import Status
from sledenv.machine.files import replacing
from sledenv.pages.words import feature_name, mode_name, motion_words, quantity
from sledenv.plot.shapes import (
    Push,
    body_outline,
    contact_spans,
    drawable_rows,
    film_times,
    heavy_side,
    push_at,
    reach,
    spoke,
    states_at,
    strobe_states,
    to_world,
)
from sledenv.simulation.bodies import Body
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import Slope, State

if TYPE_CHECKING:
    import pygame

Colour = tuple[int, int, int]

SKY: Colour = (238, 243, 248)
SNOW: Colour = (252, 253, 255)
SURFACE: Colour = (120, 138, 156)
INK: Colour = (45, 52, 60)
PALE: Colour = (98, 110, 122)
PATH: Colour = (0, 114, 178)
CONTACT: Colour = (0, 158, 115)
SHELL: Colour = (246, 199, 163)
HEAVY: Colour = (213, 94, 0)
CONE: Colour = (248, 238, 140)
FORCE: Colour = (160, 30, 110)

_SHARPNESS = 2  # shapes are drawn this many times larger and smoothed down
_PANEL = 0.1  # of the height: the panel with the numbers, below the picture
_SMALLEST = (160, 90)  # [px]
_STROBE_POSES = 18
_FAR = 20_000.0  # [px] from the middle of a picture
_CONE_HEIGHT = 0.3  # of the height of the picture; the largest force of a contact is as long


class Camera(NamedTuple):
    """Where the slope frame lies in a picture."""

    x: float  # [m] slope-frame point in the middle of the picture
    y: float  # [m]
    angle: float  # [rad] of the slope
    scale: float  # [px/m]
    width: int  # [px] of the picture, without the panel
    height: int  # [px]

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Project slope-frame points [m], shape (..., 2), to columns and rows of the picture [px]."""
        # Subtracting first keeps all digits far down the slope.
        right, up = np.moveaxis(to_world(points - np.array([self.x, self.y]), self.angle), -1, 0)
        return np.stack([0.5 * self.width + self.scale * right, 0.5 * self.height - self.scale * up], axis=-1)


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
        self.body = body
        self.size = (int(size[0]), int(size[1]))
        self.fps = int(fps)
        self._reach = max(reach(body), 1e-6)  # a point mass has none
        self._window: pygame.Surface | None = None
        self._dismissed = False

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
        canvas = _Canvas(self.size, camera)
        canvas.slope(descent.slope, self._reach)
        past = rows[rows["t"] <= now]
        canvas.path(np.stack([np.append(past["x"], state.x), np.append(past["y"], state.y)], axis=-1))
        canvas.contacts(contact_spans(descent, now))
        push = push_at(descent, now)
        if push is not None:
            canvas.cone(push.place, descent.law.friction)
        canvas.sled(self.body, state, 1.0)
        if push is not None:
            canvas.push(push, descent.law.friction, self._reach)
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
        canvas = _Canvas(self.size, self._whole(descent.slope, rows))
        canvas.slope(descent.slope, self._reach)
        interval = float(rows["t"][-1]) / (_STROBE_POSES - 1)
        states = strobe_states(self.body, rows, interval if interval > 0.0 else 1.0)
        for i, state in enumerate(states.tolist(), start=1):
            canvas.sled(self.body, State.found(state), 0.25 + 0.75 * (i / len(states)) ** 2)
        canvas.path(np.stack([rows["x"], rows["y"]], axis=-1))
        canvas.contacts(contact_spans(descent))
        return canvas.picture(_numbers(descent, descent.time, State.found(states[-1].tolist())))

    def launch_frame(self, slope: Slope, state: State) -> np.ndarray:
        """Draw the sled as it is about to be let go, before anything is simulated.

        Parameters
        ----------
        slope : Slope
            Where.
        state : State
            At launch.

        Returns
        -------
        ndarray of uint8, shape (height, width, 3)
        """
        rows = np.array([(0.0, *state)], dtype=[(name, "f8") for name in ("t", *State._fields)])
        canvas = _Canvas(self.size, self._camera(slope, rows, state))
        canvas.slope(slope, self._reach)
        canvas.sled(self.body, state, 1.0)
        return canvas.picture(_motion(0.0, state) | {"status": "launch", "reward": "-"})

    def camera(self, descent: Descent, time: float) -> Camera:
        """Return the camera of :meth:`frame` at ``time`` [s].

        It stands still and shows the whole slope and all hops unless the sled would be too small to see; then it
        follows the sled.
        """
        rows = drawable_rows(descent)
        return self._camera(descent.slope, rows, State.found(states_at(rows, [time])[0].tolist()))

    def _camera(self, slope: Slope, rows: np.ndarray, state: State) -> Camera:
        whole = self._whole(slope, rows)
        if whole.scale * self._reach >= whole.height / 48.0:
            return whole
        scale = whole.height / (10.0 * self._reach)
        # The surface stays in sight while the sled is low.
        low = 0.3 * whole.height / scale
        return Camera(state.x, max(min(state.y, low), state.y - low), slope.angle, scale, whole.width, whole.height)

    def _whole(self, slope: Slope, rows: np.ndarray) -> Camera:
        """Camera that shows the slope, if it ends, and every place of the sled."""
        width, height = self.size[0], self.size[1] - _panel_height(self.size)
        ends = [0.0] + ([slope.length] if math.isfinite(slope.length) else [])
        # Room for a sled at either end, so that launch and descent share one picture as a rule.
        room = [(x, y) for x in ends for y in (0.0, 2.0 * self._reach)]
        path = np.stack([rows["x"], rows["y"]], axis=-1)
        world = to_world(np.concatenate([path, path * (1.0, 0.0), room]), slope.angle)
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
        if self._window is None or self._window.get_size() != (width, height):
            pygame.display.init()
            self._window = pygame.display.set_mode((width, height))
            pygame.display.set_caption("sledenv")
        self._window.blit(pygame.image.frombuffer(image.tobytes(), (width, height), "RGB"), (0, 0))
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

        if self._window is not None:
            pygame.display.quit()
        self._window = None
        self._dismissed = False


def write_film(pictures: Iterable[np.ndarray], path: str | os.PathLike[str], fps: int = 30) -> None:
    """Write pictures as a film, one after the other: none is kept but the one at hand.

    Parameters
    ----------
    pictures : iterable of ndarray of uint8, shape (height, width, 3)
        Such as ``env.unwrapped.film()``, or :meth:`DescentRenderer.film` of any descent.
    path : str or path
        Where to: ``.webp``, which browsers play, needs Pillow; ``.mp4`` needs imageio-ffmpeg, which comes with moviepy.
        A file that is there is replaced once the film is whole.
    fps : int
        Pictures a second, >= 1.

    Raises
    ------
    ValueError
        For another ending, no picture, or a wrong rate.
    gymnasium.error.DependencyNotInstalled
        If what writes the film is missing.
    """
    place = Path(path)
    if place.suffix not in _WRITERS:
        raise ValueError(f"path = {str(path)!r}: must end in {' or '.join(_WRITERS)}")
    if isinstance(fps, bool) or not isinstance(fps, int) or fps < 1:
        raise ValueError(f"fps = {fps!r}: must be an integer >= 1")
    module, package, write = _WRITERS[place.suffix]
    if importlib.util.find_spec(module) is None:
        raise DependencyNotInstalled(f"a film {place.suffix} needs {package}: pip install {package}")
    rest = iter(pictures)
    first = next(rest, None)
    if first is None:
        raise ValueError("pictures: there is none")
    with replacing(place, *_WRITERS) as scratch:
        write(itertools.chain([first], rest), first.shape, scratch, fps)


def _write_webp(pictures: Iterator[np.ndarray], shape: tuple[int, ...], file: Path, fps: int) -> None:
    from PIL import Image

    images = map(Image.fromarray, pictures)
    next(images).save(file, "WEBP", save_all=True, append_images=images, duration=round(1000 / fps), method=0)


def _write_mp4(pictures: Iterator[np.ndarray], shape: tuple[int, ...], file: Path, fps: int) -> None:
    imageio_ffmpeg = importlib.import_module("imageio_ffmpeg")
    options = ["-f", "mp4"]  # which the name of the unfinished file does not say
    writer = imageio_ffmpeg.write_frames(file, (shape[1], shape[0]), fps=fps, output_params=options)
    writer.send(None)
    try:
        for picture in pictures:
            writer.send(np.ascontiguousarray(picture))
    finally:
        writer.close()


_WRITERS = {  # module, package and writer of each kind of film
    ".webp": ("PIL", "pillow", _write_webp),
    ".mp4": ("imageio_ffmpeg", "imageio-ffmpeg", _write_mp4),
}


class _Canvas:
    """A picture while it is being drawn; points are slope-frame metres."""

    def __init__(self, size: tuple[int, int], camera: Camera):
        import pygame

        self.size = size
        self.camera = camera
        self.surface = pygame.Surface((_SHARPNESS * camera.width, _SHARPNESS * camera.height), 0, 32)
        self.surface.fill(SKY)
        self.labels: list[tuple[str, float, float]] = []  # text, column and row [px] of its middle
        self.notes: tuple[str, ...] = ()

    def points(self, points: np.ndarray) -> list[tuple[float, float]]:
        """Project points onto the enlarged surface; those far outside are pulled in, as pygame counts in C ints."""
        middle = 0.5 * np.array([self.camera.width, self.camera.height])
        offset = self.camera.pixels(points) - middle
        distance = np.maximum(np.hypot(*offset.T), 1.0)
        pixels = _SHARPNESS * (middle + offset * np.minimum(1.0, _FAR / distance)[:, None])
        return [(x, y) for x, y in pixels.tolist()]

    def line(self, points: np.ndarray, colour: Colour, width: float) -> None:
        import pygame

        if len(points) > 1:
            pygame.draw.lines(self.surface, colour, False, self.points(points), max(1, round(_SHARPNESS * width)))

    def dot(self, x: float, y: float, colour: Colour, radius: float) -> None:
        import pygame

        pygame.draw.circle(self.surface, colour, self.points(np.array([(x, y)]))[0], _SHARPNESS * radius)

    def slope(self, slope: Slope, size: float) -> None:
        """Draw the ground, a mark every so many metres and the finish; ``size`` [m] is that of the sled."""
        import pygame

        camera = self.camera
        left, right = self.sight()
        half = 0.5 * (right - left)
        ground = np.array(
            [(left, 0.0), (right, 0.0), (right, -2.0 * half - abs(camera.y)), (left, -2.0 * half - abs(camera.y))]
        )
        pygame.draw.polygon(self.surface, SNOW, self.points(ground))
        step = self.mark_step()
        first = math.ceil(left / step)
        tick = 7.0 / camera.scale
        for i in range(first, first + math.ceil(2.0 * half / step)):
            self.line(np.array([(i * step, 0.0), (i * step, -tick)]), SURFACE, 1.0)
            column, row = camera.pixels(np.array([i * step, -3.4 * tick])).tolist()
            if 25.0 < column < camera.width - 25.0 and 0.0 < row < camera.height:
                self.labels.append((f"{i * step:g} m", column, row))
        self.line(ground[:2], SURFACE, 2.0)
        if math.isfinite(slope.length):
            for i in range(8):  # a chequered post
                post = np.array([(slope.length, 0.5 * size * i), (slope.length, 0.5 * size * (i + 1))])
                self.line(post, INK if i % 2 == 0 else SNOW, 4.0)

    def path(self, points: np.ndarray) -> None:
        """Draw the path of the mass centre."""
        self.line(points, PATH, 1.5)

    def contacts(self, spans: np.ndarray) -> None:
        """Mark where the sled touched, from touchdown to separation."""
        import pygame

        wide, high = 5.0 / self.camera.scale, 9.0 / self.camera.scale
        left, right = self.sight()
        for begin, end in np.clip(spans, left, right).tolist():
            self.line(np.array([(begin, 0.0), (end, 0.0)]), CONTACT, 4.0)
            mark = np.array([(begin, 0.0), (begin - wide, -high), (begin + wide, -high)])
            pygame.draw.polygon(self.surface, CONTACT, self.points(mark))

    def cone(self, place: float, friction: float) -> None:
        """Draw the friction cone over the contact point, to be half covered by the sled."""
        import pygame

        foot, edges = self.cone_edges(place, friction)
        pygame.draw.polygon(self.surface, CONE, self.points(np.array([foot, *edges])))
        column, row = self.camera.pixels(foot + 1.06 * (edges.mean(axis=0) - foot)).tolist()
        self.labels.append(("friction cone", column, row))

    def cone_edges(self, place: float, friction: float) -> tuple[np.ndarray, np.ndarray]:
        """Return apex and ends of the two edges of the friction cone, shapes (2,) and (2, 2)."""
        foot = np.array([place, 0.0])
        height = _CONE_HEIGHT * self.camera.height / self.camera.scale
        return foot, foot + height * np.array([(-friction, 1.0), (friction, 1.0)]) / math.hypot(1.0, friction)

    def push(self, push: Push, friction: float, size: float) -> None:
        """Draw the force as an arrow from the contact point, and over the sled the edges of the cone that holds it.

        A sled of small ``size`` [m] gets a fine arrow, under which it stays visible.
        """
        import pygame

        foot, edges = self.cone_edges(push.place, friction)
        length = _CONE_HEIGHT * self.camera.height / self.camera.scale
        broad = min(3.0, 0.1 * size * self.camera.scale)
        for edge in edges:
            self.line(np.array([foot, edge]), INK, 0.5)
        if push.largest > 0.0:
            tip = foot + length * np.array([push.tangential, push.normal]) / push.largest
            self.line(np.array([foot, tip]), FORCE, broad)
            along = tip - foot
            long = float(np.hypot(*along))
            if long > 0.0:
                along = along / long * min(3.5 * broad / self.camera.scale, long)
                across = 0.45 * np.array([-along[1], along[0]])
                head = np.array([tip + 0.4 * along, tip - along + across, tip - along - across])
                pygame.draw.polygon(self.surface, FORCE, self.points(head))
        self.dot(push.place, 0.0, FORCE, broad)

    def note(self, *lines: str) -> None:
        """Write lines in the upper right corner, where the slope leaves room."""
        self.notes = lines

    def sled(self, body: Body, state: State, strength: float) -> None:
        """Draw the sled; ``strength`` in [0, 1] fades it into the sky."""
        import pygame

        x, y, phi = state.x, state.y, state.phi
        ink = _mix(INK, strength)
        for outline, colour in ((body_outline, SHELL), (heavy_side, HEAVY)):
            if body.radius > 0.0:
                pygame.draw.polygon(self.surface, _mix(colour, strength), self.points(outline(body, x, y, phi)))
        self.line(body_outline(body, x, y, phi), ink, 1.5)
        self.line(spoke(body, x, y, phi), ink, 1.5)
        self.dot(x, y, ink, 3.0)

    def picture(self, numbers: dict[str, str]) -> np.ndarray:
        """Smooth what was drawn, write the labels and the panel of numbers; uint8, shape (height, width, 3)."""
        import pygame

        width, height = self.size
        screen = pygame.Surface(self.size, 0, 32)
        screen.fill(SNOW)
        screen.blit(pygame.transform.smoothscale(self.surface, (self.camera.width, self.camera.height)), (0, 0))
        panel = _panel_height(self.size)
        top, cell = height - panel, width / len(numbers)
        small = max(5, round(min(0.34 * panel, 0.14 * cell)))
        pygame.font.init()
        font = pygame.font.Font(None, small)
        for label, column, row in self.labels:
            _write(screen, font, label, PALE, column, row)
        pygame.draw.rect(screen, SNOW, (0, top, width, panel))
        pygame.draw.line(screen, SURFACE, (0, top), (width, top))
        large = pygame.font.Font(None, round(1.35 * small))
        for i, (line, style) in enumerate(zip(self.notes, (large, font, font), strict=False)):
            image = style.render(line, True, FORCE if i == 0 else INK)
            screen.blit(image, image.get_rect(topright=(width - small, round((0.8 + 1.4 * i) * small))))
        for i, (name, value) in enumerate(numbers.items()):
            _write(screen, font, name, PALE, (i + 0.5) * cell, top + 0.3 * panel)
            _write(screen, large, value, INK, (i + 0.5) * cell, top + 0.7 * panel)
        flat = np.frombuffer(pygame.image.tobytes(screen, "RGB"), np.uint8)
        return flat.reshape(height, width, 3).copy()

    def sight(self) -> tuple[float, float]:
        """Part of the slope [m] outside which nothing can be seen."""
        half = math.hypot(self.camera.width, self.camera.height) / self.camera.scale
        return self.camera.x - half, self.camera.x + half

    def mark_step(self) -> float:
        """Distance [m] between two marks: 1, 2 or 5 times a power of ten, at least 80 px."""
        least = 80.0 / self.camera.scale
        power = 10.0 ** math.floor(math.log10(least))
        return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= least)


def _panel_height(size: tuple[int, int]) -> int:
    return round(_PANEL * size[1])


def _mix(colour: Colour, strength: float) -> Colour:
    red, green, blue = (round(sky + strength * (own - sky)) for own, sky in zip(colour, SKY, strict=True))
    return red, green, blue


def _write(
    screen: pygame.Surface, font: pygame.font.Font, text: str, colour: Colour, column: float, row: float
) -> None:
    image = font.render(text, True, colour)
    screen.blit(image, image.get_rect(center=(round(column), round(row))))


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


def _push_words(descent: Descent, push: Push) -> tuple[str, ...]:
    """How the contact will end, what it does now and with which force."""
    name = f"contact {push.number + 1}, {feature_name(push.feature)}: "
    available = descent.law.friction * push.normal
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
