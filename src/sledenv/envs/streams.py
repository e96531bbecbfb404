"""Random streams of many lanes, of which no lane depends on its neighbours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

_BLOCK = 16  # contexts that a lane draws ahead: one call of its generator costs as much as several of them

Floats = NDArray[np.float64]
Lanes = NDArray[np.intp]  # numbers of lanes


class Streams:
    """One random stream a lane, each that of a scalar environment with the same seed.

    A generator gives the same doubles whether it is asked for them once or in portions, so lanes draw ahead in blocks.

    Parameters
    ----------
    lanes : int
        Number of streams.
    draws : int
        Doubles that an episode takes.
    """

    def __init__(self, lanes: int, draws: int) -> None:
        self.generators: list[np.random.Generator | None] = [None] * lanes
        self.seeds: list[int | None] = [None] * lanes
        self._block = np.empty((lanes, _BLOCK, draws))
        self._next = np.full(lanes, _BLOCK)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of streams, and of the doubles that an episode takes."""
        lanes, _, draws = self._block.shape
        return lanes, draws

    def seed(self, lanes: Lanes, seeds: Sequence[int | None]) -> None:
        """Start streams anew where there is a seed, and from fresh entropy where there was none before."""
        pairs = zip(lanes.tolist(), seeds, strict=True)
        fresh = [(i, seeding.np_random(s)) for i, s in pairs if s is not None or self.generators[i] is None]
        for i, (generator, seed) in fresh:
            self.generators[i], self.seeds[i] = generator, seed
            self._next[i] = _BLOCK

    def take(self, lanes: Lanes) -> Floats:
        """Return the doubles of the next episode of each lane, shape (len(lanes), draws)."""
        for i in lanes[self._next[lanes] == _BLOCK].tolist():
            generator = self.generators[i]
            assert generator is not None  # seeded before
            generator.random(out=self._block[i])
            self._next[i] = 0
        taken: Floats = self._block[lanes, self._next[lanes]]
        self._next[lanes] += 1
        return taken
