"""Pictures of a descent, drawn with pygame in memory. They depend on their arguments alone."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from sledenv.envs.canvas import CONTACT, PATH, Camera, Canvas, Size, picture_height
from sledenv.plot.shapes import body_outline
from sledenv.simulation.bodies import Body
from sledenv.simulation.interpolation import drawable_rows, states_at, touches_at
from sledenv.simulation.jam import SHARE_OF_PROGRESS
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.records import Status
from sledenv.simulation.scene import State

SIZE: Final = (960, 540)  # [px]
_SMALLEST = (160, 90)  # [px]
_WIDE = 7.0  # lengths of the body are the width of a picture
_LAST = 1.0  # [s] that a film stays at the end of a descent
_PLACES = 65  # of which the camera takes the mean height


def draw_frame(descent: Descent, time: float, size: Size = SIZE) -> np.ndarray:
    """Draw the sled at one time of a descent; the camera follows it.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.
    time : float
        Since the launch [s]; clipped to the duration of the descent, whose outcome is told from its end on.
    size : tuple of int
        Width and height of the picture [px], at least 160 x 90.

    Returns
    -------
    ndarray of uint8, shape (height, width, 3)

    Raises
    ------
    ValueError
        If the descent has no trajectory, or the picture would be too small.
    """
    if size[0] < _SMALLEST[0] or size[1] < _SMALLEST[1]:
        raise ValueError(f"size = {size!r}: must be at least {_SMALLEST[0]} x {_SMALLEST[1]} px")
    rows = drawable_rows(descent)
    now = min(max(time, 0.0), descent.time)
    state = State.found(states_at(rows, [now])[0].tolist())
    canvas = Canvas(size, camera_at(descent, state, size), descent.slope)
    canvas.ground(descent.law.friction, _length(descent.body))
    past = rows[rows["t"] <= now]
    canvas.line(np.append(np.stack([past["x"], past["y"]], axis=-1), [state[:2]], axis=0), PATH, 1.5)
    touched = descent.rebounds["x_contact"][descent.rebounds["t_touchdown"] <= now]
    canvas.dots(np.stack([touched, descent.slope.height_at(touched)], axis=-1), CONTACT, 3.5)
    canvas.sled(descent.body, state, touches_at(rows, now)["part"].tolist())
    return canvas.picture(_numbers(descent, now, state))


def draw_film(descent: Descent, *, after: float = -1.0, fps: float = 30.0, size: Size = SIZE) -> Iterator[np.ndarray]:
    """Draw a film of a descent at its own rate; the last picture, which tells the outcome, stays for a second.

    Parameters
    ----------
    descent : Descent
        Simulated with ``record="trajectory"``.
    after : float
        Leave out what had been shown when the descent was at this time [s]: the films of successive flights are that of
        the whole.
    fps : float
        Pictures per second, > 0.
    size : tuple of int
        As for :func:`draw_frame`.

    Yields
    ------
    ndarray of uint8, shape (height, width, 3)
    """
    first = math.floor(after * fps) + 1 if after >= 0.0 else 0
    for i in range(first, math.floor(descent.time * fps) + 1):
        yield draw_frame(descent, i / fps, size)
    if descent.status != Status.RUNNING and after < descent.time:
        last = draw_frame(descent, descent.time, size)
        for _ in range(max(1, round(_LAST * fps))):
            yield last


def camera_at(descent: Descent, state: State, size: Size = SIZE) -> Camera:
    """Return the camera that follows the body: it is in the middle, and the ground stays in sight while it is low."""
    slope, width, height = descent.slope, size[0], picture_height(size)
    scale = width / (_WIDE * _length(descent.body))
    # Of the ground it is the mean height, so that the camera moves gently.
    ahead = np.linspace(-0.5, 0.5, _PLACES) * width / scale
    ground, low = float(slope.height_at(state.x + ahead).mean()), 0.3 * height / scale
    return Camera(state.x, max(min(state.y, ground + low), state.y - low), slope.angle, scale, width, height)


def _length(body: Body) -> float:
    """Return the length [m] of a body as it lies at phi = 0, or its height if that is more; a point mass has none."""
    return max(float(np.ptp(body_outline(body, 0.0, 0.0, 0.0), axis=0).max()), 1e-6)


def _number(value: float, unit: str) -> str:
    if not math.isfinite(value):
        return "-"
    return f"{value:z.2f}{unit}" if abs(value) < 1e4 else f"{value:.1e}{unit}"


def _numbers(descent: Descent, time: float, state: State) -> dict[str, str]:
    """Return the words of the panel at ``time`` [s]: the motion, what has been earned and, at the end, the outcome."""
    over = time >= descent.time and descent.status != Status.RUNNING
    progress = min(max(state.x / descent.slope.length, 0.0), 1.0)
    earned = float(descent.jam.reward) if over else SHARE_OF_PROGRESS * progress
    return {
        "time": _number(time, " s"),
        "position": _number(state.x, " m"),
        "speed": _number(math.hypot(state.u, state.v), " m/s"),
        "spin": _number(state.omega, " rad/s"),
        "reward so far": _number(earned, ""),
        "status": str(descent.status) if over else "under way",
    }
