"""Truncated quantile critics of sb3-contrib, from what is seen to the launch or the trims."""

from __future__ import annotations

from sledenv.machine.extras import needs

from .learning import Learned

with needs("agents", __name__):
    from sb3_contrib import TQC


class Agent(Learned):
    """Learns off-policy as SAC does, with quantiles of what is earned in place of its mean."""

    algorithm = TQC
