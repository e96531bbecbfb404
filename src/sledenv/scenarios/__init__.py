"""Files of configuration, the contexts that scenarios draw from theirs, tracks made by hand; imports simulation/."""

from sledenv.scenarios.handmade import Track, TrackError, load_track, track_names

__all__ = ["Track", "TrackError", "load_track", "track_names"]
