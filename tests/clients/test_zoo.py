"""rl-baselines3-zoo trains from configs/agents by the command of docs/clients.md; needs the extra "zoo"."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from stable_baselines3 import PPO, SAC

import sledenv  # noqa: F401  # registers what the saved models are tried on
from sledenv.envs.sb3 import make_vec_env

pytest.importorskip("rl_zoo3")

CONFIGS = Path(__file__).parents[2] / "configs" / "agents"
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore")]  # of torch, which this project does not own


@pytest.mark.parametrize("environment", ["SledLaunch-v0", "SledDescent-v0"])
@pytest.mark.parametrize(
    ("algorithm", "given"),
    [(SAC, ["learning_starts:64", "batch_size:32"]), (PPO, ["n_steps:16", "batch_size:16", "n_epochs:2"])],
)
def test_the_zoo_trains_evaluates_and_saves_a_model_that_acts(algorithm, given, environment, tmp_path):
    """Oracle: the files that the zoo documents; the saved policy on the native batch."""
    name, config = algorithm.__name__.lower(), CONFIGS / f"{algorithm.__name__.lower()}.yaml"
    command = [
        *(sys.executable, "-m", "rl_zoo3.train", "--algo", name, "--env", f"sledenv/{environment}"),
        *("--gym-packages", "sledenv", "--conf-file", str(config), "--num-threads", "1"),
        *("--n-timesteps", "256", "--eval-freq", "128", "--seed", "0"),
        *("--hyperparams", "n_envs:1", *given),
    ]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True)
    folder = tmp_path / "logs" / name / f"sledenv-{environment}_1"
    results = np.load(folder / "evaluations.npz")
    assert results["timesteps"].tolist() == [128, 256]
    assert ((results["results"] > 0.0) & (results["results"] < 1.0)).all()
    env = make_vec_env(f"sledenv/{environment}", 4, seed=0)
    actions, _ = algorithm.load(folder / f"sledenv-{environment}.zip", device="cpu").predict(env.reset())
    assert env.action_space.contains(actions[0])
