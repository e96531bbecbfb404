"""Arguments of closed forms: what is wrong is named, and arrays keep their shapes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sledenv.closed_forms import equilibrium, on_chord, painleve, swing
from sledenv.closed_forms.wheel import collide_wheel
from sledenv.simulation.scene import ContactLaw, Slope
from sledenv.simulation.shapes import hull
from tests.closed_forms.make import DISC, SLED, SQUARE

LAW, SLOPE, WEIGHTLESS = ContactLaw(1e6, 0.5, 0.4, 0.004, 0.02), Slope(0.1), Slope(0.1, gravity=0.0)
TWINS = hull(1.0, [(-1.0, 0.0, 0.2), (1.0, 0.0, 0.1)], sides=["side", "side"])
NAN, PHI = math.nan, np.linspace(-3.0, 3.0, 6).reshape(2, 3)


def wheel(**given: Any) -> Any:
    good = {"mass": 1.0, "inertia": 0.1, "radius": 0.5, "friction": 0.3, "rolling_arm": 0.1, "restitution": 0.5}
    return collide_wheel(**good | {"u": 1.0, "v": -1.0} | given)


@pytest.mark.parametrize(
    ("call", "given", "error", "message"),
    [
        (wheel, {"mass": 0.0}, ValueError, "mass = 0.0: must be in (0, inf)"),
        (wheel, {"inertia": [0.1, -1.0]}, ValueError, "inertia[1] = -1.0: must be in (0, inf)"),
        (wheel, {"rolling_arm": NAN}, ValueError, "rolling_arm = nan: must be in [0, inf)"),
        (wheel, {"restitution": [[0.5, 1.1]]}, ValueError, "restitution[0, 1] = 1.1: must be in [0, 1]"),
        (wheel, {"u": math.inf}, ValueError, "u = inf: must be a finite number"),
        (wheel, {"friction": "ice"}, TypeError, "friction = 'ice': must be numbers, each in"),
        (wheel, {"friction": [0.1, 0.2], "u": [1, 2, 3]}, ValueError, "broadcast together: friction (2,), u (3,)"),
        (wheel, {"mass": 1e200, "v": [-1.0, -1e200]}, OverflowError, "too large for a number"),
        (equilibrium.static_jam, (DISC, LAW, SLOPE, [0.0, NAN]), ValueError, "phi[1] = nan: must be a finite number"),
        (equilibrium.static_jam, (DISC, LAW, SLOPE, "upright"), TypeError, "phi = 'upright': must be numbers"),
        (equilibrium.static_jam_angles, (DISC, LAW, WEIGHTLESS), ValueError, "gravity = 0.0: must be > 0"),
        (painleve.painleve, (DISC, LAW, 0.0, NAN, 1.0), ValueError, "slip = nan"),
        (swing.small_swings, (DISC, WEIGHTLESS), ValueError, "gravity = 0.0: must be > 0"),
        (on_chord.chord_rests, (DISC, LAW, SLOPE), ValueError, "no chord to lie on: it has no straight side"),
        (on_chord.chord_loads, (SQUARE, LAW, SLOPE, 0.0), ValueError, "no chord to lie on: must be one of 'side 2', "),
        (on_chord.chord_tipping_friction, (SLED, LAW, ""), ValueError, "side = '': the body has no"),
        (on_chord.chord_rests, (TWINS, LAW, SLOPE, "side"), ValueError, "side = 'side': 2 sides of the body have this"),
        (on_chord.chord_slide, (LAW, SLOPE, 1.0, -1.0), ValueError, "time = -1.0: must be in [0, inf) s"),
        (on_chord.chord_finish_time, (LAW, WEIGHTLESS, 1.0), ValueError, "gravity = 0.0: must be > 0"),
    ],
)
def test_what_is_wrong_is_named(call: Callable[..., Any], given: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error) as raised:
        call(**given) if isinstance(given, dict) else call(*given)
    assert message in str(raised.value)


def test_arrays_are_broadcast() -> None:
    layers = np.ones((4, 1, 1))
    assert equilibrium.static_jam(SLED, LAW, SLOPE, PHI).shape == (2, 3)
    assert painleve.painleve(SLED, LAW, PHI, layers, -1.0).shape == (4, 2, 3)
    assert on_chord.chord_loads(SLED, LAW, SLOPE, PHI)[0].shape == (2, 3)
    assert on_chord.chord_slide(LAW, SLOPE, PHI, layers)[1].shape == (4, 2, 3)
