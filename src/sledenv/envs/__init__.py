"""Gymnasium environments, registered as this is imported, and their pictures; imports pages/, plot/, scenarios/."""

from __future__ import annotations

import gymnasium as gym

LAUNCH_ID = "sledenv/SledLaunch-v0"
DESCENT_ID = "sledenv/SledDescent-v0"

# More steps than an episode takes, so that they end none, and are known to what asks for a limit. The shipped scenarios
# allow 1,000 rebounds.
_MOST_LAUNCHES, _MOST_HOPS = 2, 1002


def register() -> None:
    """Register the environments with Gymnasium; a second call does nothing."""
    if LAUNCH_ID not in gym.registry:
        gym.register(
            id=LAUNCH_ID,
            entry_point="sledenv.envs.launch:SledLaunch",
            vector_entry_point="sledenv.envs.vector:SledLaunchVector",
            max_episode_steps=_MOST_LAUNCHES,
        )
    if DESCENT_ID not in gym.registry:
        gym.register(
            id=DESCENT_ID,
            entry_point="sledenv.envs.descent:SledDescent",
            vector_entry_point="sledenv.envs.vector:SledDescentVector",
            max_episode_steps=_MOST_HOPS,
        )
