"""Fields of bodies, laws, slopes, zones and launches: each is checked by the same rule, and is a float."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sledenv.simulation.bodies import Body, Segment, segment
from sledenv.simulation.outlines import Arc
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.shapes import circular_segment, disc, lamina, polygon, rod

BELOW_ZERO, ABOVE_HALF_TURN = -1e-300, math.nextafter(math.pi, 4.0)
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
ROD = rod(1.0, 1.0)
GOOD: dict[Any, dict[str, Any]] = {
    segment: {"mass": 1.0, "radius": 0.1, "eccentricity": 0.05, "inertia": 7.5e-3, "half_angle": 1.9},
    Body: {"mass": 1.0, "inertia": 0.1, "arcs": ROD.arcs},
    circular_segment: {"mass": 1.0, "radius": 0.1, "half_angle": 1.9},
    disc: {"mass": 1.0, "radius": 0.1, "eccentricity": 0.05, "inertia": 0.1},
    rod: {"mass": 1.0, "length": 1.0, "thickness": 0.1, "inertia": 0.2},
    polygon: {"mass": 1.0, "points": SQUARE, "rounding": 0.1, "inertia": 0.3},
    lamina: {"mass": 1.0, "arcs": polygon(1.0, SQUARE).arcs},
    ContactLaw: {"stiffness": 1e6, "asymmetry": 0.5, "friction": 0.1, "rolling_arm": 1e-3, "corner_rolling_arm": 0.0},
    Slope: {"angle": 0.1, "length": 10.0, "gravity": 9.81},
    Zone: {
        **{"begin": 1.0, "end": 2.0, "friction": 0.1, "rolling_arm": 1e-3, "corner_rolling_arm": 0.0},
        **{"restitution": 0.5, "stiffness": 1e6},
    },
    State: {"x": 0.0, "y": 1.0, "phi": 0.5, "u": 1.0, "v": -1.0, "omega": 2.0},
}
POSITIVE, NOT_NEGATIVE = ([0.0, -1.0], "(0, inf)"), ([BELOW_ZERO], "[0, inf)")
MEASURE, INERTIA = ([0.0, -1.0, 9e-51, 1.1e50], "[1e-50, 1e+50]"), ([0.0, -1.0, 9e-251, 1.1e150], "[1e-250, 1e+150]")
MEASURE_OR_0 = ([BELOW_ZERO, 9e-51, 1.1e50], "0 or in [1e-50, 1e+50]")
FINITE, SHARE = ([], "a finite number"), ([BELOW_ZERO, 1.0 + 1e-15, 2.0], "[0, 1]")
HALF_TURN = ([0.0, -1.0, ABOVE_HALF_TURN], "(0, pi] rad")
RANGES: dict[Any, dict[str, tuple[list[float], str]]] = {
    segment: {
        **{"mass": MEASURE, "inertia": INERTIA, "radius": MEASURE_OR_0, "eccentricity": NOT_NEGATIVE},
        "half_angle": HALF_TURN,
    },
    Body: {"mass": MEASURE, "inertia": INERTIA},
    circular_segment: {
        **dict.fromkeys(("mass", "radius"), MEASURE),
        "half_angle": ([*HALF_TURN[0], 9e-41], "[1e-40, pi] rad"),
    },
    disc: {
        **{"mass": MEASURE, "radius": MEASURE, "inertia": INERTIA},
        "eccentricity": ([BELOW_ZERO, 0.11], "in [0, radius] = [0, 0.1] m"),
    },
    rod: {"mass": MEASURE, "length": MEASURE, "inertia": INERTIA, "thickness": MEASURE_OR_0},
    polygon: {"mass": MEASURE, "inertia": INERTIA, "rounding": NOT_NEGATIVE},
    lamina: {"mass": MEASURE},
    ContactLaw: {
        "stiffness": POSITIVE,
        "asymmetry": SHARE,
        **dict.fromkeys(("friction", "rolling_arm", "corner_rolling_arm"), NOT_NEGATIVE),
    },
    Slope: {
        "angle": ([math.pi / 2, -math.pi / 2, 3.0], "(-pi/2, pi/2) rad"),
        "length": ([0.0, -1.0], "(0, inf] m"),
        "gravity": NOT_NEGATIVE,
    },
    Zone: {
        "begin": FINITE,
        "end": ([], "(-inf, inf] m"),
        **dict.fromkeys(("friction", "rolling_arm", "corner_rolling_arm"), NOT_NEGATIVE),
        "restitution": SHARE,
        "stiffness": POSITIVE,
    },
    State: dict.fromkeys(State._fields, FINITE),
}
MAY_BE_INFINITE = {(Slope, "length"), (Zone, "end")}
TUPLES = (ContactLaw, Slope, Zone, State)


@pytest.mark.parametrize("kind", RANGES, ids=lambda kind: kind.__name__)
def test_a_number_outside_its_range_is_refused_by_name(kind: Any) -> None:
    """Oracle: the range written beside the field; NaN and the infinities lie outside of nearly all; a word."""
    for field, (values, allowed) in RANGES[kind].items():
        for value in [*values, math.nan, -math.inf, *([] if (kind, field) in MAY_BE_INFINITE else [math.inf]), "steep"]:
            error, kinds = (ValueError, "") if isinstance(value, float) else (TypeError, "a number")
            with pytest.raises(error, match="must be") as caught:
                kind(**GOOD[kind] | {field: value})
            assert f"{kind.__name__}.{field} = {value!r}: must be {kinds}" in str(caught.value)
            assert allowed in str(caught.value)


@pytest.mark.parametrize("value", [None, [1.0], {}, 1j, object, "1", b"1", np.array("1")], ids=repr)
def test_what_is_not_a_number_is_refused(value: Any) -> None:
    """Oracle: the documented TypeError for what is not a real number, of all fields by the same rule."""
    with pytest.raises(TypeError, match=r"segment\.mass = .*: must be a number in \[1e-50, 1e\+50\]"):
        segment(value, 0.1, 0.05, 7.5e-3)
    with pytest.raises(TypeError, match=r"Body\.arcs\[0\]\.x = .*: must be a number, a finite number"):
        Body(1.0, 1.0, [Arc(value, 0.0, 1.0, 0.0)])
    with pytest.raises(TypeError, match=r"ContactLaw\.stiffness = .*: must be a number in \(0, inf\)"):
        ContactLaw(value, 0.5, 0.1, 1e-3)


@pytest.mark.parametrize(
    "convert", [np.float32, np.float64, lambda value: int(value) if value == int(value) else value]
)
def test_every_field_is_a_float_whatever_it_was_given_as(convert: Callable[[float], Any]) -> None:
    """Oracle: the kernel reads doubles."""
    made = segment(**{field: convert(value) for field, value in GOOD[segment].items()})
    found = [getattr(made, field) for field in Segment.fields]
    body = Body(convert(1.0), convert(1.0), [Arc(*map(convert, (0.0, 0.0, 1.0, 0.0)))])
    found += [body.mass, body.inertia, *body.arcs[0][:4]]
    for kind in TUPLES:
        found += kind(**{field: convert(value) for field, value in GOOD[kind].items()})[: len(GOOD[kind])]
    assert {type(value) for value in found} == {float}


@pytest.mark.parametrize("made", [segment(**GOOD[segment]), ROD, *(kind(**GOOD[kind]) for kind in TUPLES)])
def test_a_changed_field_is_checked_too_and_all_survive_pickling(made: Any) -> None:
    """Oracle: the message of a new one, the object itself; worker processes receive it."""
    change = made.replace if isinstance(made, Body) else made._replace
    owner = {Segment: "segment"}.get(type(made), type(made).__name__)
    for field in made.fields if isinstance(made, Body) else GOOD[type(made)]:
        with pytest.raises((ValueError, TypeError), match=rf"{owner}\.{field} = nan: must be"):
            change(**{field: math.nan})
    again = pickle.loads(pickle.dumps(made))
    assert type(again) is type(change()) is type(made)
    assert again == change() == made
    if isinstance(made, Body):
        heavier = made.replace(mass=3.0)
        assert (type(heavier), heavier.mass, heavier.inertia, heavier.arcs) == (
            type(made),
            3.0,
            made.inertia,
            made.arcs,
        )
        assert heavier.record["mass"] == 3.0
        with pytest.raises(TypeError, match="colour"):
            made.replace(colour=1.0)
    else:
        with pytest.raises(ValueError, match=rf"{owner}\.{made._fields[0]} = nan"):
            type(made)._make([math.nan, *made[1:]])
