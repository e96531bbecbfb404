"""A picture while it is being drawn: slope, path and sled, on a surface of pygame in memory."""

from __future__ import annotations

import math
import os
from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from sledenv.machine.extras import needs
from sledenv.plot.grounds import LINE, bands, surface
from sledenv.plot.riders import HULL, TOUCHED, pieces
from sledenv.plot.shapes import body_outline, heavy_side, placed, spoke, to_world
from sledenv.simulation.bodies import Body
from sledenv.simulation.scene import Slope, State

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
with needs("render", __name__):
    import pygame

Size = tuple[int, int]

SKY = "#eef3f8"
SNOW = "#fcfdff"
SURFACE = "#788a9c"
INK = "#2d343c"
PALE = "#626e7a"
PATH = "#0072b2"
CONTACT = "#009e73"
SHELL = "#f6c7a3"
HEAVY = "#d55e00"

_SHARPNESS = 2  # shapes are drawn this many times larger and smoothed down
_PANEL = 0.13  # of the height: the panel with the numbers, below the picture
_BAND, _MARKS, _WORDS = 13.0, 26.0, 44.0  # [px] depth of a zone below the surface, of the words of marks, and its own
_LETTER = 6.5  # [px] width
_FAR = 20_000.0  # [px]


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

    def __init__(self, size: Size, camera: Camera, slope: Slope):
        self.size = size
        self.camera = camera
        self.slope = slope
        half = math.hypot(camera.width, camera.height) / camera.scale  # outside of which nothing can be seen
        self.line_of_ground = surface(slope.vertices, camera.x - half, camera.x + half)
        self.surface = pygame.Surface((_SHARPNESS * camera.width, _SHARPNESS * camera.height), 0, 32)
        self.surface.fill(SKY)
        self.labels: list[tuple[str, float, float]] = []  # text, column and row [px] of its middle

    def points(self, points: np.ndarray) -> list[tuple[float, float]]:
        """Project points onto the enlarged surface; those far outside are pulled in, as pygame counts in C ints."""
        pixels = _SHARPNESS * np.clip(self.camera.pixels(points), -_FAR, _FAR)
        return [(x, y) for x, y in pixels.tolist()]

    def line(self, points: np.ndarray, colour: str, width: float) -> None:
        """Draw a line through points; ``width`` [px] is that in the picture."""
        if len(points) > 1:
            pygame.draw.lines(self.surface, colour, False, self.points(points), max(1, round(_SHARPNESS * width)))

    def fill(self, points: np.ndarray, colour: str) -> None:
        """Fill a polygon."""
        if len(points) > 2:
            pygame.draw.polygon(self.surface, colour, self.points(points))

    def dots(self, points: np.ndarray, colour: str, radius: float) -> None:
        """Draw discs; ``radius`` [px] is that in the picture."""
        for point in self.points(points):
            pygame.draw.circle(self.surface, colour, point, _SHARPNESS * radius)

    def ground(self, friction: float, size: float) -> None:
        """Draw the ground, a mark every so many metres, the finish and zones, which are bands below the surface.

        ``friction`` [-] is that of the ground around the zones, ``size`` [m] the length of the sled.
        """
        slope, line, pixel = self.slope, self.line_of_ground, 1.0 / self.camera.scale
        (left, _), (right, _) = line[[0, -1]]
        deep = float(line[:, 1].min()) - (right - left)
        self.fill(np.concatenate([line, [(right, deep), (left, deep)]]), SNOW)
        step = _mark_step(pixel)
        marks = step * np.arange(math.ceil(left / step), math.ceil(right / step))
        for x, y in zip(marks.tolist(), slope.height_at(marks).tolist(), strict=True):
            self.line(np.array([(x, y), (x, y - 7.0 * pixel)]), SURFACE, 1.0)
            self._write(f"{x:g} m", (x, y), _MARKS)
        self.line(line, SURFACE, 2.0)
        for i in range(8 if math.isfinite(slope.length) else 0):  # a chequered post
            foot = np.array([slope.length, slope.height_at(slope.length)])
            post = foot + np.array([(0.0, 0.25 * size * k) for k in (i, i + 1)])
            self.line(post, INK if i % 2 == 0 else SNOW, 4.0)
        for band in bands(slope, friction, left, right):
            corners = band.outline(line, _BAND * pixel)
            self.fill(corners, band.colour)
            self.line(np.concatenate([corners, corners[:1]]), LINE, 1.0)
        half = 0.5 * self.camera.width * pixel
        for band in bands(slope, friction, self.camera.x - half, min(self.camera.x + half, slope.length)):
            x = 0.5 * (band.begin + band.end)
            label = band.label((band.end - band.begin) / (_LETTER * pixel))
            self._write(label, (x, float(slope.height_at(x))), _WORDS)

    def _write(self, text: str, place: tuple[float, float], depth: float) -> None:
        """Write a text so far [px] below a place."""
        column, row = self.camera.pixels(np.array(place)).tolist()
        self.labels.append((text, column, row + depth))

    def sled(self, body: Body, state: State, touching: Collection[int]) -> None:
        """Draw the sled; ``touching`` are codes of parts that touch."""
        place = state.x, state.y, state.phi
        whole, touched = body_outline(body, *place), {body.parts[code - 1] for code in touching}
        if pieces(body):
            shapes = [(whole, HULL, PALE)]
            for piece in pieces(body):
                colour = TOUCHED if piece.part in touched else piece.colour
                shapes.append((placed(piece.points, *place), colour, INK))
        else:
            shapes = [(whole, SHELL, INK), (heavy_side(body, *place), HEAVY, INK)] if body.size > 0.0 else []
        for outline, colour, edge in shapes:
            self.fill(outline, colour)
            self.line(outline, edge, 1.0)
        self.line(spoke(body, *place), INK, 1.5)
        self.dots(np.array([place[:2]]), INK, 3.0)

    def picture(self, numbers: dict[str, str]) -> np.ndarray:
        """Smooth what was drawn, write the labels and the panel of numbers; uint8, shape (height, width, 3)."""
        width, height = self.size
        screen = pygame.Surface(self.size, 0, 32)
        screen.fill(SNOW)
        screen.blit(pygame.transform.smoothscale(self.surface, (self.camera.width, self.camera.height)), (0, 0))
        top, cell = self.camera.height, width / len(numbers)
        panel = height - top
        small = max(5, round(min(0.36 * panel, 0.14 * cell)))
        pygame.font.init()
        font, large = pygame.font.Font(None, small), pygame.font.Font(None, round(1.35 * small))

        def write(font: pygame.font.Font, text: str, colour: str, column: float, row: float) -> None:
            image = font.render(text, True, colour)
            screen.blit(image, image.get_rect(center=(round(column), round(row))))

        for label, column, row in self.labels:
            write(font, label, PALE, column, row)
        pygame.draw.rect(screen, SNOW, (0, top, width, panel))
        pygame.draw.line(screen, SURFACE, (0, top), (width, top))
        for i, (name, value) in enumerate(numbers.items()):
            write(font, name, PALE, (i + 0.5) * cell, top + 0.3 * panel)
            write(large, value, INK, (i + 0.5) * cell, top + 0.7 * panel)
        flat = np.frombuffer(pygame.image.tobytes(screen, "RGB"), np.uint8)
        return flat.reshape(height, width, 3).copy()


def picture_height(size: Size) -> int:
    """Return the height [px] of a picture of this size without the panel with the numbers."""
    return size[1] - round(_PANEL * size[1])


def _mark_step(pixel: float) -> float:
    """Return the distance [m] between two marks: 1, 2 or 5 times a power of ten, at least 80 pixels [m]."""
    least = 80.0 * pixel
    power = 10.0 ** math.floor(math.log10(least))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= least)
