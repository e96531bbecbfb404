"""A picture while it is being drawn: slope, path, contacts, forces and sled, on a surface of pygame in memory."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sledenv.plot.grounds import LINE, bands, below, in_sight, surface
from sledenv.plot.riders import HULL, TOUCHED, pieces
from sledenv.plot.shapes import Push, body_outline, heavy_side, placed, spoke, to_world
from sledenv.simulation.bodies import Body
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
_BAND, _MARKS, _WORDS = 13.0, 10.8, 37.0  # [px] depth of a zone below the surface; of marks' and its words below it
_LETTER = 6.5  # [px] width
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


class Canvas:
    """A picture while it is being drawn; points are slope-frame metres."""

    def __init__(self, size: tuple[int, int], camera: Camera, slope: Slope):
        import pygame

        self.size = size
        self.camera = camera
        self.slope = slope
        self.line_of_ground = surface(slope.vertices, *self.sight())
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
        """Draw a line through points; ``width`` [px] is that in the picture."""
        import pygame

        if len(points) > 1:
            pygame.draw.lines(self.surface, colour, False, self.points(points), max(1, round(_SHARPNESS * width)))

    def dot(self, x: float, y: float, colour: Colour, radius: float) -> None:
        """Draw a disc; ``radius`` [px] is that in the picture."""
        import pygame

        pygame.draw.circle(self.surface, colour, self.points(np.array([(x, y)]))[0], _SHARPNESS * radius)

    def ground(self, friction: float, size: float) -> None:
        """Draw the ground, a mark every so many metres, the finish and zones, which are bands below the surface.

        ``friction`` [-] is that of the ground around the zones, ``size`` [m] that of the sled.
        """
        import pygame

        camera, slope, line = self.camera, self.slope, self.line_of_ground
        left, right = self.sight()
        deep = min(camera.y, float(line[:, 1].min())) - (right - left)
        ground = np.concatenate([line, [(right, deep), (left, deep)]])
        pygame.draw.polygon(self.surface, SNOW, self.points(ground))
        step = self.mark_step()
        tick = 7.0 / camera.scale
        for i in range(math.ceil(left / step), math.ceil(right / step)):
            foot = np.array([i * step, np.interp(i * step, *line.T)])
            self.line(np.array([foot, foot - (0.0, tick)]), SURFACE, 1.0)
            self._write_below(f"{i * step:g} m", i * step, _MARKS)
        self.line(line, SURFACE, 2.0)
        if math.isfinite(slope.length):
            base = slope.height_at(slope.length)
            for i in range(8):  # a chequered post
                post = np.array([(slope.length, base + 0.5 * size * k) for k in (i, i + 1)])
                self.line(post, INK if i % 2 == 0 else SNOW, 4.0)
        for band in bands(slope, friction, left, right):
            corners = band.outline(line, _BAND / camera.scale)
            pygame.draw.polygon(self.surface, _rgb(band.colour), self.points(corners))
            self.line(np.concatenate([corners, corners[:1]]), _rgb(LINE), 1.0)
        # Words stand in the middle of what can be seen of a zone.
        picture = np.array([camera.width, camera.height])
        left, right = in_sight(line, camera.pixels(line), 0.0 * picture, picture)
        for band in bands(slope, friction, left, min(right, slope.length)):
            said = band.label((band.end - band.begin) * camera.scale / _LETTER)
            self._write_below(said, 0.5 * (band.begin + band.end), _WORDS)

    def _write_below(self, text: str, x: float, depth: float) -> None:
        """Write a text so far [px] below the bands of the ground that is over it, around a place [m], if in sight."""
        camera = self.camera
        band, half = _BAND / camera.scale, (0.5 * _LETTER * len(text) + _BAND) / camera.scale
        low = float(below(surface(self.line_of_ground, x - half, x + half), band)[:, 1].min())
        column, row = camera.pixels(np.array([x, low - depth / camera.scale])).tolist()
        if text and 25.0 < column < camera.width - 25.0 and 0.0 < row < camera.height:
            self.labels.append((text, column, row))

    def path(self, points: np.ndarray) -> None:
        """Draw the path of the mass centre."""
        self.line(points, PATH, 1.5)

    def contacts(self, paths: list[np.ndarray]) -> None:
        """Mark where the sled touched, from touchdown to separation: each a path, shape (n, 2), NaN where it jumps."""
        import pygame

        wide, high = 5.0 / self.camera.scale, 9.0 / self.camera.scale
        left, right = self.sight()
        for path in paths:
            seen = np.stack([np.clip(path[:, 0], left, right), path[:, 1]], axis=-1)
            for part in np.split(seen, np.flatnonzero(np.isnan(path[:, 0]))):
                self.line(part[~np.isnan(part[:, 0])], CONTACT, 4.0)
            mark = seen[0] + np.array([(0.0, 0.0), (-wide, -high), (wide, -high)])
            pygame.draw.polygon(self.surface, CONTACT, self.points(mark))

    def cones(self, push: Push, frictions: np.ndarray) -> None:
        """Draw the friction cone over each contact, to be half covered by the sled; ``frictions``: of each [-]."""
        import pygame

        for touch, friction in zip(push.touches[::-1], frictions[::-1].tolist(), strict=True):
            foot, edges = self.cone_edges(touch, friction)
            pygame.draw.polygon(self.surface, CONE, self.points(np.array([foot, *edges])))
        column, row = self.camera.pixels(foot + 1.06 * (edges.mean(axis=0) - foot)).tolist()
        self.labels.append(("friction cone", column, row))

    def cone_edges(self, touch: np.void, friction: float) -> tuple[np.ndarray, np.ndarray]:
        """Return apex and ends of the two edges of the friction cone of a contact, shapes (2,) and (2, 2)."""
        height = _CONE_HEIGHT * self.camera.height / self.camera.scale
        foot, normal, tangent = _axes(touch)
        sides = np.array([normal - friction * tangent, normal + friction * tangent])
        return foot, foot + height * sides / math.hypot(1.0, friction)

    def push(self, push: Push, frictions: np.ndarray, size: float) -> None:
        """Draw the force of each contact as an arrow from its place, and over the sled the edges of its friction cone.

        A sled of small ``size`` [m] gets a fine arrow, under which it stays visible.
        """
        import pygame

        length = _CONE_HEIGHT * self.camera.height / self.camera.scale
        broad = min(3.0, 0.1 * size * self.camera.scale)
        for touch, friction in zip(push.touches, frictions.tolist(), strict=True):
            foot, edges = self.cone_edges(touch, friction)
            for edge in edges:
                self.line(np.array([foot, edge]), INK, 0.5)
            if push.largest > 0.0:
                _, normal, tangent = _axes(touch)
                along = length * (touch["normal"] * normal + touch["tangential"] * tangent) / push.largest
                tip, long = foot + along, float(np.hypot(*along))
                self.line(np.array([foot, tip]), FORCE, broad)
                if long > 0.0:
                    along = along / long * min(3.5 * broad / self.camera.scale, long)
                    across = 0.45 * np.array([-along[1], along[0]])
                    head = np.array([tip + 0.4 * along, tip - along + across, tip - along - across])
                    pygame.draw.polygon(self.surface, FORCE, self.points(head))
            self.dot(touch["x"], touch["y"], FORCE, broad)

    def note(self, *lines: str) -> None:
        """Write lines in the upper right corner, where the slope leaves room."""
        self.notes = lines

    def sled(self, body: Body, state: State, strength: float, touching: Collection[int] = ()) -> None:
        """Draw the sled; ``strength`` in [0, 1] fades it into the sky, ``touching`` are codes of parts that touch."""
        import pygame

        x, y, phi = state.x, state.y, state.phi
        ink = _mix(INK, strength)
        if pieces(body):
            self._rider(body, state, strength, touching)
            return
        for outline, colour in ((body_outline, SHELL), (heavy_side, HEAVY)):
            points = self.points(outline(body, x, y, phi))
            if body.size > 0.0 and len(points) > 2:
                pygame.draw.polygon(self.surface, _mix(colour, strength), points)
        self.line(body_outline(body, x, y, phi), ink, 1.5)
        self.line(spoke(body, x, y, phi), ink, 1.5)
        self.dot(x, y, ink, 3.0)

    def _rider(self, body: Body, state: State, strength: float, touching: Collection[int]) -> None:
        """Draw a sled and its rider, who lies on it."""
        import pygame

        place, ink = (state.x, state.y, state.phi), _mix(INK, strength)
        whole = body_outline(body, *place)
        pygame.draw.polygon(self.surface, _mix(_rgb(HULL), strength), self.points(whole))
        self.line(whole, _mix(PALE, strength), 1.0)
        touched = {body.parts[code - 1] for code in touching}
        for piece in pieces(body):
            outline = placed(piece.points, *place)
            colour = _rgb(TOUCHED if piece.part in touched else piece.colour)
            pygame.draw.polygon(self.surface, _mix(colour, strength), self.points(outline))
            self.line(outline, ink, 0.8)
        self.line(spoke(body, *place), ink, 1.5)
        self.dot(state.x, state.y, ink, 3.0)

    def picture(self, numbers: dict[str, str]) -> np.ndarray:
        """Smooth what was drawn, write the labels and the panel of numbers; uint8, shape (height, width, 3)."""
        import pygame

        width, height = self.size
        screen = pygame.Surface(self.size, 0, 32)
        screen.fill(SNOW)
        screen.blit(pygame.transform.smoothscale(self.surface, (self.camera.width, self.camera.height)), (0, 0))
        panel = panel_height(self.size)
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


def panel_height(size: tuple[int, int]) -> int:
    """Return the height [px] of the panel with the numbers in a picture of this size [px]."""
    return round(_PANEL * size[1])


def _rgb(colour: str) -> Colour:
    """Red, green and blue of "#rrggbb"."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue


def _mix(colour: Colour, strength: float) -> Colour:
    red, green, blue = (round(sky + strength * (own - sky)) for own, sky in zip(colour, SKY, strict=True))
    return red, green, blue


def _axes(touch: np.void) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return place [m], unit normal and unit tangent of a contact, slope frame, shape (2,) each."""
    normal = np.array([touch["normal_x"], touch["normal_y"]])
    return np.array([touch["x"], touch["y"]]), normal, np.array([normal[1], -normal[0]])


def _write(
    screen: pygame.Surface, font: pygame.font.Font, text: str, colour: Colour, column: float, row: float
) -> None:
    image = font.render(text, True, colour)
    screen.blit(image, image.get_rect(center=(round(column), round(row))))
