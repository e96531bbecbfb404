"""Soft actor-critic of stable-baselines3, from what is seen to the launch or the trims."""

from __future__ import annotations

from sledenv.machine.extras import needs

from .learning import Learned

with needs("agents", __name__):
    from stable_baselines3 import SAC


class Agent(Learned):
    """Learns off-policy, with an entropy bonus that it tunes itself."""

    algorithm = SAC
