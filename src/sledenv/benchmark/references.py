"""Frozen references: what the best known policy earns in each held-out context."""

from __future__ import annotations

import pandas as pd

from sledenv.benchmark.problem import Problem


def reference(problem: Problem, held_out: str = "test") -> pd.DataFrame | None:
    """Return the frozen reference of a problem, None where no frozen file fits its scenario and noise.

    Returns
    -------
    DataFrame or None
        A row for each context, whose number is the index: ``lower``, the mean reward, over its trials, of the best
        policy that sees no more than an agent, or of the best launch found; ``lower_falls``, its share of falls;
        ``clairvoyant``, the reward of the best ride of one who knows every draw, NaN where it was not searched.
    """
    return None
