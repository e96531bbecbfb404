"""Names that the compiled kernel and the rest of the package share: tables of records, statuses, codes and bounds.

All that is above this room takes these names from here, so that it needs nothing of the kernel's own modules.
"""

from sledenv.kernel import params
from sledenv.kernel.contacts import SPACE
from sledenv.kernel.entries import LIBRARY
from sledenv.kernel.geometry import PIECE
from sledenv.kernel.ground import MOST_ZONES
from sledenv.kernel.outline import BODY, GIVEN, MOST_ARCS
from sledenv.kernel.params import SCENE
from sledenv.kernel.records import (
    CONTACT_FORCES,
    CONTACT_LOSSES,
    FINISH,
    FLIGHT_LOSSES,
    LEDGER_FIELDS,
    LOG_FULL,
    LOSSES,
    NON_FINITE,
    OUTCOME,
    REBOUND,
    RUNNING,
    STATUS_OF_CODE,
    TIMEOUT,
    TRAJECTORY,
    Energy,
    Feature,
    Mode,
    Status,
)

__all__ = [
    "BODY",
    "CONTACT_FORCES",
    "CONTACT_LOSSES",
    "FINISH",
    "FLIGHT_LOSSES",
    "GIVEN",
    "LEDGER_FIELDS",
    "LIBRARY",
    "LOG_FULL",
    "LOSSES",
    "MOST_ARCS",
    "MOST_ZONES",
    "NON_FINITE",
    "OUTCOME",
    "PIECE",
    "REBOUND",
    "RUNNING",
    "SCENE",
    "SPACE",
    "STATUS_OF_CODE",
    "TIMEOUT",
    "TRAJECTORY",
    "Energy",
    "Feature",
    "Mode",
    "Status",
    "params",
]
