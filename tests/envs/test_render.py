"""Pictures of a descent: what stands where in them, that they repeat, and that no descent is too ugly to draw."""

from __future__ import annotations

import math
import pickle
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Literal

import numpy as np
import pygame
import pytest
from gymnasium.error import DependencyNotInstalled

from sledenv.envs.canvas import FORCE, HEAVY, SHELL, SKY, Camera, Canvas
from sledenv.envs.render import DescentRenderer, _push_words
from sledenv.kernel.records import Mode, Status
from sledenv.plot.grounds import bands
from sledenv.plot.riders import HELMET, TOUCHED
from sledenv.plot.shapes import arc_centre, film_times, pace, push_at
from sledenv.simulation.bodies import segment
from sledenv.simulation.interpolation import states_at
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.ride import Ride
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.settings import Settings
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height
from tests.bodies import DISC, HILL, ICE, MAT, UGLY, run
from tests.plot.outlined import PROFILES, RIDDEN, SETTINGS, descent_of, ride_of

PANEL = 486  # first row of the panel in a picture of 960 x 540


@pytest.fixture(scope="module")
def descent() -> Descent:
    return run(DISC, ICE, HILL, (0.0, 0.5, 0.2, 3.0, 0.0, 0.5))


@pytest.fixture
def renderer() -> Iterator[DescentRenderer]:
    renderer = DescentRenderer(DISC)
    yield renderer
    renderer.close()


def drawn_in(image: np.ndarray, *colours: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the pixels of these colours."""
    away = np.min([np.abs(image.astype(int) - colour).max(axis=-1) for colour in colours], axis=0)
    return np.nonzero(away <= 2)


def is_picture(image: np.ndarray, width: int = 960, height: int = 540) -> bool:
    return image.shape == (height, width, 3) and image.dtype == np.uint8 and image.flags.writeable


@pytest.mark.parametrize("size", [(960, 540), (160, 90), (401, 700), (1920, 1080)])
def test_pictures_have_the_size_that_was_asked_for(size: tuple[int, int], descent: Descent) -> None:
    renderer = DescentRenderer(DISC, size=size)
    for image in (
        renderer.frame(descent, 1.0),
        renderer.strobe(descent),
        renderer.launch_frame(descent.slope, descent.launch),
    ):
        assert is_picture(image, *size)


def test_a_camera_maps_the_slope_to_scale_and_downhill_to_the_right(
    renderer: DescentRenderer, descent: Descent
) -> None:
    """Oracle: the slope of length L at angle beta lies L cos(beta) to the right and L sin(beta) down, to scale."""
    camera = renderer.camera(descent, 1.0)
    (top, bottom) = camera.pixels(np.array([(0.0, 0.0), (10.0, 0.0)]))
    assert bottom - top == pytest.approx(10.0 * camera.scale * np.array([math.cos(0.15), math.sin(0.15)]))
    above = camera.pixels(np.array([0.0, 1.0]))
    assert above - top == pytest.approx(camera.scale * np.array([math.sin(0.15), -math.cos(0.15)]))
    for column, row in (top, bottom):
        assert 0.0 < column < 960.0
        assert 0.0 < row < PANEL


@pytest.mark.parametrize("time", [0.0, 0.3, 1.1, 2.0])
def test_the_sled_is_drawn_where_the_camera_projects_it(
    time: float, renderer: DescentRenderer, descent: Descent
) -> None:
    """Oracle: the bounding box of a disc is that of its centre and radius."""
    state = states_at(descent.trajectory, [time])[0]
    camera = renderer.camera(descent, time)
    column, row = camera.pixels(np.array(arc_centre(DISC, *state[:3].tolist())))
    radius = DISC.radius * camera.scale
    rows, columns = drawn_in(renderer.frame(descent, time), HEAVY, SHELL)
    assert [columns.min(), columns.max()] == pytest.approx([column - radius, column + radius], abs=4.0)
    assert [rows.min(), rows.max()] == pytest.approx([row - radius, row + radius], abs=4.0)


def test_the_heavy_side_is_drawn_around_the_mass_centre(renderer: DescentRenderer, descent: Descent) -> None:
    """Oracle: the centroid of a half disc lies 4 r / (3 pi) from the centre of the disc, towards the mass centre."""
    for time in (0.0, 0.4, 1.5):
        x, y, phi = states_at(descent.trajectory, [time])[0, :3].tolist()
        centre = np.array(arc_centre(DISC, x, y, phi))
        towards = (np.array([x, y]) - centre) / DISC.eccentricity
        camera = renderer.camera(descent, time)
        expected = camera.pixels(centre + towards * 4.0 * DISC.radius / (3.0 * math.pi))
        rows, columns = drawn_in(renderer.frame(descent, time), HEAVY)
        assert [columns.mean(), rows.mean()] == pytest.approx(expected, abs=3.0)


@pytest.mark.parametrize("name", ["boulder", "rider"])
def test_any_body_is_drawn_where_it_is(name: str) -> None:
    """Oracles: the support heights of the body turned by the slope, up, down, left and right; points of its lower part.

    The line through the mass centre that was level at phi = 0 parts the colours.
    """
    descent = descent_of(name, "rigid")
    body = descent.body
    renderer = DescentRenderer(body)
    for time in (0.0, 0.9 * descent.time, descent.time):  # in flight
        x, y, phi = states_at(descent.trajectory, [time])[0, :3].tolist()
        camera = renderer.camera(descent, time)
        image = renderer.frame(descent, time)
        rows, columns = drawn_in(image[:PANEL], HEAVY, SHELL)
        column, row = camera.pixels(np.array([x, y])).tolist()
        down, left, up, right = (
            camera.scale * support_height(body, phi - descent.slope.angle + turn * math.pi / 2) for turn in range(4)
        )
        assert [columns.min(), columns.max()] == pytest.approx([column - left, column + right], abs=4.0)
        assert [rows.min(), rows.max()] == pytest.approx([row - up, row + down], abs=4.0)
        level = np.array([-math.sin(phi), math.cos(phi)])
        for colour, side in ((HEAVY, -1.0), (SHELL, 1.0)):
            rows, columns = drawn_in(image[:PANEL], colour)
            cosine, sine = math.cos(descent.slope.angle), math.sin(descent.slope.angle)
            right_of, above = columns - column, row - rows
            along, normal = right_of * cosine - above * sine, right_of * sine + above * cosine
            assert (side * (along * level[0] + normal * level[1])).min() > -2.0
            assert len(rows) > 100


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
@pytest.mark.parametrize("name", SETTINGS)
def test_every_contact_of_any_body_is_drawn_and_its_part_named(name: str, solver: str) -> None:
    """Oracle: the log of the descent."""
    descent = descent_of(name, solver)
    renderer = DescentRenderer(descent.body, size=(320, 200))
    for i, rebound in enumerate(descent.rebounds[:6]):
        push = push_at(descent, float(rebound["t_touchdown"]))
        assert push is not None
        part, told = descent.body.parts[rebound["feature"] - 1], _push_words(descent, push)[0]
        two = name == "ridden" and i == 4  # its legs strike while it lies on the rider
        if part not in ("bottom", "top") and not two:  # of a rod, which begins with one of its ends
            assert told.startswith(f"contact {i + 1}, {part}: ")
        assert is_picture(renderer.frame(descent, float(rebound["t_touchdown"])), 320, 200)
    assert is_picture(renderer.strobe(descent), 320, 200)


def test_zones_are_bands_below_the_surface(renderer: DescentRenderer) -> None:
    """Oracle: the camera, and the colours of the bands; a slope without zones has none of them."""
    zoned = Slope(0.15, 10.0, zones=(Zone(2.0, 4.0, 0.01, 0.0), Zone(6.0, math.inf, 0.6, 0.02)))
    descent, plain = (run(DISC, ICE, slope, (0.0, 0.5, 0.2, 3.0, 0.0, 0.5)) for slope in (zoned, HILL))
    colours = [tuple(bytes.fromhex(band.colour[1:])) for band in bands(zoned, ICE.friction)]
    camera = renderer.camera(descent, 0.0)
    for image in (renderer.frame(descent, 0.0), renderer.launch_frame(zoned, descent.launch, ICE.friction)):
        for colour, x in zip(colours, (3.0, 8.0), strict=True):
            column, row = camera.pixels(np.array([x + 0.3, -5.0 / camera.scale])).round().astype(int)
            assert image[row, column].tolist() == pytest.approx(colour, abs=2)
            rows, columns = drawn_in(image[:PANEL], colour)
            begin = camera.pixels(np.array([2.0 if x < 5.0 else 6.0, 0.0]))[0]
            assert np.quantile(columns, 0.02) > begin - 8.0  # letters have a few of these pixels
            assert len(rows) > 500
    for image in (renderer.frame(plain, 0.0), renderer.strobe(plain), renderer.launch_frame(HILL, plain.launch)):
        assert all(len(drawn_in(image[:PANEL], colour)[0]) < 100 for colour in colours)


@pytest.mark.parametrize("name", PROFILES)
def test_the_ground_is_drawn_as_it_is(name: str) -> None:
    """Oracle: the heights of the slope where the camera has them: sky just above, ground or a zone just below.

    Body, path and contacts hide some of it.
    """
    ride = ride_of(name)
    renderer = DescentRenderer(ride.body)
    for time in np.linspace(0.0, ride.time, 4).tolist():
        camera, image = renderer.camera(ride, time), renderer.frame(ride, time)
        x = camera.x + np.linspace(-0.5, 0.5, 400) * camera.width / camera.scale
        places = camera.pixels(np.stack([x, ride.slope.height_at(x)], axis=-1)).round().astype(int)
        columns, rows = places[((places > 4) & (places < (camera.width - 4, camera.height - 4))).all(axis=1)].T
        assert len(rows) > 100
        above, below = ((image[rows + away, columns] == SKY).all(axis=-1).mean() for away in (-4, 4))
        assert above > (0.9 if time == 0.0 else 0.4)
        assert below < 0.02


def test_a_film_of_a_long_hillside_follows_the_body_and_keeps_the_ground_in_sight() -> None:
    """Oracles: the place of the body in the picture; the ground under it, which is many pictures lower at the end."""
    ride = ride_of("rock")
    renderer = DescentRenderer(ride.body)
    cameras = [renderer.camera(ride, time) for time in film_times(ride, 30.0).tolist()]
    assert len(cameras) > 100
    scale = cameras[0].scale
    assert {camera.scale for camera in cameras} == {scale}
    assert cameras[0].y - cameras[-1].y > 2.0 * cameras[0].height / scale
    for camera, time in zip(cameras, film_times(ride, 30.0).tolist(), strict=True):
        x, y = states_at(ride.trajectory, [time])[0, :2].tolist()
        column, row = camera.pixels(np.array([x, y])).tolist()
        assert column == pytest.approx(480.0)
        assert 0.15 * camera.height < row < 0.85 * camera.height
        assert camera.pixels(np.array([x, float(ride.slope.height_at(x))]))[1] < camera.height
    steps = np.abs(np.diff([camera.y for camera in cameras])) * scale
    moves = np.abs(np.diff([states_at(ride.trajectory, [t])[0, 1] for t in film_times(ride, 30.0)])) * scale
    assert steps.max() < moves.max() + 1.0  # the camera moves as gently as the body


def test_a_track_that_fits_is_seen_as_a_whole() -> None:
    """Oracle: all vertices of the profile and the finish are in the picture at all times."""
    ride = ride_of("sled")
    renderer = DescentRenderer(ride.body)
    camera = renderer.camera(ride, 0.0)
    assert renderer.camera(ride, 3.0) == camera
    columns, rows = camera.pixels(np.append(ride.slope.vertices[:, :2], [(ride.slope.length, 0.0)], axis=0)).T
    assert 0.0 < columns.min() < columns.max() < 960.0
    assert 0.0 < rows.min() < rows.max() < PANEL


@pytest.mark.parametrize("name", PROFILES)
def test_cones_stand_on_the_piece_that_they_belong_to(name: str) -> None:
    """Oracles: the normal of the contact halves the cone; its half-angle is that of Coulomb's law in the zone."""
    ride = ride_of(name)
    renderer = DescentRenderer(ride.body)
    turned = set()
    for rebound in ride.rebounds:
        time = 0.5 * float(rebound["t_touchdown"] + rebound["t"])
        push = push_at(ride, time)
        assert push is not None
        canvas = Canvas(renderer.size, renderer.camera(ride, time), ride.slope)
        frictions = ride.slope.friction_at(push.touches["x"], ride.law.friction)
        for touch, friction in zip(push.touches, frictions.tolist(), strict=True):
            foot, edges = canvas.cone_edges(touch, friction)
            normal = np.array([touch["normal_x"], touch["normal_y"]])
            sides = (edges - foot) / np.hypot(*(edges - foot).T)[:, np.newaxis]
            assert sides @ normal == pytest.approx(math.cos(math.atan(friction)), rel=1e-3)
            assert foot[1] == pytest.approx(ride.slope.height_at(foot[0]), abs=0.3)
            turned.add(round(float(normal[0]), 2))
    assert len(turned) > 1


def test_the_grip_is_that_of_the_zone() -> None:
    """Oracle: a body that slips uses all of the friction."""
    zoned = Slope(0.15, 10.0, zones=(Zone(0.0, math.inf, 0.02, 0.0),))
    descent = run(DISC, ICE, zoned, (0.0, 0.5, 0.2, 3.0, 0.0, 0.5))
    row = descent.trajectory[np.argmax(descent.trajectory["normal"])]
    push = push_at(descent, float(row["t"]))
    assert push is not None
    assert row["slip"] != 0
    assert _push_words(descent, push)[-1].endswith("grip 1.00")


def test_a_sled_shows_its_rider_and_the_part_that_touches() -> None:
    """Oracle: the colours of the pieces, where the camera projects the head; the log of the descent."""
    descent = descent_of("ridden", "compliant")
    renderer = DescentRenderer(RIDDEN)
    head = max((arc for arc in RIDDEN.arcs if arc.part == "rider"), key=lambda arc: arc.x)
    helmet, touched = (tuple(bytes.fromhex(colour[1:])) for colour in (HELMET, TOUCHED))
    x, y, phi = descent.launch[:3]
    image, camera = renderer.frame(descent, 0.0), renderer.camera(descent, 0.0)
    middle = np.array([x, y]) + head.x * np.array([math.cos(phi), math.sin(phi)])
    column, row = camera.pixels(middle + head.y * np.array([-math.sin(phi), math.cos(phi)])).round().astype(int)
    assert image[row, column].tolist() == pytest.approx(helmet, abs=2)
    assert len(drawn_in(image[:PANEL], touched)[0]) == 0
    first = descent.rebounds[0]
    assert RIDDEN.parts[first["feature"] - 1] == "rider"
    image = renderer.frame(descent, float(first["t"] - 0.5 * first["duration"]))
    assert len(drawn_in(image[:PANEL], touched)[0]) > 50
    assert len(drawn_in(image[:PANEL], helmet)[0]) == 0


def test_frames_differ_in_time_and_repeat(renderer: DescentRenderer, descent: Descent) -> None:
    first = renderer.frame(descent, 0.5)
    kept = first.copy()
    second = renderer.frame(descent, 0.6)
    assert (first != second).any()
    assert (first == kept).all()
    copy = pickle.loads(pickle.dumps(DescentRenderer(DISC)))
    assert (copy.frame(descent, 0.5) == first).all()


def test_a_frame_is_clipped_to_the_duration(renderer: DescentRenderer, descent: Descent) -> None:
    assert (renderer.frame(descent, -1.0) == renderer.frame(descent, 0.0)).all()
    assert (renderer.frame(descent, math.inf) == renderer.frame(descent, descent.time)).all()


def test_the_launch_is_framed_as_the_first_moment_of_its_descent(renderer: DescentRenderer, descent: Descent) -> None:
    launch = renderer.launch_frame(descent.slope, descent.launch)
    assert (launch[:PANEL] == renderer.frame(descent, 0.0)[:PANEL]).all()


def test_the_panel_tells_the_outcome_at_the_end_alone(renderer: DescentRenderer, descent: Descent) -> None:
    before = renderer.frame(descent, descent.time - 1e-9)[PANEL:]
    end = renderer.frame(descent, descent.time)[PANEL:]
    other = renderer.frame(replace(descent, status=type(descent.status).TIMEOUT), descent.time)[PANEL:]
    assert (before[:, :640] == end[:, :640]).all()  # the motion
    assert (before[:, 640:800] != end[:, 640:800]).any()  # the status
    assert (before[:, 800:] != end[:, 800:]).any()  # the reward
    assert (other[:, 640:800] != end[:, 640:800]).any()
    assert (other[:, 800:] == end[:, 800:]).all()


def test_the_camera_stands_still_on_a_short_slope_and_follows_on_a_long_one(renderer: DescentRenderer) -> None:
    short = run(DISC, ICE, HILL, (0.0, 0.5, 0.2, 3.0, 0.0, 0.5))
    long = run(DISC, ICE, Slope(0.15, 2000.0), (0.0, 0.5, 0.2, 3.0, 0.0, 0.5), max_time=20.0)
    assert renderer.camera(short, 0.0) == renderer.camera(short, 1.5)
    for time in (0.0, 5.0, 20.0):
        state = states_at(long.trajectory, [time])[0]
        camera = renderer.camera(long, time)
        assert camera.x == pytest.approx(state[0])
        assert camera.scale * DISC.radius > 15.0
        rows, columns = drawn_in(renderer.frame(long, time), HEAVY, SHELL)
        assert 0 < columns.min() <= columns.max() < 959
        assert 0 < rows.min() <= rows.max() < PANEL


def test_a_camera_keeps_its_digits_far_down_the_slope() -> None:
    camera = Camera(1e9, 0.25, 0.15, 50.0, 960, 486)
    assert camera.pixels(np.array([1e9 + 1.0, 0.25])) == pytest.approx(
        [480.0 + 50.0 * math.cos(0.15), 243.0 + 50.0 * math.sin(0.15)]
    )


def test_a_strobe_shows_many_poses_and_repeats(renderer: DescentRenderer, descent: Descent) -> None:
    strobe = renderer.strobe(descent)
    assert (strobe == renderer.strobe(descent)).all()
    sky = renderer.frame(descent, 0.0)[0, 0]
    covered = (strobe[:PANEL] != sky).any(axis=-1).sum()
    single = (renderer.frame(descent, descent.time)[:PANEL] != sky).any(axis=-1).sum()
    assert covered > single + 5 * math.pi * (DISC.radius * renderer.camera(descent, 0.0).scale) ** 2 * 0.5
    _, columns = drawn_in(strobe, HEAVY, SHELL)  # only the last pose has the full colours
    assert columns.min() > 800


@pytest.mark.parametrize("name", UGLY)
def test_ugly_descents_are_drawn(name: str) -> None:
    body, law, slope, launch, options = UGLY[name]
    descent = run(body, law, slope, launch, **options)
    renderer = DescentRenderer(body)
    images = [renderer.frame(descent, share * descent.time) for share in (0.0, 0.4, 1.0)]
    images += [renderer.strobe(descent), renderer.launch_frame(slope, descent.launch)]
    for image in images:
        assert is_picture(image)
    if body.size > 0.0 and name not in ("overflow", "rod"):  # whose lines hide it
        for image in (images[1], images[-1]):
            assert len(drawn_in(image[:PANEL], HEAVY)[0]) > 100


def test_rows_that_are_not_numbers_are_not_drawn(renderer: DescentRenderer, descent: Descent) -> None:
    trajectory = descent.trajectory.copy()
    trajectory["x"][10:], trajectory["phi"][20:] = math.nan, math.inf
    broken = replace(descent, trajectory=trajectory)
    assert is_picture(renderer.frame(broken, descent.time))
    assert is_picture(renderer.strobe(broken))


def test_a_window_shows_pictures_until_it_is_closed(renderer: DescentRenderer, descent: Descent) -> None:
    image = renderer.frame(descent, 1.0)
    assert renderer.show(image)
    window = pygame.display.get_surface()
    assert window.get_size() == (960, 540)
    shown = np.frombuffer(pygame.image.tobytes(window, "RGB"), np.uint8).reshape(image.shape)
    assert (shown == image).all()
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    assert not renderer.show(image)
    assert not renderer.show(image)
    assert not pygame.display.get_init()
    renderer.close()
    assert renderer.show(image)
    renderer.close()
    assert not pygame.display.get_init()


def test_whoever_closes_the_window_of_the_process_ends_no_other_renderer(
    renderer: DescentRenderer, descent: Descent
) -> None:
    """As reported in https://github.com/Farama-Foundation/MOMAland/pull/78: pygame has one window for all."""
    other, image = DescentRenderer(DISC), renderer.frame(descent, 1.0)
    for close in (other.close, pygame.display.quit, pygame.quit):
        assert other.show(image)
        assert renderer.show(image)
        close()
        assert renderer.show(image)
        assert pygame.display.get_surface().get_size() == (960, 540)
    DescentRenderer(DISC).close()  # which has shown nothing
    assert pygame.display.get_init()


def test_a_renderer_with_an_open_window_can_be_pickled(renderer: DescentRenderer, descent: Descent) -> None:
    """As reported in https://github.com/eleurent/rl-agents/issues/84: what searches for plans copies environments."""
    renderer.show(renderer.frame(descent, 1.0))
    again = pickle.loads(pickle.dumps(renderer))
    assert (again.frame(descent, 1.0) == renderer.frame(descent, 1.0)).all()
    assert again.show(again.frame(descent, 1.0))


def test_a_film_runs_at_the_rate_of_the_descent_but_for_its_impacts(descent: Descent) -> None:
    """Oracle: in flight a second of film is a second of the descent; a hard impact takes 0.6 s of film."""
    times = film_times(descent, 100.0)
    assert times[0] == 0.0
    assert times[-1] == descent.time
    begin, end = descent.rebounds["t"][:2] - descent.rebounds["duration"][:2], descent.rebounds["t"][:2]
    assert np.diff(times[times < begin[0]]) == pytest.approx(0.01)
    assert np.diff(times[(times > end[0]) & (times < begin[1])]) == pytest.approx(0.01)
    assert ((times >= begin[0]) & (times <= end[0])).sum() == pytest.approx(60, abs=1)


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
def test_the_films_of_hops_are_the_film_of_the_descent(solver: Literal["compliant", "rigid"]) -> None:
    launch = State(0.0, 1.2, 0.2, 3.0, 0.0, 0.5)
    whole = simulate(DISC, ICE, HILL, launch, solver=solver, record="trajectory")
    ride = Ride(DISC, ICE, HILL, launch, Settings(solver=solver), record="trajectory")
    seen, hops = -1.0, []
    while ride.status == Status.RUNNING:
        ride.hop()
        hops.append(film_times(ride.descent(), 30.0, after=seen))
        seen = ride.time
    assert len(hops) >= 4
    assert np.concatenate(hops).tolist() == film_times(whole, 30.0).tolist()
    assert film_times(whole, 30.0, after=whole.time).tolist() == []


def test_gentle_impacts_are_held_for_less_so_that_ever_smaller_bounces_end() -> None:
    """Oracle: a ball dropped from rest bounces at e^k of its speed; the holds add up to 0.6 s / (1 - e) at most."""
    ball = simulate(
        segment(1.0, 0.1, 0.0, 0.004),
        ContactLaw.from_restitution(0.5, stiffness=1e6, friction=0.1, rolling_arm=0.0),
        Slope(0.0),
        State(0.0, 0.2, 0.0, 0.0, 0.0, 0.0),
        solver="rigid",
        record="trajectory",
        max_time=2.0,
    )
    assert len(ball.rebounds) > 10
    film = pace(ball)
    assert (np.diff(film, axis=0) >= 0.0).all()
    assert 0.6 < film[-1, 0] - ball.time < 0.6 / 0.5 * (1.0 + math.log(5.0, 2.0))


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
def test_the_push_is_what_the_descent_recorded(solver: Literal["compliant", "rigid"]) -> None:
    """Oracle: inside the friction cone at all times; the rows of the trajectory, or the impulse of the rebound."""
    hop = simulate(DISC, MAT, HILL, State(0.0, 1.2, 0.2, 3.0, 0.0, 0.5), solver=solver, record="trajectory")
    rebound = hop.rebounds[0]
    begin = float(rebound["t"] - rebound["duration"])
    assert push_at(hop, begin - 1e-6) is None
    assert push_at(hop, float(rebound["t"]) + 1e-6) is None
    times = np.linspace(begin, rebound["t"], 2001)
    pushes = [push for time in times.tolist() if (push := push_at(hop, time)) is not None]
    assert len(pushes) == 2001
    normal, tangential = (np.array([getattr(push, name) for push in pushes]) for name in ("normal", "tangential"))
    assert (np.abs(tangential) <= MAT.friction * normal * (1.0 + 1e-9) + 1e-9).all()
    assert {push.number for push in pushes} == {0}
    assert {push.instantaneous for push in pushes} == {solver == "rigid"}
    if solver == "rigid":
        assert normal[0] == rebound["normal_impulse"]
        assert tangential[0] == rebound["tangential_impulse"]
    else:
        rows = hop.trajectory[(hop.trajectory["t"] > begin) & (hop.trajectory["t"] < rebound["t"])]
        assert len(rows) > 10
        last_of_its_time = np.append(np.diff(rows["t"]) > 0.0, True)
        for row in rows[last_of_its_time]:
            push = push_at(hop, float(row["t"]))
            assert push is not None
            assert [push.normal, push.tangential, push.slip] == [row["normal"], row["tangential"], row["slip"]]
            assert push.normal <= push.largest == rows["normal"].max()


def test_force_and_cone_are_drawn_in_contact_alone(renderer: DescentRenderer, descent: Descent) -> None:
    """Oracle: the arrow leaves the contact point along the force: the edge of the cone, as it slides."""
    rebound = descent.rebounds[0]
    peak = np.nextafter(descent.trajectory["t"][np.argmax(descent.trajectory["normal"])], 0.0)  # the force drops there
    push = push_at(descent, peak)
    assert push is not None
    assert abs(push.tangential) == pytest.approx(descent.law.friction * push.normal)
    image = renderer.frame(descent, peak)
    rows, columns = drawn_in(image[100:PANEL], FORCE)  # below the words
    camera = renderer.camera(descent, peak)
    (touch,) = push.touches
    foot = camera.pixels(np.array([touch["x"], touch["y"]]))
    lean = math.atan2(push.tangential, push.normal) + descent.slope.angle
    tip = foot + 0.3 * camera.height * np.array([math.sin(lean), -math.cos(lean)])
    assert [columns[rows.argmin()], 100 + rows.min()] == pytest.approx(tip, abs=6.0)
    assert [columns[rows.argmax()], 100 + rows.max()] == pytest.approx(foot, abs=6.0)
    assert len(drawn_in(image[:100], FORCE)[0]) > 50  # the mode of the contact in words
    for time in (float(rebound["t"] - rebound["duration"]) - 0.01, float(rebound["t"]) + 0.01):
        assert len(drawn_in(renderer.frame(descent, time), FORCE)[0]) == 0


def test_the_mode_of_the_contact_is_named(renderer: DescentRenderer, descent: Descent) -> None:
    peak = float(descent.trajectory["t"][np.argmax(descent.trajectory["normal"])])
    other = descent.rebounds.copy()
    other["mode"][0] = Mode.STUCK if other["mode"][0] != Mode.STUCK else Mode.SLIDE
    renamed = renderer.frame(replace(descent, rebounds=other), peak)
    assert (renamed[:40] != renderer.frame(descent, peak)[:40]).any()
    assert (renamed[40:] == renderer.frame(descent, peak)[40:]).all()


def test_a_film_is_played_to_its_end(
    renderer: DescentRenderer, descent: Descent, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[np.ndarray] = []
    monkeypatch.setattr(renderer, "show", lambda image: shown.append(image) is None)
    renderer.play(renderer.film(descent, speed=40.0))
    assert len(shown) == len(film_times(descent, 30, speed=40.0)) > 15
    assert (shown[0] == renderer.frame(descent, 0.0)).all()
    assert (shown[-1] == renderer.frame(descent, descent.time)).all()


def test_playing_stops_when_the_window_is_closed(renderer: DescentRenderer, descent: Descent) -> None:
    renderer.show(renderer.frame(descent, 0.0))
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    renderer.play(renderer.film(descent, speed=0.001))  # an hour otherwise


def test_wrong_arguments_are_named(renderer: DescentRenderer, descent: Descent) -> None:
    with pytest.raises(ValueError, match="size"):
        DescentRenderer(DISC, size=(100, 90))
    with pytest.raises(ValueError, match="fps"):
        DescentRenderer(DISC, fps=0)
    with pytest.raises(ValueError, match="time"):
        renderer.frame(descent, math.nan)
    with pytest.raises(ValueError, match="speed"):
        next(renderer.film(descent, speed=0.0))
    with pytest.raises(ValueError, match='record="trajectory"'):
        renderer.frame(simulate(DISC, ICE, HILL, descent.launch), 0.0)


def test_a_missing_pygame_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(DependencyNotInstalled, match=r"sledenv\[render\]"):
        DescentRenderer(DISC)
