"""Figures and the geometry behind them: outlines, interpolation, what is drawn where and labelled how."""

from __future__ import annotations

import io
import itertools
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import sledenv
from sledenv import plot
from sledenv.plot import shapes
from sledenv.plot.energy import energy_layers
from sledenv.plot.style import plain
from sledenv.simulation.bodies import Body, segment
from sledenv.simulation.interpolation import drawable_rows, states_at
from sledenv.simulation.outcomes import Descent
from sledenv.simulation.scene import ContactLaw, Slope, State, Zone
from sledenv.simulation.shapes import circular_segment, polygon
from sledenv.simulation.shapes import rod as round_rod
from sledenv.simulation.simulate import simulate
from sledenv.simulation.support import support_height
from tests.bodies import DISC, HILL, ICE, MAT, ROD, SLED, run
from tests.plot.outlined import BOULDER, CRATE, LINE, RIDER, SETTINGS, descent_of

SEGMENT = circular_segment(100.0, 0.6, math.radians(70.0))
OTHERS = {"boulder": BOULDER, "rider": RIDER, "crate": CRATE, "rod": round_rod(5.0, 1.2, 0.2), "line": LINE}
LAUNCH = (0.0, 0.5, 0.2, 3.0, 0.0, 0.5)
STEEL = ContactLaw.from_restitution(0.2, stiffness=1e7, friction=0.1, rolling_arm=0.0)
BLOCK = polygon(20.0, [(0.0, 0.0), (0.6, 0.0), (0.6, 0.4), (0.0, 0.4)])


@pytest.fixture(scope="module")
def slides() -> Descent:
    return run(SEGMENT, ICE, HILL, LAUNCH)


@pytest.fixture(scope="module")
def jams() -> Descent:
    descent = run(DISC, MAT, Slope(0.1, 10.0), (0.0, 0.4, 0.4, 1.0, 0.0, 0.5))
    assert descent.status == "jammed"
    return descent


@pytest.fixture(scope="module")
def impact() -> Descent:
    body, law = segment(1.0, 0.1, 0.05, 7.5e-3), ContactLaw(9810.0, 0.5, 0.1, 0.001)
    launch = (0.0, 0.005, math.pi / 4, 0.0, -10.0, 0.0)
    return run(body, law, Slope(0.0, 1.0, 0.0), launch, max_time=0.04, sample_interval=1e-4)


@pytest.fixture(scope="module")
def lands_flat() -> Descent:
    """A block: two corners of the same arm lie above each other, and the upper ones do not touch."""
    law = ContactLaw.from_restitution(0.6, stiffness=1e6, friction=0.0, rolling_arm=0.0)
    return run(BLOCK, law, Slope(0.0, 50.0), (0.0, 0.5, 0.0), max_time=1.2)


@pytest.fixture(scope="module")
def rigid() -> Descent:
    """A chord that hits the slope at the end of a long contact; what it loses is lost then."""
    law = ContactLaw.from_restitution(0.5, stiffness=1e7, friction=0.295, rolling_arm=0.005)
    launch = (0.0, 0.232, -0.1316, 3.911, 0.0, -1.361)
    return run(SLED, law, Slope(0.1456, 10.0), launch, solver="rigid")  # type: ignore[arg-type]


def pixels(figure: Figure) -> np.ndarray:
    """Draw a figure."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())


def shoelace(points: np.ndarray) -> tuple[float, np.ndarray]:
    """Area and centroid of a closed polygon."""
    (x, y), (x1, y1) = points[:-1].T, points[1:].T
    cross = x * y1 - x1 * y
    area = 0.5 * cross.sum()
    return area, np.array([((x + x1) * cross).sum(), ((y + y1) * cross).sum()]) / (6.0 * area)


@pytest.mark.parametrize("body", [DISC, SEGMENT, SLED, ROD, *OTHERS.values()])
def test_an_outline_is_convex_and_touches_where_the_kernel_says(body: Body) -> None:
    """Oracle: the support height of the kernel, in all directions, which is all that there is of a convex outline."""
    for phi in np.linspace(-7.0, 7.0, 57).tolist():
        points = shapes.body_outline(body, 3.0, 1.0, phi, 4001)
        assert points[:, 1].min() == pytest.approx(1.0 - support_height(body, phi), abs=1e-6)
    assert points[0].tolist() == points[-1].tolist()
    edges = np.diff(points, axis=0)
    turns = edges[:, 0] * np.roll(edges[:, 1], -1) - edges[:, 1] * np.roll(edges[:, 0], -1)
    assert turns.min() > -1e-12  # counterclockwise
    assert body.size == pytest.approx(np.hypot(*(points - (3.0, 1.0)).T).max(), rel=1e-5)


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_below_the_mass_centre_at_phi_0_is_darker(name: str) -> None:
    """Oracle: what both sides of the line through the mass centre have together; the line turns with the body."""
    phi, centre = 2.2, (3.0, 2.0)
    whole, lower = (draw(OTHERS[name], *centre, phi, 401) for draw in (shapes.body_outline, shapes.heavy_side))
    up = np.array([-math.sin(phi), math.cos(phi)])
    heights = (lower - centre) @ up
    assert lower[0].tolist() == lower[-1].tolist()
    assert heights.max() == pytest.approx(0.0, abs=1e-12)
    assert heights.min() == pytest.approx(((whole - centre) @ up).min())
    if name != "line":
        grid = np.stack(np.meshgrid(*2 * [np.linspace(-1.0, 1.0, 400)]), axis=-1).reshape(-1, 2)
        within = matplotlib.path.Path(whole - centre).contains_points(grid)
        share = (within & (grid @ up < 0.0)).sum() / within.sum()
        assert shoelace(lower)[0] / shoelace(whole)[0] == pytest.approx(share, abs=0.01)


def test_the_slope_descends_to_the_right_in_the_world() -> None:
    """Oracle: a point L down a slope of angle beta lies L cos(beta) to the right and L sin(beta) lower."""
    assert shapes.to_world([(2.0, 0.0)], 0.3)[0] == pytest.approx([2.0 * math.cos(0.3), -2.0 * math.sin(0.3)])
    assert shapes.to_world([(0.0, 1.0)], 0.3)[0] == pytest.approx([math.sin(0.3), math.cos(0.3)])


def test_states_between_sparse_rows_follow_the_parabola() -> None:
    """Oracle: a body in free flight; the velocities that the rebound recorded before and after a rigid impact."""
    launch, g = State(1.0, 50.0, 0.3, 2.0, 5.0, -4.0), 9.81 * np.array([math.sin(0.2), -math.cos(0.2)])
    sparse = sledenv.Settings(solver="rigid", sample_interval=10.0, max_time=8.0)
    descent = simulate(DISC, ICE, Slope(0.2, math.inf), launch, sparse, record="trajectory")
    rows, rebound = drawable_rows(descent), descent.rebounds[0]
    t = np.linspace(0.0, float(rebound["t_touchdown"]), 24)[:-1]
    assert np.count_nonzero(rows["t"] <= t[-1]) < len(t)
    x, y, phi, u, v, omega = states_at(rows, t).T
    assert x == pytest.approx(1.0 + 2.0 * t + 0.5 * g[0] * t**2)
    assert y == pytest.approx(50.0 + 5.0 * t + 0.5 * g[1] * t**2)
    assert phi == pytest.approx(0.3 - 4.0 * t)
    assert (u, v) == (pytest.approx(2.0 + g[0] * t), pytest.approx(5.0 + g[1] * t))
    assert omega == pytest.approx(-4.0)
    before, after = states_at(rows, [rebound["t"] * (1.0 - 1e-12), rebound["t"]])
    for state, when in ((before, "before"), (after, "after")):
        assert state[3:] == pytest.approx([rebound[f"{name}_{when}"] for name in ("u", "v", "omega")])


@pytest.mark.parametrize("solver", ["compliant", "rigid"])
@pytest.mark.parametrize("name", SETTINGS)
def test_contacts_of_any_body_begin_where_the_descent_recorded_it(name: str, solver: str) -> None:
    """Oracle: the place that the kernel wrote at touchdown."""
    descent = descent_of(name, solver)
    assert len(descent.rebounds) > 3
    begins = [path[0, 0] for path in shapes.contact_paths(descent)]
    assert begins == pytest.approx(descent.rebounds["x_contact"], abs=1e-6)


def test_a_strobe_is_regular_in_time_and_leaves_out_a_sled_at_rest(slides: Descent, jams: Descent) -> None:
    moving = shapes.strobe_times(SEGMENT, slides.trajectory, 0.2)
    assert moving[-1] == slides.time
    assert np.isin(moving, np.append(np.arange(0.0, slides.time, 0.2), slides.time)).all()
    assert len(moving) > 5
    assert len(shapes.strobe_times(DISC, jams.trajectory, jams.time / 1000.0)) < 60


def test_a_strobe_figure_has_a_titled_panel_a_descent_to_one_scale(slides: Descent, jams: Descent) -> None:
    figure = plot.plot_strobe([jams, slides], labels=["mat", "ice"])
    panels = figure.axes[:2]
    for ax, name, descent in zip(panels, ("mat", "ice"), (jams, slides), strict=True):
        reward = float(descent.jam.reward)
        expected = f"{name}: {descent.status} after {descent.time:.2f} s, reward {reward:.2f}"
        assert ax.get_title(loc="left") == expected
        assert ax.get_aspect() == 1.0
    assert panels[0].get_xlim() == panels[1].get_xlim()
    low, high = panels[0].get_xlim()
    assert low < 0.0
    assert high > 10.0 * math.cos(0.1)  # the finish
    assert figure.axes[2].get_ylabel() == "speed [m/s]"


@pytest.mark.parametrize("length", [20.0, 60.0, 2000.0])
def test_a_long_descent_is_cut_into_rows_in_which_the_body_can_be_seen(length: float) -> None:
    """Oracle: the rows follow each other, of one scale, up to where the body stops; thirty bodies fit into one."""
    mat = Zone(0.9 * length, math.inf, 0.6, 0.0)
    law = ContactLaw.from_restitution(0.3, stiffness=1e6, friction=0.0, rolling_arm=0.0)
    body, launch = sledenv.disc(50.0, 0.5), State(0.0, 0.6, 0.0, 8.0)
    descent = simulate(body, law, Slope(0.02, length, zones=[mat]), launch, record="trajectory", max_time=5.0)
    panels = plot.plot_strobe(descent).axes[:-1]
    limits = np.array([ax.get_xlim() for ax in panels])
    assert len(panels) == {20.0: 2, 60.0: 5, 2000.0: 2}[length]
    assert limits[1:, 0] == pytest.approx(limits[:-1, 1])
    assert np.ptp(limits, axis=1).max() <= 30.0 * 2.0 * body.size
    assert limits[0, 0] < 0.0
    assert limits[-1, 0] < shapes.to_world(descent.state[:2], 0.02)[0] < limits[-1, 1]
    assert [bool(ax.get_title("left")) for ax in panels] == [True] + [False] * (len(panels) - 1)
    for ax in panels:
        path = next(line.get_xydata() for line in ax.lines if line.get_zorder() == 8)
        low, high = ax.get_ylim()
        inside = (path[:, 0] >= ax.get_xlim()[0]) & (path[:, 0] <= ax.get_xlim()[1])
        assert (low < path[inside, 1]).all()
        assert (path[inside, 1] + body.size < high).all()


def curve(figure: Figure, panel: int) -> tuple[np.ndarray, np.ndarray]:
    line = figure.axes[panel].lines[-1]
    return np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)


def test_the_moment_of_an_impact_turns_the_body(impact: Descent) -> None:
    """Oracle: Euler's law, J domega = moment dt, and T = 50 J at launch; times are in milliseconds."""
    figure = plot.plot_impact(impact)
    t, moment = curve(figure, 2)
    assert np.trapezoid(moment, 1e-3 * t) == pytest.approx(impact.body.inertia * impact.state.omega, rel=0.02)
    _, force = curve(figure, 0)
    assert np.trapezoid(force, 1e-3 * t) == pytest.approx(impact.state.v + 10.0, rel=0.02)
    _, kinetic = curve(figure, 3)
    assert kinetic[[0, -1]] == pytest.approx([50.0, impact.energy.kinetic])
    assert figure.axes[2].get_xlabel() == "time [ms]"


@pytest.mark.parametrize("name", ["slides", "jams", "impact", "lands_flat", "rigid"])
def test_the_energy_layers_of_a_descent_add_up_at_all_times(name: str, request: pytest.FixtureRequest) -> None:
    """Oracle: conservation; kinetic, potential, stored and lost energy come from different columns; the ledger."""
    descent: Descent = request.getfixturevalue(name)
    figure = plot.plot_descent(descent, label=name)
    assert figure.axes[0].get_title("left").startswith(f"{name}: {descent.status} after ")
    top = figure.axes[3].collections[-1].get_paths()[0].vertices
    sums = np.array([top[top[:, 0] == when, 1].max() for when in descent.trajectory["t"]])
    assert sums == pytest.approx(sums[0], rel={"lands_flat": 1e-3, "rigid": 0.03}.get(name, 0.02))
    assert [ax.get_ylabel().split()[0] for ax in figure.axes] == ["u", "v", "ω", "energy"]
    layers = energy_layers(descent, drawable_rows(descent))
    assert layers["translation"][-1] + layers["rotation"][-1] == pytest.approx(descent.energy.kinetic)
    for kind in ("hysteresis", "sliding", "rolling"):
        assert layers[f"lost by {kind}"][-1] == pytest.approx(getattr(descent.energy, kind), abs=1e-12)
        assert (np.diff(layers[f"lost by {kind}"]) >= -1e-9).all()


def test_the_forces_on_a_block_that_slides_flat_do_not_turn_it() -> None:
    """Oracle: Euler's law: its spin is zero throughout."""
    launch = State(0.0, 0.2, 0.0, 3.0)
    descent = simulate(BLOCK, STEEL, Slope(0.1, 50.0), launch, solver="rigid", record="trajectory")
    assert (descent.trajectory["omega"] == 0.0).all()
    assert curve(plot.plot_impact(descent), 2)[1] == pytest.approx(0.0, abs=1e-12 * BLOCK.mass * 9.81)


def test_no_labels_overlap(slides: Descent, jams: Descent, impact: Descent) -> None:
    """Oracle: their boxes: titles, axis labels, tick labels and legends, at the width of a README, none cut off."""
    figures = [
        plot.plot_strobe([jams, slides, jams], labels=list("abc")),
        plot.plot_impact(impact),
        plot.plot_slip(jams),
    ]
    figures += [plot.plot_descent(jams), plot.plot_impulse_plane(DISC, ICE, State(0, 0, 0.4, 1, -2, 3))]
    for figure in figures:
        FigureCanvasAgg(figure).draw()
        boxes = [legend.get_window_extent() for legend in figure.legends]
        for ax in figure.axes:
            low, high = ax.get_ylim()
            ticks = [tick.label1 for tick in ax.yaxis.get_major_ticks() if low <= tick.get_loc() <= high]
            shown = [*ticks, ax.yaxis.label, ax.xaxis.label, ax._left_title]  # type: ignore[attr-defined]
            boxes += [text.get_window_extent() for text in shown if text.get_text() and text.get_visible()]
        assert figure.dpi * figure.get_figwidth() == pytest.approx(900.0)
        for one, other in itertools.combinations(boxes, 2):
            assert not one.padded(-0.5).overlaps(other), (one, other)
        for box in boxes:
            assert figure.bbox.padded(1.0).count_contains(box.corners()) == 4


def in_the_plane(figure: Figure) -> np.ndarray:
    """Corners of the path in the impulse plane: normal and tangential impulse, shape (n, 2)."""
    pieces = [line.get_xydata() for line in figure.axes[0].lines if line.get_linewidth() == 2.4]
    return np.concatenate([[piece[0] for piece in pieces], pieces[-1][-1:]])


@pytest.mark.parametrize("body", [DISC, ROD, CRATE])
def test_the_path_in_the_impulse_plane_ends_with_the_impulses_and_stays_in_the_cone(body: Body) -> None:
    """Oracle: the impulses of rigid_impact, which the figure does not read but for its scale; Coulomb's law."""
    rng = np.random.default_rng(1)
    seen = set()
    for _ in range(25):
        law = ContactLaw(1e6, 0.5, rng.uniform(0.0, 1.5), *rng.uniform(0.0, 0.05, 2))
        state = State(0.0, 0.0, rng.uniform(-3.0, 3.0), rng.uniform(-2.0, 2.0), -5.0, rng.uniform(-4.0, 4.0))
        impact = sledenv.rigid_impact(body, law, state)
        if not impact.phases:
            continue
        path = in_the_plane(plot.plot_impulse_plane(body, law, state))
        assert path[0].tolist() == [0.0, 0.0]
        assert path[-1] == pytest.approx([impact.normal_impulse, impact.tangential_impulse], abs=1e-9 * body.mass)
        assert (np.abs(path[:, 1]) <= law.friction * path[:, 0] * (1.0 + 1e-12)).all()
        seen |= {phase.slip for phase in impact.phases}
    assert seen == {-1, 0, 1}


def test_slip_and_stick_are_shaded_where_they_are(jams: Descent) -> None:
    """Oracle: the trajectory: the sign of slip is 0 where the body sticks, and F = -f N sgn(v_t) elsewhere."""
    figure = plot.plot_slip(jams)
    rows = jams.trajectory
    spans = list(figure.axes[0].patches)
    sticks = [patch for patch in spans if patch.get_facecolor()[:3] == pytest.approx((0.0, 0.62, 0.45), abs=0.01)]
    shaded = sum(patch.get_width() for patch in sticks)
    stuck = (rows["feature"][1:] > 0) & (rows["slip"][1:] == 0) & (rows["slip"][:-1] == 0) & (rows["feature"][:-1] > 0)
    assert shaded == pytest.approx(np.diff(rows["t"])[stuck].sum())
    assert 0.0 < shaded < sum(patch.get_width() for patch in spans)
    used = figure.axes[1].lines[1].get_ydata()
    slipping = (rows["slip"] != 0) & (rows["normal"] > 1e-12 * rows["normal"].max())  # not the rounding of a zero
    assert used[slipping] == pytest.approx(-rows["slip"][slipping])
    assert np.nanmax(np.abs(used)) <= 1.0 + 1e-9


@pytest.mark.parametrize("solver", ["rigid", "compliant"])
def test_friction_is_used_up_where_a_block_slides_into_a_zone_and_out_of_it(solver: Any) -> None:
    """Oracle: F = -f N with the friction of either side, also in the rows at the borders."""
    mat = Slope(math.radians(10.0), 50.0, zones=[Zone(3.0, 4.5, 0.5, 0.0)])
    launch = State(0.0, 0.2, 0.0, 6.0)
    descent = simulate(BLOCK, STEEL, mat, launch, solver=solver, max_time=1.5, record="trajectory")
    assert descent.state.x > 6.0
    for line in plot.plot_slip(descent).axes[1].lines[1:3]:
        used = np.asarray(line.get_ydata(), float)
        assert used[~np.isnan(used)] == pytest.approx(-1.0, abs=1e-6)
        assert np.count_nonzero(~np.isnan(used)) > 50


def test_text_is_drawn_as_it_stands(slides: Descent) -> None:
    """Oracles: two dollars are no formula, matplotlib's own parser; figures with LaTeX in the settings, as without."""
    notes = {"a $ b $ c": r"a \$ b \$ c", "$x$": r"\$x\$", "one $": r"one \$", "none": "none"}
    assert {text: plain(text) for text in notes} == notes
    body = polygon(40.0, [(-0.4, -0.3), (0.4, -0.3), (0.4, 0.3), (-0.4, 0.3)], sides=["$a$", "$b^$", "$", "d"])
    crate = run(body, ICE, HILL, (0.0, 0.2, 0.0, 2.0, 0.0, 0.0))
    cells = np.zeros((3, 3)), np.zeros((3, 3), bool)

    def draw() -> list[np.ndarray]:
        grid = np.linspace(0.0, 1.0, 3)
        maps = plot.plot_jam_map(grid, grid, {"$x^$": cells}, mark=(0.0, 0.0, "$_$"), note="$\\nothing$")
        figures = [plot.plot_strobe(slides, labels=["$^$"]), plot.plot_velocities(slides, note="$_$"), maps]
        figures += [plot.plot_impact(crate), plot.plot_slip(crate), plot.plot_descent(crate, label="$_$")]
        return [pixels(figure) for figure in figures]

    pictures = draw()
    with matplotlib.rc_context({"text.usetex": True}):
        for one, other in zip(pictures, draw(), strict=True):
            assert (one == other).all()


def test_growth_is_drawn_over_the_rebounds() -> None:
    """Oracle: the singular values and distances of the result, the latter in its natural units."""
    body = segment(1.0, 0.1, 0.05, 7.5e-3)
    found = sledenv.sensitivity(body, ICE, HILL, State(0.0, 0.6, 0.7, 1.0, 0.0, 2.0), sledenv.Settings(max_rebounds=4))
    figure = plot.plot_growth(found)
    above, below = figure.axes
    assert above.get_yscale() == below.get_yscale() == "log"
    assert above.lines[0].get_xdata().tolist() == [1, 2, 3, 4]
    assert above.lines[0].get_ydata() == pytest.approx(found.growth[:, 0])
    drawn = {line.get_label(): line.get_ydata() for line in below.lines}
    distances = found.distances[:-1, found.parameters.index("u")].min(axis=-1)
    distances[np.isinf(distances)] = np.nan
    assert drawn["u"] == pytest.approx(distances / found.units[3], nan_ok=True)
    figure.savefig(io.BytesIO(), dpi=40)


def test_wrong_arguments_of_figures_are_named(slides: Descent, jams: Descent) -> None:
    """Oracle: the words of each error."""
    bare, flight = simulate(DISC, ICE, HILL, State(0.0, 1.0, 0.0)), State(0.0, 2.0, 0.0, 5.0)
    before = 0.9 * float(jams.rebounds["t_touchdown"][0])
    grid, cells = np.zeros(2), np.zeros((3, 3))
    flown = sledenv.sensitivity(DISC, ICE, Slope(0.0, 1.0), flight)
    refused: list[tuple[Any, str]] = [
        (lambda: plot.plot_strobe([]), "descents is empty"),
        (lambda: plot.plot_strobe(slides, labels=["a", "b"]), "2 labels for 1 descents"),
        (lambda: plot.plot_strobe(slides, frames=1), "frames = 1: must be an integer >= 2"),
        (lambda: plot.plot_strobe(slides, between=(-9.0, -8.0)), r"between = \(-9.0, -8.0\): a descent has nothing"),
        (lambda: plot.plot_strobe(bare), 'record="trajectory"'),
        (lambda: plot.plot_impact(slides, 5.0, 4.0), "start = 5.0, stop = 4.0: fewer than two rows"),
        (lambda: plot.plot_slip(jams, 0.0, before), "flies all the time"),
        (lambda: plot.plot_impulse_plane(DISC, ICE, flight), "does not approach"),
        (lambda: plot.plot_impact_phases(descent_of("line", "rigid")), "no first contact that takes time"),
        (lambda: plot.plot_growth(flown), "no rebound"),
        (lambda: plot.plot_mode_map(grid, grid, {}), "panels is empty"),
        (lambda: plot.plot_mode_map(grid, grid, {"a": cells}), r"'a' has shape \(3, 3\): must be \(2, 2\)"),
    ]
    for draw, words in refused:
        with pytest.raises(ValueError, match=words):
            draw()


def test_a_missing_matplotlib_is_named(slides: Descent, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match=r"sledenv\[plot\]"):
        plot.plot_strobe(slides)


def test_importing_the_package_needs_neither_matplotlib_nor_pygame() -> None:
    program = "import sys; sys.modules.update(matplotlib=None, pygame=None); import sledenv.plot, sledenv.envs.viewer"
    paths = [str(Path(sledenv.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
    subprocess.run([sys.executable, "-c", program], check=True, env=environment)
