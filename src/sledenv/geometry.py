"""How the body touches the slope, for Python: the kernel's own geometry, so that both agree to the last bit."""

from __future__ import annotations

from sledenv.entries import entry
from sledenv.kernel import geometry

arms = entry(geometry.arms)
directions = entry(geometry.directions)
feature_at = entry(geometry.feature_at)
feature_geometry = entry(geometry.feature_geometry)
has_corners = entry(geometry.has_corners)
lowest_support = entry(geometry.lowest_support)
support_height = entry(geometry.support_height)
support_heights = entry(geometry.support_heights)
whole_turns = entry(geometry.whole_turns)
