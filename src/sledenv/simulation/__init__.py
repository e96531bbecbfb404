"""Bodies, laws, slopes, launches and settings, checked; descents, rides, impacts, derivatives; imports kernel/."""

from typing import TYPE_CHECKING

from sledenv.machine.lazy import lazy_names

if TYPE_CHECKING:
    from sledenv.simulation.outcomes import Descent, DescentBatch
    from sledenv.simulation.records import STATUS_OF_CODE, Energy, Feature, Mode
    from sledenv.simulation.ride import RideBatch
    from sledenv.simulation.rigid_impact import Phase, RigidImpact
    from sledenv.simulation.sensitivity import Sensitivity
    from sledenv.simulation.simulate import simulate_blocks

__all__ = [
    "STATUS_OF_CODE",
    "Descent",
    "DescentBatch",
    "Energy",
    "Feature",
    "Mode",
    "Phase",
    "RideBatch",
    "RigidImpact",
    "Sensitivity",
    "simulate_blocks",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "sledenv.simulation.outcomes": ("Descent", "DescentBatch"),
        "sledenv.simulation.records": ("STATUS_OF_CODE", "Energy", "Feature", "Mode"),
        "sledenv.simulation.ride": ("RideBatch",),
        "sledenv.simulation.rigid_impact": ("Phase", "RigidImpact"),
        "sledenv.simulation.sensitivity": ("Sensitivity",),
        "sledenv.simulation.simulate": ("simulate_blocks",),
    },
)
