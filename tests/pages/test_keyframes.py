"""Keyframes: what they give back, and how they are packed."""

from __future__ import annotations

import base64
import math
import zlib
from typing import Any

import numpy as np
import pytest

from sledenv.pages.keyframes import TOLERANCE, encoded, keyframes, packed, steps_for
from sledenv.plot.shapes import drawable_rows, reach, states_at
from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State
from sledenv.simulation.shapes import circular_segment
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height
from tests.bodies import bowl, rod

SLED = bowl(120.0, 1.2, 1.0, 0.14, 0.38)
SEGMENT = circular_segment(100.0, 0.5, math.radians(110.0))
ICE = ContactLaw.from_restitution(0.5, stiffness=1e6, friction=0.05, rolling_arm=0.005)
SNOW = ContactLaw.from_restitution(0.2, stiffness=1e7, friction=0.4, rolling_arm=0.002)


def dropped(body: Body = SEGMENT, law: ContactLaw = ICE, spin: float = 0.5, **options: Any) -> Descent:
    launch = State(0.0, 0.5 + support_height(body, 0.2), 0.2, 3.0, 0.0, spin)
    slope = options.pop("slope", Slope(0.15, 10.0))
    return simulate(body, law, slope, launch, record="trajectory", **options)


DESCENTS = {
    "segment": lambda: dropped(),
    "sled": lambda: dropped(SLED, SNOW, spin=-2.0),
    "spinning": lambda: dropped(spin=30.0),
    "elastic": lambda: dropped(law=ContactLaw.from_restitution(1.0, stiffness=1e6, friction=0.0, rolling_arm=0.0)),
    "plastic": lambda: dropped(law=ContactLaw.from_restitution(0.01, stiffness=1e6, friction=0.1, rolling_arm=0.0)),
    "rod": lambda: dropped(rod(2.0, 0.5, 0.17), max_time=1.0),
    "rigid": lambda: dropped(solver="rigid"),
    "no time": lambda: dropped(max_time=1e-12),
    "one flight": lambda: dropped(max_time=0.1),
    "point": lambda: dropped(segment(1.0, 0.0, 0.0, 1.0), max_time=1.0),
    "no gravity": lambda: dropped(slope=Slope(0.15, 10.0, 0.0), max_time=2.0),
}


def unpacked(columns: list[np.ndarray], gravity: tuple[float, float], steps: np.ndarray, tick: float) -> list[Any]:
    """Times and states of each descent, by the rule in the docstring of packed, one number after the other."""
    counts, ahead, *changes = columns
    found, k = [], 0
    for count in counts.tolist():
        times, states = [0.0], [[change[k] * step for change, step in zip(changes, steps, strict=True)]]
        for i in range(k + 1, k + count):
            seconds, contact = (int(ahead[i - 1]) >> 1) * tick, ahead[i - 1] & 1
            x, y, phi, u, v, omega = states[-1]
            given = [u, v, omega] if contact else [u + seconds * gravity[0], v + seconds * gravity[1], omega]
            rates = [
                (math.floor(g / s + 0.5) + c[i]) * s for g, s, c in zip(given, steps[3:], changes[3:], strict=True)
            ]
            moved = [q + seconds * (a + b) / 2 for q, a, b in zip((x, y, phi), (u, v, omega), rates, strict=True)]
            poses = [
                (math.floor(m / s + 0.5) + c[i]) * s for m, s, c in zip(moved, steps[:3], changes[:3], strict=True)
            ]
            times.append(times[-1] + seconds)
            states.append([*poses, *rates])
        k += count
        found.append((np.array(times), np.array(states)))
    return found


def decoded(text: str) -> np.ndarray:
    """Numbers of four bytes, by the docstring of encoded."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)
    return np.ascontiguousarray(planes.reshape(4, -1).T).view("<u4")[:, 0]


@pytest.mark.parametrize("name", DESCENTS)
def test_keyframes_give_the_other_rows_back(name: str) -> None:
    descent = DESCENTS[name]()
    rows, touching = keyframes(descent)
    every = drawable_rows(descent)
    missed = np.abs(states_at(rows, every["t"])[:, :3] - states_at(every, every["t"])[:, :3])
    assert (missed <= TOLERANCE * np.array([reach(descent.body)] * 2 + [1.0]) + 1e-12).all()
    assert len(touching) == len(rows) <= len(every)
    assert rows["t"][[0, -1]].tolist() == every["t"][[0, -1]].tolist()
    lasting = descent.rebounds[descent.rebounds["duration"] > 0.0]
    held = np.append(np.diff(rows["t"]), 0.0)[touching].sum()
    assert held == pytest.approx(lasting["duration"].sum(), rel=1e-9, abs=1e-9)


def test_a_flight_is_two_keyframes() -> None:
    assert len(keyframes(dropped(max_time=0.1))[0]) == 2


def test_packed_keyframes_are_those_that_went_in() -> None:
    """Oracle: the rule of packed, number by number; rounding moves it by half a step."""
    found = [DESCENTS[name]() for name in ("segment", "spinning", "no time", "elastic")]
    frames, gravity = [keyframes(one) for one in found], (9.81 * math.sin(0.15), -9.81 * math.cos(0.15))
    steps = steps_for(SEGMENT, 10.0, 60.0)
    columns = packed(frames, gravity, steps)
    for (rows, _), (times, states) in zip(frames, unpacked(columns, gravity, steps.state, steps.time), strict=True):
        assert times == pytest.approx(rows["t"], abs=0.51 * steps.time)
        for i, name in enumerate(State._fields):
            assert states[:, i] == pytest.approx(rows[name], abs=0.51 * steps.state[i])
    # Of the end of a flight little is left to be told: that is what makes a page small.
    ends = np.concatenate([[False, *~touching[:-1]] for _, touching in frames])
    assert ends.sum() > 10
    assert max(np.abs(column[ends]).max() for column in columns[2:]) <= 4
    text = encoded(columns)
    assert len(text) < 0.3 * 8 * 7 * sum(len(rows) for rows, _ in frames)
    assert decoded(text).size == sum(map(len, columns))


def test_text_holds_whole_numbers_and_others() -> None:
    whole = np.array([0, 1, -1, 2**30, -(2**30)], np.int32)
    others = np.array([0.0, -1.5, 3e-5])
    words = decoded(encoded([whole, others]))
    signs = words[:5].astype(np.int64)
    assert ((signs >> 1) ^ -(signs & 1)).tolist() == whole.tolist()
    assert words[5:].view(np.float32).tolist() == others.astype(np.float32).tolist()


def test_a_descent_without_trajectory_has_no_keyframes() -> None:
    descent = simulate(SEGMENT, ICE, Slope(0.15, 10.0), State(0.0, 1.5, 0.2, 3.0, 0.0, 0.5))
    with pytest.raises(ValueError, match='record="trajectory"'):
        keyframes(descent)
