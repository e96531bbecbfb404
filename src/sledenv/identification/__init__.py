"""From recordings to a contact law, and how sure one may be of it; imports pages/, plot/ and simulation/."""

from typing import TYPE_CHECKING

from sledenv.machine.extras import needs
from sledenv.machine.lazy import lazy_names

with needs("analysis", __name__):
    import joblib  # noqa: F401
    import pandas  # noqa: F401
    import pyarrow  # noqa: F401
    import scipy  # noqa: F401

if TYPE_CHECKING:
    from sledenv.identification.choice import identify
    from sledenv.identification.tables import recorded_poses, recorded_rebounds

__all__ = ["identify", "recorded_poses", "recorded_rebounds"]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "sledenv.identification.choice": ("identify",),
        "sledenv.identification.tables": ("recorded_poses", "recorded_rebounds"),
    },
)
