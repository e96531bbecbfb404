"""A Minari dataset of random episodes comes back bit for bit, and so does its environment; needs the extra "minari"."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("minari")
pytest.importorskip("h5py")

from examples import minari_dataset
from tests.own_scenarios import own_scenario

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]  # of Minari, which this project does not own

EPISODES = 5


@pytest.mark.parametrize("name", ["SledLaunch", "SledDescent"])
def test_a_dataset_comes_back_as_it_was_played_and_its_environment_repeats_it(name, monkeypatch, tmp_path):
    """Oracle: the same episodes played without Minari; the environment that the dataset describes."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    env_id = f"sledenv:sledenv/{name}-v0"
    scenario, dataset_id = own_scenario("ice_drop"), f"{name.lower()}/random-v0"
    given = ["--env-id", env_id, "--scenario", scenario, "--episodes", str(EPISODES), "--seed", "7"]
    dataset = minari_dataset.main([*given, "--dataset", dataset_id])
    assert dataset.total_episodes == EPISODES
    played, recovered = gym.make(env_id, scenario=scenario), dataset.recover_environment()
    played.action_space.seed(7)
    for i, episode in enumerate(dataset.iterate_episodes()):
        observation, info = played.reset(seed=7 + i)
        assert np.array_equal(recovered.reset(seed=7 + i)[0], observation)
        assert np.array_equal(episode.observations[0], observation)
        assert {key: values[0] for key, values in episode.infos["context"].items()} == info["context"]
        for t, action in enumerate(episode.actions):
            assert np.array_equal(action, played.action_space.sample())
            observation, *rest, _ = played.step(action)
            assert np.array_equal(recovered.step(action)[0], observation)
            assert np.array_equal(episode.observations[t + 1], observation)
            assert [episode.rewards[t], episode.terminations[t], episode.truncations[t]] == rest
        assert episode.terminations[-1] or episode.truncations[-1]
