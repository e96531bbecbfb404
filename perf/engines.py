"""General physics engines on the reference descent: MuJoCo, pymunk (Chipmunk) and Box2D.

Each has a contact law of its own, so its velocities differ from the reference by more than its integration error, and
its rebounds come at other times. It steps through the same simulated time as the reference; what it returns are the
velocities after its own rebounds. None has two stiffnesses; pymunk and Box2D 2 have no rolling resistance.

``python -m perf.engines`` repeats the search for the settings in ``TUNED``: the least mean error of the first
five rebounds on a grid of stiffness and damping (MuJoCo) or of restitution (the others).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from perf.harness import Floats
from perf.reference import BODY, DOWNHILL, FEW, INWARD, LAUNCH, LAW, TIMES, errors

_BOX2D_SCALE = 100.0  # lengths in centimetres: Box2D's slop and thresholds suit bodies of that size in its units

# Settings found by tune(), by engine and step [s]: (frequency [rad/s], damping ratio) or (restitution,).
TUNED: dict[tuple[str, float], tuple[float, ...]] = {
    ("mujoco", 0.0001): (1323.9808, 0.22),
    ("mujoco", 0.002): (584.3084, 0.22),
    ("pymunk", 0.001): (0.535,),
    ("box2d", 0.001): (0.535,),
}


class Engine(NamedTuple):
    """An engine at the launch of the reference descent."""

    reset: Callable[[], None]  # back to the launch
    advance: Callable[[int], Any]  # step so many times
    velocity: Callable[[], tuple[float, float, float]]  # u, v [m/s], omega [rad/s]


def mujoco(dt: float, frequency: float, damping: float) -> Engine:
    """MuJoCo: soft constraint of the given frequency, elliptic cone, sliding and rolling friction."""
    import mujoco as mj

    solref = f"{-(frequency**2)!r} {-2.0 * damping * frequency!r}"
    model = mj.MjModel.from_xml_string(f"""
        <mujoco>
          <option timestep="{dt!r}" gravity="{DOWNHILL!r} 0 {-INWARD!r}" cone="elliptic"/>
          <default><geom condim="6" solref="{solref}" solimp="0.99 0.999 1e-4"/></default>
          <worldbody>
            <geom type="plane" size="0 0 1" friction="{LAW.friction!r} 0 {LAW.rolling_arm!r}"/>
            <body>
              <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/><joint type="hinge" axis="0 -1 0"/>
              <inertial pos="0 0 0" mass="{BODY.mass!r}" diaginertia="{" ".join([repr(BODY.inertia)] * 3)}"/>
              <geom type="sphere" size="{BODY.radius!r}" pos="0 0 {BODY.eccentricity!r}"
                    friction="{LAW.friction!r} 0 {LAW.rolling_arm!r}"/>
            </body>
          </worldbody>
        </mujoco>""")
    data = mj.MjData(model)

    def reset() -> None:
        mj.mj_resetData(model, data)
        data.qpos[:] = LAUNCH[:3]
        data.qvel[:] = LAUNCH[3:]

    return Engine(reset, lambda steps: mj.mj_step(model, data, nstep=steps), lambda: tuple(data.qvel))


def pymunk(dt: float, restitution: float) -> Engine:
    """Chipmunk through pymunk: impulses, friction; the slop is set far below the size of the body."""
    import pymunk as pm

    space = pm.Space()
    space.gravity = (DOWNHILL, -INWARD)
    space.collision_slop = 1e-5
    body = pm.Body(BODY.mass, BODY.inertia)
    disc = pm.Circle(body, BODY.radius, offset=(0.0, BODY.eccentricity))
    ground = pm.Segment(space.static_body, (-1e3, -1.0), (1e3, -1.0), 1.0)
    disc.friction, ground.friction = LAW.friction, 1.0  # multiplied
    disc.elasticity, ground.elasticity = restitution, 1.0
    space.add(body, disc, ground)

    def reset() -> None:
        body.position, body.angle = LAUNCH[:2], LAUNCH.phi
        body.velocity, body.angular_velocity = LAUNCH[3:5], LAUNCH.omega

    def advance(steps: int) -> None:
        for _ in range(steps):
            space.step(dt)

    return Engine(reset, advance, lambda: (*body.velocity, body.angular_velocity))


def box2d(dt: float, restitution: float) -> Engine:
    """Box2D 2.3: impulses, friction; bounces at any speed (its threshold is set to zero)."""
    import Box2D

    Box2D.b2_velocityThreshold = 0.0
    scale = _BOX2D_SCALE
    world = Box2D.b2World(gravity=(DOWNHILL * scale, -INWARD * scale))
    ground = world.CreateStaticBody()
    ground.CreateEdgeFixture(vertices=[(-1e4, 0.0), (1e4, 0.0)], friction=LAW.friction)
    body = world.CreateDynamicBody(allowSleep=False)
    centre = (0.0, BODY.eccentricity * scale)
    body.CreateCircleFixture(
        radius=BODY.radius * scale, pos=centre, density=1.0, friction=LAW.friction, restitution=restitution
    )
    body.massData = Box2D.b2MassData(mass=BODY.mass, center=(0.0, 0.0), I=BODY.inertia * scale**2)

    def reset() -> None:
        body.transform = (LAUNCH.x * scale, LAUNCH.y * scale), LAUNCH.phi
        body.linearVelocity = LAUNCH.u * scale, LAUNCH.v * scale
        body.angularVelocity = LAUNCH.omega

    def advance(steps: int) -> None:
        for _ in range(steps):
            world.Step(dt, 8, 3)

    def velocity() -> tuple[float, float, float]:
        return body.linearVelocity[0] / scale, body.linearVelocity[1] / scale, body.angularVelocity

    return Engine(reset, advance, velocity)


BUILDERS: dict[str, Callable[..., Engine]] = {"mujoco": mujoco, "pymunk": pymunk, "box2d": box2d}


def build(name: str, dt: float, *settings: float) -> Engine:
    """Return an engine at the launch, tuned unless settings are given."""
    engine = BUILDERS[name](dt, *(settings or TUNED[name, dt]))
    engine.reset()
    return engine


def steps_of(dt: float) -> int:
    """Steps that cover the first five rebounds of the reference."""
    return math.ceil(float(TIMES[FEW - 1]) / dt)


def velocities(engine: Engine, dt: float) -> Floats:
    """Velocities after the engine's own first rebounds, shape (n <= 5, 3).

    A rebound ends with the last of a run of steps in which the normal velocity changes by more than gravity does. Half
    as much time again is allowed for them.
    """
    track = [engine.velocity()]
    for _ in range(steps_of(dt) * 3 // 2):
        engine.advance(1)
        track.append(engine.velocity())
    found = np.array(track)
    pushed = np.abs(np.diff(found[:, 1]) + INWARD * dt) > 0.01 * INWARD * dt
    ends = np.flatnonzero(pushed[:-1] & ~pushed[1:]) + 1
    return found[ends[:FEW]]


def tune(name: str, dt: float) -> tuple[float, ...]:
    """Search the grid for the settings of the least mean error; a missing rebound counts as an error of 1."""
    grid: Any = ((restitution,) for restitution in np.linspace(0.3, 0.9, 121))
    if name == "mujoco":
        highest = min(1500.0, 1.5 / dt)  # stiffer springs than a step can follow are unstable
        grid = itertools.product(np.geomspace(0.05 * highest, highest, 25), np.linspace(0.02, 0.5, 25))

    def wrong(settings: tuple[float, ...]) -> float:
        found = errors(velocities(build(name, dt, *settings), dt))
        return float(found.sum()) + FEW - len(found)

    return min((tuple(round(float(value), 4) for value in settings) for settings in grid), key=wrong)


if __name__ == "__main__":  # the settings to put into TUNED
    for name, dt in TUNED:
        print(f'    ("{name}", {dt:g}): {tune(name, dt)},', flush=True)
