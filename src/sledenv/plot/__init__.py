"""The figures: impacts and descents in time and space, energies, maps of how an impact ends; imports simulation/.

Each returns a matplotlib ``Figure``, and raises ImportError where matplotlib is missing.
"""

from sledenv.plot.contacts import plot_impact, plot_slip
from sledenv.plot.energy import plot_descent
from sledenv.plot.growth import plot_growth
from sledenv.plot.impacts import plot_impulse_plane
from sledenv.plot.maps import plot_jam_map, plot_mode_map, plot_table_1
from sledenv.plot.paper import (
    plot_impact_phases,
    plot_sliding_end,
    plot_velocities,
    plot_worked_example,
)
from sledenv.plot.strobe import plot_strobe

__all__ = [
    "plot_descent",
    "plot_growth",
    "plot_impact",
    "plot_impact_phases",
    "plot_impulse_plane",
    "plot_jam_map",
    "plot_mode_map",
    "plot_sliding_end",
    "plot_slip",
    "plot_strobe",
    "plot_table_1",
    "plot_velocities",
    "plot_worked_example",
]
