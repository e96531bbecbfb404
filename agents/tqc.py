"""Truncated quantile critics of sb3-contrib, from what is seen to the launch or the trims."""

from __future__ import annotations

from typing import Any

from sledenv.benchmark.problem import Problem
from sledenv.machine.extras import needs

from .learning import Learned
from .searching import SearchingTQC, searching

with needs("agents", __name__):
    from sb3_contrib import TQC


class Agent(Learned):
    """Learns off-policy as SAC does, but how the rewards of an action are distributed instead of their mean."""

    algorithm = TQC

    @classmethod
    def prepared(cls, problem: Problem, settings: dict[str, Any]) -> dict[str, Any]:
        """Take the policy that searches."""
        return searching(SearchingTQC, problem, settings)
