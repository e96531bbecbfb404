"""A ride that is told by its trims is the ride of the agent that chose them, with its trajectory."""

from __future__ import annotations

import numpy as np
import pytest

from sledenv.benchmark.problem import Problem


class Swinging:
    """Trims to and fro, by what is left of the way."""

    def act(self, observations):
        return np.sin(40.0 * observations[:, 11:12])


@pytest.mark.parametrize("scenario", ["sled_rollers", "sled_kickers"])
def test_a_ride_is_repeated_from_its_trims(scenario):
    """Oracle: the batch of all rides, bit for bit."""
    problem = Problem(scenario, "descent")
    scenes = problem.trials(problem.contexts("test", 4), "test")[:, 0]
    batch, trims = problem.ride(Swinging(), scenes)
    for i in range(len(scenes)):
        made = trims[i][~np.isnan(trims[i])].tolist()
        descent = problem.task.ridden(problem.task.scenes(scenes[i : i + 1]), made, record="trajectory")
        assert descent.jam.reward == batch.jam.reward[i]
        assert descent.time == batch.outcomes["t"][i]
        assert descent.trajectory["t"][-1] == descent.time
