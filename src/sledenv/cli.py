"""The command ``sledenv``: descents, what they depend on, laws from recordings, paper, benchmark, installation."""

from __future__ import annotations

import argparse
import math
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn, get_args

import numpy as np

from sledenv.checks import BatchSolver, Solver
from sledenv.derivatives import sensitivity
from sledenv.descent import Descent, Record, simulate
from sledenv.doctor import examine
from sledenv.files import publish, replacing, write_csv
from sledenv.impact import Hypothesis
from sledenv.params import Body, ContactLaw, Slope, State
from sledenv.replay import replay_page
from sledenv.reproduce import reproduce
from sledenv.scenario import control_words, load_scenario, scenario_names, shipped_names
from sledenv.text import TRAJECTORY_COLUMNS, sensitivity_table, setting, story, trajectory_rows

if TYPE_CHECKING:
    import pandas as pd

PICTURES = ("strobe.png", "series.png")
_DPI = 150
_SOLVER: Solver = "compliant"  # unless another is asked for
_USAGE = 2  # exit status of a wrong argument, as argparse has it
_BROKEN_PIPE = 141
_BENCHMARK = 'pip install "sledenv[benchmark]", for the shipped agents "sledenv[agents]"'


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the command line by default.

    Returns
    -------
    int
        Exit status: 0; 1 if ``doctor`` finds something wrong; 2 with a message on standard error where an argument is
        wrong or a file cannot be written; 130 and 143 after an interrupt and a request to terminate, which leave
        nothing behind.
    """
    options = _parser().parse_args(arguments)
    before = signal.signal(signal.SIGTERM, _terminate)  # or the folder being written would stay
    try:
        status: int = options.run(options)
        sys.stdout.flush()
    except BrokenPipeError:  # the reader, head for one, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _BROKEN_PIPE
    except (ValueError, OSError, ImportError) as error:  # a wrong scenario, suite or run
        print(f"sledenv {options.command}: error: {error}", file=sys.stderr)
        return _USAGE
    except KeyboardInterrupt:
        print(f"sledenv {options.command}: interrupted", file=sys.stderr)
        return 128 + signal.SIGINT
    finally:
        signal.signal(signal.SIGTERM, before)
    return status


def _terminate(number: int, frame: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="sledenv", description="Sled descents as repeated oblique impacts.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    one = commands.add_parser(
        "simulate",
        help="simulate one descent of a scenario",
        description="Simulate one descent and print what was simulated, the rebounds, how it ended, jam metrics and "
        "energy ledger. Positions are those of the mass centre in the frame of the slope: x downhill, y along the "
        "outward normal, angles counter-clockwise.",
    )
    one.set_defaults(run=_simulate)
    _add_descent(one)
    one.add_argument("--out", type=Path, metavar="FOLDER", help=f"write {' and '.join(PICTURES)} into this folder")
    one.add_argument(
        "--csv",
        type=Path,
        metavar="FILE",
        help=f"write the trajectory as this table, units in the header: {', '.join(TRAJECTORY_COLUMNS.values())}",
    )

    derived = commands.add_parser(
        "sensitivity",
        help="differentiate one descent of a scenario",
        description="Print the derivatives of how a descent ends by launch, law, slope and body, with the change of "
        "each from which on its events are others; and how small differences grow, rebound by rebound.",
    )
    derived.set_defaults(run=_sensitivity)
    _add_descent(derived, get_args(BatchSolver))
    derived.add_argument("--rebounds", type=_positive, default=10, metavar="N", help="at most so many (default 10)")
    derived.add_argument("--out", type=Path, metavar="FILE", help="draw the growth of differences into this picture")

    packs = commands.add_parser(
        "scenarios",
        help="list the shipped scenarios",
        description="List the shipped scenarios: name, what an agent chooses, solver, and what is asked.",
    )
    packs.set_defaults(run=_scenarios)

    film = commands.add_parser(
        "replay",
        help="write a page that replays one descent of a scenario",
        description="Simulate one descent and write a page that replays it in any browser, offline: the sled with its "
        "contact force, time series, rebound table.",
    )
    film.set_defaults(run=_replay)
    _add_descent(film)
    film.add_argument("--out", type=Path, metavar="FILE", default=Path("replay.html"), help="default: replay.html")

    paper = commands.add_parser(
        "reproduce",
        help="compute every number and figure of the paper",
        description="Compute everything quantitative in the paper: figures, maps, and a table of its numbers and ours.",
    )
    paper.set_defaults(run=_reproduce)
    paper.add_argument("--out", type=Path, metavar="FOLDER", default=Path("reproduction"), help="default: reproduction")

    judged = commands.add_parser(
        "benchmark",
        help="train and judge the agents of a suite, and write the report",
        description="Train and judge every agent of a suite on every scenario, gather the numbers as Parquet files and "
        "write the report. What has been done already is kept, so that a run which was stopped goes on.",
    )
    judged.set_defaults(run=_benchmark)
    judged.add_argument(
        "--suite",
        default="smoke",
        metavar="SUITE",
        help="smoke, full, trims, or a file that ends in .yaml (default smoke)",
    )
    judged.add_argument("--out", type=Path, metavar="FOLDER", help="default: runs/benchmark/SUITE")
    _add_workers(judged)

    uncertain = commands.add_parser(
        "study",
        help="tell what uncertain launches, laws, slopes and bodies mean for the descent",
        description="Draw what a study calls uncertain, simulate a descent for each draw, and tell how they end, with "
        "quantiles, envelopes along the slope and Sobol indices. A study that was stopped goes on where it was, and so "
        "does one with more launches.",
    )
    uncertain.set_defaults(run=_study)
    uncertain.add_argument(
        "study", metavar="STUDY", help=f"{', '.join(shipped_names('study'))}, or a file that ends in .yaml"
    )
    uncertain.add_argument("--out", type=Path, metavar="FOLDER", help="default: runs/study/STUDY")
    uncertain.add_argument(
        "--launches", type=_positive, metavar="N", help="at least so many (default: what the study says)"
    )
    _add_workers(uncertain)

    landscape = commands.add_parser(
        "map",
        help="draw the jam map of a context, the reward of every launch, or make it a page to play them",
        description="Draw the reward of all launches of one context, with the best one and what trained agents choose; "
        "or write a page for any browser, offline, that plays the descent of each of them.",
    )
    landscape.set_defaults(run=_map)
    _add_scenario(landscape)
    landscape.add_argument(
        "--run",
        dest="runs",
        type=Path,
        action="append",
        metavar="RUN",
        help="folder of a trained agent; may be repeated (default of a page: the shipped one, if it is here)",
    )
    landscape.add_argument(
        "--out", type=Path, metavar="FILE", help="picture (default: map.png, unless --html is given)"
    )
    landscape.add_argument("--html", type=Path, metavar="FILE", help="write this page")
    landscape.add_argument(
        "--seeds",
        type=_seed,
        nargs="+",
        metavar="SEED",
        help="contexts to page through in it (default: that of --seed)",
    )

    measured = commands.add_parser(
        "identify",
        help="fit a contact law to measured rebounds, or to poses over time",
        description="Fit restitution, friction and rolling arms to what was measured of one body, and print them with "
        "their intervals. Columns of a table of rebounds, with their units: u_before_m_s, v_before_m_s, "
        "omega_before_rad_s, the same with after, and phi_rad or the arms a_m and b_m of the contact. Of poses over "
        "time: t_s, x_m, y_m and phi_rad, in the frame of the slope. recording, which tells recordings apart, is "
        "optional.",
    )
    measured.set_defaults(run=_identify)
    measured.add_argument("file", type=Path, metavar="FILE", help="that ends in .csv or .parquet")
    measured.add_argument(
        "--gyration-radius", type=_length, required=True, metavar="M", help="root of inertia over mass [m]"
    )
    measured.add_argument("--radius", type=_length, metavar="M", help="of the arc [m], for a table with phi_rad")
    measured.add_argument(
        "--eccentricity", type=float, default=0.0, metavar="M", help="of the mass centre in the arc [m] (default 0)"
    )
    measured.add_argument(
        "--half-angle-deg", type=float, default=180.0, metavar="DEG", help="of the arc (default 180: no corners)"
    )
    _add_tracks(measured)
    measured.add_argument("--hypothesis", choices=get_args(Hypothesis), default="energetic", help="of restitution")
    measured.add_argument(
        "--fix",
        type=_fixed,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="do not fit this parameter: restitution, friction, rolling_arm, corner_rolling_arm; may be repeated",
    )
    measured.add_argument("--softening", action="store_true", help="let the restitution depend on the approach speed")
    measured.add_argument("--compare", action="store_true", help="cross-validate other laws too")
    measured.add_argument("--folds", type=_positive, default=10, metavar="N", help="parts for that (default 10)")
    measured.add_argument("--starts", type=_positive, default=16, metavar="N", help="of the fit (default 16)")
    measured.add_argument("--seed", type=_seed, default=0, help="of starts and folds (default 0)")
    measured.add_argument("--out", type=Path, metavar="FOLDER", help="write tables and figures into this folder")

    doctor = commands.add_parser(
        "doctor",
        help="compile all kernels beforehand and check the installation",
        description="Compile all kernels into the cache, so that nothing is compiled on first use; report versions, "
        "processor, threads and cache; check results that are known. Ends with status 1 if something is wrong.",
    )
    doctor.set_defaults(run=_doctor)
    return parser


def _add_workers(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say who does the work."""
    parser.add_argument("--workers", type=_positive, metavar="N", help="processes (default: one a core)")
    parser.add_argument(
        "--ray", metavar="ADDRESS", help='use the Ray cluster at this address instead, or start one here: "local"'
    )


def _add_tracks(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of ``identify`` that only poses over time need."""
    tracks = parser.add_argument_group("for poses over time", "these need --radius and --slope-deg")
    tracks.add_argument("--slope-deg", type=_within(89.0, "deg"), metavar="DEG", help="inclination; x runs downhill")
    tracks.add_argument("--gravity", type=_length, default=9.81, metavar="M_S2", help="default 9.81")
    tracks.add_argument(
        "--mass", type=_length, default=1.0, metavar="KG", help="stiffness is in proportion (default 1)"
    )
    tracks.add_argument(
        "--surfaces", choices=get_args(BatchSolver), default="rigid", help="compliant fits a stiffness too"
    )
    tracks.add_argument("--position-noise", type=_length, metavar="M", help="standard deviation (default: estimated)")
    tracks.add_argument("--angle-noise-deg", type=_length, metavar="DEG", help="the same of the orientation")


def _add_scenario(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that say which context is meant."""
    parser.add_argument(
        "scenario", metavar="SCENARIO", help=f"{', '.join(scenario_names())}, or a file that ends in .yaml"
    )
    parser.add_argument("--seed", type=_seed, default=0, help="which context of the scenario is drawn (default 0)")


def _add_descent(parser: argparse.ArgumentParser, solvers: Sequence[str] = get_args(Solver)) -> None:
    """Add the arguments that say which descent is meant."""
    _add_scenario(parser)
    parser.add_argument(
        "--orientation-deg",
        type=_within(360.0, "deg"),
        metavar="DEG",
        help="launch orientation instead of the drawn one",
    )
    parser.add_argument(
        "--spin", type=_within(1e6, "rad/s"), metavar="RAD_S", help="launch spin [rad/s] instead of the drawn one"
    )
    parser.add_argument(
        "--speed", type=_within(1e6, "m/s"), metavar="M_S", help="launch speed [m/s] instead of the drawn one"
    )
    parser.add_argument(
        "--solver",
        choices=solvers,
        default=_SOLVER,
        help=f"contact model (default {_SOLVER}; rigid ignores the stiffness)",
    )


def _within(most: float, unit: str) -> Callable[[str], float]:
    """Return what reads a number in [-most, most]."""

    def number(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not abs(value) <= most:
            raise argparse.ArgumentTypeError(f"must be a finite number in [-{most:g}, {most:g}] {unit}: {text!r}")
        return value

    return number


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"must be an integer >= 0: {text!r}")
    return int(text)


def _positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be an integer >= 1: {text!r}")
    return int(text)


def _length(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"must be a number > 0 m: {text!r}")
    return value


def _fixed(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be NAME=VALUE: {text!r}") from None


def _progress(command: str) -> Callable[[str], None]:
    return lambda line: print(f"{command}: {line}", flush=True)


def _reproduce(options: argparse.Namespace) -> int:
    progress = _progress("reproduce")
    folder = reproduce(options.out, progress=progress)
    progress(f"wrote {folder / 'index.md'}")
    return 0


def _benchmark(options: argparse.Namespace) -> int:
    with _extra():
        from sledenv.benchmark.report import write_report
        from sledenv.benchmark.runner import run_suite
        from sledenv.benchmark.scores import read_results
        from sledenv.benchmark.suite import Suite, find_suite

    file = find_suite(options.suite)
    suite = Suite.read(file)
    folder = run_suite(
        suite,
        file,
        options.out or Path("runs/benchmark") / suite.id,
        workers=options.workers,
        ray=options.ray,
    )
    page = write_report(read_results(folder), folder / "report")
    _progress("benchmark")(f"wrote {page}")
    return 0


def _study(options: argparse.Namespace) -> int:
    from sledenv import load_study, study

    given = load_study(options.study)
    out = options.out or Path("runs/study") / given.id
    result = study(given, out, launches=options.launches, workers=options.workers, ray=options.ray)
    print(f"{given.id}, {result.launches} launches, solver {given.solver}: {given.question or given.title}")
    print(result.words)
    _progress("study")(f"wrote {out}")
    return 0


def _map(options: argparse.Namespace) -> int:
    with _extra():
        from sledenv.benchmark.landscape import landscape
        from sledenv.benchmark.map_page import map_page

    if options.seeds is not None and options.html is None:
        raise ValueError(f"--seeds = {options.seeds}: only a page has several contexts, see --html")
    picture = options.out or (None if options.html else Path("map.png"))
    with ExitStack() as places:
        page = options.html and _place(places, "--html", replacing(options.html, ".html", ".htm"))
        drawing = picture and _place(places, "--out", replacing(picture, ".png"))
        if drawing:
            drawn = landscape(options.scenario, options.seed, options.runs or [])
            drawn.figure.savefig(drawing, dpi=_DPI, format="png")
            words = drawn.words
        if page:
            made = map_page(options.scenario, options.seeds or [options.seed], options.runs)
            page.write_text(made.html, encoding="utf-8")
            words = made.words
    print(words)
    for file in filter(None, (picture, options.html)):
        _progress("map")(f"wrote {file}")
    return 0


def _identify(options: argparse.Namespace) -> int:
    with _extra('pip install "sledenv[analysis]"'):
        from sledenv.identification.choice import holds_tracks
        from sledenv.identification.comparison import compare
        from sledenv.identification.rebounds import identify, read_table
        from sledenv.identification.report import COMPARED, FILES, write_identification

    table = read_table(options.file)
    if holds_tracks(table):
        return _identify_tracks(options, table)
    k = options.gyration_radius
    body = None
    if options.radius is not None:
        body = Body(1.0, options.radius, options.eccentricity, k * k, math.radians(options.half_angle_deg))
    with ExitStack() as places:
        folder = options.out and _place(places, "--out", publish(options.out, (*FILES, *COMPARED)))
        found = identify(
            table,
            body,
            gyration_radius=None if body else k,
            hypothesis=options.hypothesis,
            fixed=dict(options.fix),
            speed_dependent=options.softening,
            starts=options.starts,
            seed=options.seed,
        )
        print(found, flush=True)
        compared = compare(found.rebounds, folds=options.folds, seed=options.seed) if options.compare else None
        if compared is not None:
            print(f"\nerrors on rebounds held out\n{compared.table.round(4).to_string()}")
            print(f"\nand how much larger than the best\n{compared.differences().round(4).to_string()}")
        if folder:
            write_identification(found, folder, compared)
    if folder:
        _progress("identify")(f"wrote {options.out}")
    return 0


def _identify_tracks(options: argparse.Namespace, table: pd.DataFrame) -> int:
    from sledenv.identification.report import track_files, write_tracks
    from sledenv.identification.tracks import identify_tracks

    for name in ("radius", "slope_deg"):
        if getattr(options, name) is None:
            raise ValueError(f"--{name.replace('_', '-')}: poses over time need it")
    noise = options.position_noise, options.angle_noise_deg
    if (noise[0] is None) != (noise[1] is None):
        raise ValueError("--position-noise, --angle-noise-deg: both must be given, or none")
    inertia = options.mass * options.gyration_radius**2
    half_angle = math.radians(options.half_angle_deg)
    body = Body(options.mass, options.radius, options.eccentricity, inertia, half_angle)
    with ExitStack() as places:
        files = track_files(table["recording"].nunique() if "recording" in table else 1)
        folder = options.out and _place(places, "--out", publish(options.out, files))
        found = identify_tracks(
            table,
            body,
            Slope(math.radians(options.slope_deg), gravity=options.gravity),
            solver=options.surfaces,
            fixed=dict(options.fix),
            noise=None if noise[0] is None else (noise[0], math.radians(noise[1])),
            seed=options.seed,
        )
        print(found, flush=True)
        if folder:
            write_tracks(found, folder)
    if folder:
        _progress("identify")(f"wrote {options.out}")
    return 0


@contextmanager
def _extra(extras: str = _BENCHMARK) -> Iterator[None]:
    """Say what to install where a package is missing that a simulation does not need."""
    try:
        yield
    except ModuleNotFoundError as error:
        raise ImportError(f"{error}: this command needs {extras}") from error


def _doctor(options: argparse.Namespace) -> int:
    problems = examine(partial(print, flush=True))
    for problem in problems:
        print(f"sledenv doctor: {problem}", file=sys.stderr)
    print("something is wrong" if problems else "all is well")
    return int(bool(problems))


def _simulate(options: argparse.Namespace) -> int:
    if options.out is not None and options.csv is not None and options.csv.parent.resolve() == options.out.resolve():
        raise ValueError(f"--csv = {options.csv}: must lie outside {options.out}, which --out replaces as a whole")
    with ExitStack() as places:  # taken before anything is simulated
        table = options.csv and _place(places, "--csv", replacing(options.csv, ".csv"))
        folder = options.out and _place(places, "--out", publish(options.out, PICTURES))
        title, descent = _descend(options, "trajectory" if table or folder else "rebounds")
        if table:
            write_csv(table, list(TRAJECTORY_COLUMNS.values()), trajectory_rows(descent))
        if folder:
            _draw(descent, folder)
    print(title)
    print(story(descent))
    if table:
        columns = ", ".join(TRAJECTORY_COLUMNS.values())
        _progress("simulate")(f"wrote {len(descent.trajectory)} rows into {options.csv}\n  columns {columns}")
    if folder:
        _progress("simulate")(f"wrote {' and '.join(PICTURES)} into {options.out}")
    return 0


def _sensitivity(options: argparse.Namespace) -> int:
    with ExitStack() as places:
        picture = options.out and _place(places, "--out", replacing(options.out, ".png"))
        title, given, limits = _asked(options)
        found = sensitivity(*given, rebounds=options.rebounds, **limits)
        if picture:
            from sledenv.plot import plot_growth

            plot_growth(found).savefig(picture, dpi=_DPI, format="png")
    print(title)
    print(f"{setting(*given)}\n\n{sensitivity_table(found)}")
    if picture:
        _progress("sensitivity")(f"wrote {options.out}")
    return 0


def _place(places: ExitStack, option: str, place: AbstractContextManager[Path]) -> Path:
    """Take a place to write to; what is wrong with it is said of the option."""
    try:
        return places.enter_context(place)
    except OSError as error:
        raise OSError(f"{option}: {error}") from error


def _scenarios(options: argparse.Namespace) -> int:
    table = [("name", "agent chooses", "solver", "what is asked")]
    for name in scenario_names():
        scenario = load_scenario(name)
        chosen = ", ".join(control_words(scenario.control_bounds)[scenario.control.chosen])
        table.append((name, chosen, _SOLVER, scenario.question))
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        print("  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip())
    return 0


def _replay(options: argparse.Namespace) -> int:
    with ExitStack() as places:
        page = _place(places, "--out", replacing(options.out, ".html", ".htm"))
        title, descent = _descend(options, "trajectory")
        page.write_text(replay_page(descent, title), encoding="utf-8")
    _progress("replay")(f"wrote {options.out}")
    return 0


def _descend(options: argparse.Namespace, record: Record) -> tuple[str, Descent]:
    """Simulate the descent that the arguments mean; return its name too."""
    title, given, limits = _asked(options)
    return title, simulate(*given, **limits, record=record)


def _asked(options: argparse.Namespace) -> tuple[str, tuple[Body, ContactLaw, Slope, State], dict[str, Any]]:
    """Return the name of the descent that the arguments mean, what descends, and how far it is followed."""
    scenario = load_scenario(options.scenario)
    context = scenario.sample(np.random.default_rng(options.seed))
    orientation = None if options.orientation_deg is None else math.radians(options.orientation_deg)
    launch = scenario.launch(context, orientation, options.spin, options.speed)
    limits = {
        "solver": options.solver,
        "max_time": scenario.limits.max_time_s,
        "max_rebounds": scenario.limits.max_rebounds,
        "end_on_chord": scenario.ends.on_chord,
    }
    given = scenario.body(), scenario.law(context), scenario.slope(context), launch
    return f"{scenario.id}, seed {options.seed}, solver {options.solver}", given, limits


def _draw(descent: Descent, folder: Path) -> None:
    from sledenv.plot import plot_descent, plot_strobe

    plot_strobe(descent).savefig(folder / PICTURES[0], dpi=_DPI)
    plot_descent(descent).savefig(folder / PICTURES[1], dpi=_DPI)


if __name__ == "__main__":
    sys.exit(main())
