"""Results as plain data, for programs that read what the command ``sledenv`` prints as JSON."""

from __future__ import annotations

from typing import Any

from sledenv.simulation.bodies import Body
from sledenv.simulation.outcomes import Descent, ground_name
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.sensitivity import END_QUANTITIES, LAUNCH, PARAMETERS, Sensitivity
from sledenv.simulation.words import mode_name, part_name


def plain_setting(body: Body, law: ContactLaw, slope: Slope, launch: State) -> dict[str, Any]:
    """Return the body, the law with its restitution, the slope and the launch, in SI units."""
    contact = {**law._asdict(), "restitution": law.restitution}
    return {"body": _plain_body(body), "law": contact, "slope": plain_slope(slope), "launch": launch._asdict()}


def plain_slope(slope: Slope) -> dict[str, Any]:
    """Return the fields of a slope, zones as dicts of what each has."""
    return slope._asdict() | {"zones": [zone.given() for zone in slope.zones]}


def _plain_body(body: Body) -> dict[str, Any]:
    """Return the fields of a body, arcs as dicts."""
    plain: dict[str, Any] = {field: getattr(body, field) for field in body.fields}
    if "arcs" in plain:
        plain["arcs"] = [arc._asdict() for arc in body.arcs]
    return plain


def plain_descent(descent: Descent) -> dict[str, Any]:
    """Return setting, rebounds and outcome of a descent, named as its attributes."""
    jam, names = descent.rebound_jam._asdict(), list(descent.rebounds.dtype.fields or ())
    rebounds = []
    for i, row in enumerate(descent.rebounds.tolist()):
        fields = dict(zip(names, row, strict=True))
        words = {
            "feature": part_name(descent.body, fields["feature"]),
            "ground": ground_name(fields["ground"]),
            "mode": mode_name(fields["mode"]),
        }
        rebounds.append(fields | words | {name: values[i].item() for name, values in jam.items()})
    return {
        **plain_setting(descent.body, descent.law, descent.slope, descent.launch),
        "rebounds": rebounds,
        "status": str(descent.status),
        "time": descent.time,
        "state": descent.state._asdict(),
        "on_chord": descent.on_chord,
        "jam": {name: float(value) for name, value in descent.jam._asdict().items()},
        "jam_index": float(descent.jam.jam_index),
        "energy": {**descent.energy._asdict(), "residual": descent.energy.residual},
    }


def plain_sensitivity(found: Sensitivity) -> dict[str, Any]:
    """Return the derivatives of the end by each parameter, where they hold, and the growth of differences."""
    parameters = {}
    for i, name in enumerate(found.parameters):
        parameters[name] = {
            "unit": PARAMETERS[name],
            "value": found.values[i],
            "derivatives": dict(zip(END_QUANTITIES, found.end[:, i], strict=True)),
            "errors": dict(zip(END_QUANTITIES, found.end_errors[:, i], strict=True)),
            "side": found.sides[-1, i],
            "less_by": found.distances[-1, i, 0],
            "more_by": found.distances[-1, i, 1],
        }
    growth = found.growth[:, 0] if set(LAUNCH) <= set(found.parameters) else None
    return {"units": END_QUANTITIES, "parameters": parameters, "growth": growth}
