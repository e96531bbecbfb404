"""Soft actor-critic of stable-baselines3, from the context to the launch."""

from __future__ import annotations

from stable_baselines3 import SAC

from agents.learning import Learned


class Agent(Learned):
    """Learns off-policy, with an entropy bonus that it tunes itself."""

    algorithm = SAC
