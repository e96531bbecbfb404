"""Recorded poses of one body over time, and their noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view

from sledenv.identification.fitting import Floats
from sledenv.identification.tables import columns, numbered, numbers, place, recorded_names
from sledenv.pages.columns import TRAJECTORY_COLUMNS

TIME: Final = TRAJECTORY_COLUMNS["t"]
POSE: Final = tuple(TRAJECTORY_COLUMNS[name] for name in ("x", "y", "phi"))
FEWEST: Final = 8  # frames of a recording
_NORMAL = 0.6745  # median of the size of a normal error, in standard deviations
_FLOOR = 1e-6  # least noise, of the size of the body and [rad]: about the precision of a single float


class Noise(NamedTuple):
    """Standard deviations of recorded poses."""

    position: float  # [m] of x and of y
    angle: float  # [rad]


@dataclass(frozen=True)
class Recording:
    """Poses of one body over time.

    Attributes
    ----------
    name : str
    times : ndarray, shape (n,)
        [s], increasing.
    poses : ndarray, shape (n, 3)
        x, y of the mass centre [m] and phi [rad], which may be less whole turns.
    noise : Noise
    """

    name: str
    times: Floats
    poses: Floats
    noise: Noise

    def residuals(self, poses: Floats) -> Floats:
        """Differences of the recorded poses from those, shape (m, 3), of the first m frames, in noise levels."""
        apart = self.poses[: len(poses)] - poses
        apart[:, 2] = np.remainder(apart[:, 2] + math.pi, 2.0 * math.pi) - math.pi
        levels: Floats = apart / np.array([self.noise.position, self.noise.position, self.noise.angle])
        return levels

    def until(self, time: float) -> int:
        """Return the number of frames before a time [s]."""
        return int(np.searchsorted(self.times, time))


def recordings_of(table: pd.DataFrame, size: float, noise: Noise | None = None) -> list[Recording]:
    """Check a table and return its recordings.

    Parameters
    ----------
    table
        As for :func:`sledenv.identification.tracks.identify_tracks`.
    size : float
        Of the body [m]: noise below a millionth of it counts as that much.
    noise : Noise, optional
        Estimated for each recording by default.
    """
    table = numbered(table)
    names = recorded_names(table)
    if names is None:
        return [_recording("0", table, size, noise)]
    return [_recording(str(name), rows, size, noise) for name, rows in table.groupby(names, sort=False)]


def _recording(name: str, table: pd.DataFrame, size: float, noise: Noise | None) -> Recording:
    times = columns(table, (TIME,))[:, 0]
    poses = np.stack([numbers(table, column) for column in POSE], axis=-1)
    # A simulated trajectory has the same pose twice, but for rounding, where forces jump.
    alike = np.abs(np.diff(poses, axis=0)) <= np.array([_FLOOR * size, _FLOOR * size, _FLOOR])
    once = np.ones(len(times), bool)
    once[1:] = (np.diff(times) != 0.0) | ~alike.all(axis=1)
    times, poses, table = times[once], poses[once], table[once]
    if (np.diff(times) <= 0.0).any():
        row = int(np.argmax(np.diff(times) <= 0.0)) + 1
        raise ValueError(f"{TIME}, {place(table, row)}: is {times[row]:g}, must increase within a recording")
    seen = np.isfinite(poses).all(axis=1)
    if seen.sum() < FEWEST:
        raise ValueError(f"recording {name!r}: {seen.sum()} frames with a pose: must be at least {FEWEST}")
    times, poses = times[seen], poses[seen]
    position, angle = _noise(times, poses) if noise is None else noise
    return Recording(name, times, poses, Noise(max(position, _FLOOR * size), max(angle, _FLOOR)))


def _noise(times: Floats, poses: Floats) -> Noise:
    """Estimate the noise from four poses in a row, of which the third divided difference holds no parabola.

    Divided by the length of its coefficients it has the standard deviation of a pose, however frames are spaced.
    """
    four = sliding_window_view(times, 4)
    apart = four[:, :, np.newaxis] - four[:, np.newaxis, :] + np.eye(4)
    apart /= np.abs(apart).max(axis=(1, 2), keepdims=True)  # or the products below could overflow
    weights = 1.0 / apart.prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    turned = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    sizes = np.abs(np.einsum("ni,nki->nk", weights, sliding_window_view(turned, 4, axis=0)))
    position, angle = (float(np.median(part)) / _NORMAL for part in (sizes[:, :2], sizes[:, 2]))
    return Noise(position, angle)
