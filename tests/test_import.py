"""What a first use of the environments loads."""

from __future__ import annotations

import importlib.metadata
import subprocess
import sys

import gymnasium

import sledenv

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


def test_the_package_says_what_it_registers_and_its_version() -> None:
    """Oracle: Gymnasium's registry; the installed distribution."""
    assert [name for name in gymnasium.registry if name.startswith("sledenv/") and name not in sledenv.__doc__] == []
    assert sledenv.__version__ == importlib.metadata.version("sledenv")


def test_an_episode_without_pictures_loads_no_optional_package() -> None:
    """Oracle: sys.modules of a fresh process."""
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
