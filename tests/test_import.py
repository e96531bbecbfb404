"""What a first use of the environments loads."""

from __future__ import annotations

import subprocess
import sys

HEAVY = (
    *("Box2D", "SALib", "joblib", "matplotlib", "pandas", "pygame", "rich", "scipy.stats"),
    *("stable_baselines3", "tensorboard", "torch", "tqdm"),
)
PROGRAM = f"""
import sys
import gymnasium
before = set(sys.modules)
import sledenv
env = gymnasium.make("sledenv/SledLaunch-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
gymnasium.make_vec("sledenv/SledLaunch-v0", num_envs=2)
print([name for name in {HEAVY!r} if name in set(sys.modules) - before])
"""


def test_an_episode_without_pictures_loads_no_optional_package() -> None:
    """Oracle: sys.modules of a fresh process."""
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
