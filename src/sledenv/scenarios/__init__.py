"""Files of configuration, the contexts that scenarios draw from theirs, tracks made by hand; imports simulation/."""

from typing import TYPE_CHECKING

from sledenv.machine.lazy import lazy_names

if TYPE_CHECKING:
    from sledenv.scenarios.handmade import Track, TrackError, load_track, track_names
    from sledenv.scenarios.scenario import Context, Scenario, ScenarioError, load_scenario, scenario_names

__all__ = [
    "Context",
    "Scenario",
    "ScenarioError",
    "Track",
    "TrackError",
    "load_scenario",
    "load_track",
    "scenario_names",
    "track_names",
]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "sledenv.scenarios.handmade": ("Track", "TrackError", "load_track", "track_names"),
        "sledenv.scenarios.scenario": ("Context", "Scenario", "ScenarioError", "load_scenario", "scenario_names"),
    },
)
