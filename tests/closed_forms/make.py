"""Bodies of every kind: round ones, segments, one without an arc, a wheel."""

from __future__ import annotations

import math

from sledenv.simulation.bodies import Body, circular_segment
from tests.bodies import rod

DISC = Body(1.0, 0.1, 0.05, 7.5e-3)
SLED = circular_segment(100.0, 0.5, math.radians(110.0))
SHELL = circular_segment(10.0, 0.5, math.radians(50.0))
ROD = rod(1.0, 1.0, 1.0 / 3.0)
WHEEL = Body(1.0, 0.1, 0.0, 0.005)
BODIES = {"disc": DISC, "sled": SLED, "shell": SHELL, "rod": ROD, "wheel": WHEEL}
