"""The sled with its rider in pictures: pieces within the outline, where the arcs say; other bodies have none."""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np
import pytest

from sledenv import plot
from sledenv.plot.riders import DARK, HELMET, STEEL, pieces
from sledenv.simulation.outlines import arms_of
from sledenv.simulation.sleds import FRAME, LEGS, RIDER, RUNNER, sled
from sledenv.simulation.support import support_height
from tests.plot.outlined import RIDDEN, descent_of

SIZES: dict[str, dict[str, Any]] = {
    "usual": {},
    "high": {"height": 0.2},
    "low": {"height": 0.05},
    "child": {"rider_height": 1.2, "length": 1.2},
    "bent": {"bow_radius": 5.0, "balance": 0.5},
    "rearward": {"balance": -0.9},
    "tiny": {"length": 0.3, "rider_height": 0.4},
}


@pytest.mark.parametrize("name", SIZES)
def test_sled_and_rider_are_drawn_within_their_outline(name: str) -> None:
    """Oracle: the support height of the kernel, in all directions; each part of the body has a piece."""
    body = sled(**SIZES[name])
    drawn = pieces(body)
    assert {piece.part for piece in drawn} == {RUNNER, FRAME, LEGS, RIDER}
    for piece in drawn:
        assert piece.points[0].tolist() == piece.points[-1].tolist()
        for phi in np.linspace(-3.0, 3.0, 61).tolist():
            lowest = (piece.points @ (math.sin(phi), math.cos(phi))).min()
            assert -lowest <= support_height(body, phi) + 1e-6


@pytest.mark.parametrize("name", SIZES)
def test_what_touches_is_drawn_where_it_touches(name: str) -> None:
    """Oracle: the arcs of the body: the crown of the head, the soles and the ends of the runners are on the outline."""
    body = sled(**SIZES[name])
    lowest = {RUNNER: [STEEL], LEGS: [DARK], RIDER: [HELMET]}
    for k, arc in enumerate(body.arcs):
        head = arc.part == RIDER and arc.x < max(one.x for one in body.arcs if one.part == RIDER)
        if arc.part not in lowest or head or (name == "tiny" and arc.part == LEGS):
            continue
        after = body.arcs[(k + 1) % len(body.arcs)].begin
        phi = 0.5 * (arc.begin + after + (2.0 * math.pi if after <= arc.begin else 0.0))
        a, b = arms_of(arc, phi)
        points = np.concatenate(
            [one.points for one in pieces(body) if one.part == arc.part and one.colour in lowest[arc.part]]
        )
        deepest = -(points @ (math.sin(phi), math.cos(phi))).min()
        assert deepest == pytest.approx(b, abs=3e-3), (arc, a)


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
def test_a_strobe_figure_shows_the_rider_and_names_the_parts_that_touched(solver: str) -> None:
    """Oracles: the number of poses and of pieces; the log of the descent."""
    descent = descent_of("ridden", solver)
    figure = plot.plot_strobe(descent)
    shown = [len(collection.get_paths()) for collection in figure.axes[0].collections]
    poses = max(shown[i] for i in (0, -1))
    assert shown.count(len(pieces(RIDDEN))) >= poses > 3
    said = {text.get_text() for text in figure.legends[0].get_texts()}
    touched = {RIDDEN.parts[code - 1] for code in descent.rebounds["feature"].tolist()}
    assert len(touched) > 1
    assert {text for text in said if text.startswith("touchdown")} == {f"touchdown, {part}" for part in touched}
    marks = [line for line in figure.axes[0].lines if line.get_marker() == 6]
    assert sum(len(line.get_xdata()) for line in marks) == len(descent.rebounds)
    figure.savefig(io.BytesIO(), dpi=40)
