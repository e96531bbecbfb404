"""How high a body rests: where it touches the ground onto which it comes down along the normal of the slope's plane.

It is stopped by one of three things. A piece stops it where the point of the body that is outermost against the normal
of the piece lies over the piece, or over one that is joined to it by dips: there the line of the piece bounds the
ground. A crest stops it between the points that are outermost against its two pieces: there that of its tangents does
which touches the body where it touches the crest. A round dip stops it where an arc that is rounder touches it.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from sledenv.compiler.jit import kernel
from sledenv.kernel.arithmetic import angle_of, sine_cosine, wrap
from sledenv.kernel.geometry import first_piece
from sledenv.kernel.outline import arc_at, arms_along, from_middle, support_height

_HALVINGS: Final = 60  # of the turn of a crest
_BESIDE: Final = 1e-6  # [rad] by which an arc reaches beyond its ends, so that rounding leaves nothing between two


class Pose(NamedTuple):
    """Where the mass centre is along the slope, and how the body is turned."""

    x: float  # [m]
    phi: float  # [rad]
    sine: float  # of phi
    cosine: float


@kernel
def _outermost(body: np.void, pose: Pose, tilt: float, along: float, up: float) -> tuple[float, float]:
    """Place [m] of the point that is lowest over a line, and how far [m] the mass centre is over the line then.

    The line has the inclination ``tilt`` [rad] to the plane, and the unit tangent (along, up).
    """
    arc = arc_at(body, wrap(pose.phi - tilt))
    sine, cosine = pose.sine * along - pose.cosine * up, pose.cosine * along + pose.sine * up
    a, b = arms_along(body, arc, sine, cosine)
    return pose.x - a * along + b * up, b


@kernel
def _on_crest(body: np.void, pose: Pose, pieces: np.ndarray, j: int) -> float:
    """Height [m] at which a body lies on a crest.

    There the point that is lowest over a tangent changes from behind the crest to before it.
    """
    bend, before, behind, height = pieces[j], pieces[j - 1]["tilt"], pieces[j]["tilt"], 0.0
    for _ in range(_HALVINGS):
        tilt = 0.5 * (before + behind)
        up, along = sine_cosine(tilt)
        foot, b = _outermost(body, pose, tilt, along, up)
        height = bend["qy"] + (b + bend["radius"] + (pose.x - bend["qx"]) * up) / along
        if not behind < tilt < before:
            break
        if foot > bend["qx"] - bend["radius"] * up:
            before = tilt
        else:
            behind = tilt
    return height


@kernel
def _in_dip(body: np.void, pose: Pose, pieces: np.ndarray, j: int, arc: int) -> float:
    """Height [m] at which an arc touches a round dip, -inf if it does not.

    Their centres are then as far apart as their radii differ.
    """
    bend, across, along = pieces[j], body["across"][arc], body["along"][arc]
    apart = bend["radius"] - body["r"][arc]
    aside = pose.x - pose.cosine * across - pose.sine * along - bend["qx"]
    square = apart * apart - aside * aside
    if not (apart > 0.0 and square > 0.0):
        return -math.inf
    below = math.sqrt(square)
    tilt = angle_of(aside, below)
    if not pieces[j - 1]["tilt"] <= tilt <= bend["tilt"]:
        return -math.inf
    if abs(from_middle(body, arc, pose.phi - tilt)) > body["half"][arc] + _BESIDE:
        return -math.inf
    return bend["qy"] - below - (pose.cosine * along - pose.sine * across)  # type: ignore[no-any-return]


@kernel
def resting_height(body: np.void, pieces: np.ndarray, x: float, phi: float) -> float:
    """Height [m] of the mass centre over the plane of the slope at which a body touches the ground from above.

    Parameters
    ----------
    body : BODY
    pieces : ndarray of PIECE, of one ground
    x : float
        Place [m] of the mass centre along the slope.
    phi : float
        Orientation [rad].
    """
    size, count = body["size"], pieces.shape[0]
    if count == 1 or not x + size >= pieces[1]["bx"]:  # the ground is level up to there
        return pieces[0]["y"] + support_height(body, phi)  # type: ignore[no-any-return]
    sine, cosine = sine_cosine(wrap(phi))
    pose = Pose(x, phi, sine, cosine)
    begin, end = max(first_piece(pieces, x - size) - 1, 0), min(first_piece(pieces, x + size) + 2, count)
    found, before, low, high, ahead = -math.inf, 0.0, -math.inf, math.inf, begin
    for j in range(begin, end):
        piece = pieces[j]
        if ahead == j:  # the next crest is looked for
            ahead += 1
            while ahead < end and pieces[ahead]["bend"] <= 0:
                ahead += 1
            high = pieces[ahead]["bx"] if ahead < end else math.inf
        if piece["bend"] > 0:
            low = piece["ex"]
        foot, b = _outermost(body, pose, piece["tilt"], piece["tx"], piece["ty"])
        if not (foot < low or foot > high):
            height = piece["y"] + (b + (x - piece["x"]) * piece["ty"]) / piece["tx"]
            found = found if height <= found else height  # NaN too
        if j > begin and piece["bend"] > 0 and before > piece["bx"] and foot < piece["ex"]:
            found = max(found, _on_crest(body, pose, pieces, j))
        elif j > begin and piece["bend"] < 0:
            for arc in range(int(body["arcs"])):
                found = max(found, _in_dip(body, pose, pieces, j, arc))
        before = foot
    return found
