"""Proximal policy optimisation of stable-baselines3, from the context to the launch."""

from __future__ import annotations

from stable_baselines3 import PPO

from agents.learning import Learned


class Agent(Learned):
    """Learns on-policy, from batches of fresh descents."""

    algorithm = PPO
