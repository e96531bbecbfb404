"""Problems and their best launches, agents trained and judged, scores and their report; imports envs/ and pages/."""

from typing import TYPE_CHECKING

from sledenv.machine.extras import needs
from sledenv.machine.lazy import lazy_names

with needs("benchmark", __name__):
    import joblib  # noqa: F401
    import pandas  # noqa: F401
    import pyarrow  # noqa: F401
    import scipy  # noqa: F401
    import tqdm  # noqa: F401

if TYPE_CHECKING:
    from sledenv.benchmark.evaluation import Evaluation, evaluate

__all__ = ["Evaluation", "evaluate"]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "sledenv.benchmark.evaluation": ("Evaluation", "evaluate"),
    },
)
