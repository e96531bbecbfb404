"""A wheel, a source distribution and an editable install hold all that a checkout has, and work where there is none."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

import sledenv
from sledenv.command.cli import main

ROOT = Path(__file__).parents[1]
HOMES = {"src": "", "agents": "sledenv/agents/", "configs": "sledenv/configs/"}  # of the package: here, in a wheel
BUILD = """
import os, sys, tarfile
from setuptools import build_meta
folder = sys.argv[1]  # setuptools changes sys.argv
source = build_meta.build_sdist(folder)
with tarfile.open(os.path.join(folder, source)) as archive:
    archive.extractall(folder)
os.chdir(os.path.join(folder, source.removesuffix(".tar.gz")))
build_meta.build_wheel(folder)
"""
BUILD_EDITABLE = "import sys; from setuptools import build_meta; build_meta.build_editable(sys.argv[1])"
# Run without site-packages, but with the folder of an editable install, before all else that is on the path.
EDITABLE = """
import site, sys
site.addsitedir(sys.argv[1])
sys.path += sys.argv[2:]
import gymnasium
import sledenv
sledenv.sled()
gymnasium.make("sledenv/SledLaunch-v0").close()
import sledenv.agents.zero, sledenv.configs
for module in (sledenv, sledenv.agents.zero, sledenv.configs):
    print(module.__file__)
"""
# Run from an empty folder: everything that is found by name is found and can be read.
PROGRAM = """
import sys
from pathlib import Path
import sledenv
from sledenv.agents.train import ALGORITHMS
from sledenv.benchmark.problem import Problem
from sledenv.benchmark.references import reference
from sledenv.benchmark.runs import SETTINGS, agent_class, load_run, read_settings
from sledenv.benchmark.suite import Suite
from sledenv.pages.replay import replay_page
from sledenv.scenarios.scenario import load_scenario, scenario_names

home = Path(sledenv.__file__).parent
assert home.parent == Path(sys.argv[1]), home
hashes = [load_scenario(name).hash for name in scenario_names()]
studies = [sledenv.uncertainty.load_study(name).id for name in sledenv.uncertainty.study_names()]
suites = Suite.names()
for name in suites:
    assert list(Suite.load(name).jobs()), name
for name in ALGORITHMS:
    assert agent_class(f"sledenv.agents.{name}").__module__.startswith("sledenv.agents.")
assert read_settings(SETTINGS, "sledenv.agents.sac", "launch")
assert reference(Problem("sled_rollers", "descent")) is not None
for run in ("sled_mat-launch-spin-critic-s0", "sled_snow-launch-orientation-critic-s0"):
    problem, agent, config = load_run(Path(run))
    context = problem.contexts("test", 1)
    assert agent.act(problem.task.observe(problem.task.scenes(context))).shape == (1, problem.actions), run
print(*hashes, *studies, *suites)
"""


def files_below(folder: Path) -> set[str]:
    """Paths of all files, without compiled code and what setuptools writes."""
    found = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return {path.as_posix() for path in found if not {"__pycache__", "sledenv.egg-info"} & set(path.parts)}


def test_version_and_addresses_are_told_alike_everywhere(capsys: pytest.CaptureFixture[str]) -> None:
    """Oracle: the file to cite."""
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert sledenv.__version__ == cited["version"]
    assert main(["--version"]) == 0
    assert cited["version"] in capsys.readouterr().out
    told = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]
    assert (told["Source"], told["Documentation"]) == (cited["repository-code"], cited["url"])
    assert [url for url in told.values() if not url.startswith((told["Source"], told["Documentation"]))] == []


@pytest.mark.parametrize(
    ("missing", "module", "extra"),
    [
        ("torch", "sledenv.envs.sb3", "agents"),
        ("stable_baselines3", "sledenv.agents.sac", "agents"),
        ("pandas", "sledenv.agents.zero", "benchmark"),
        ("scipy", "sledenv.benchmark.oracle", "benchmark"),
        ("pyarrow", "sledenv.identification.tracks", "analysis"),
        ("SALib", "sledenv.uncertainty.run", "analysis"),
    ],
)
def test_a_missing_package_is_named_with_the_extra_that_brings_it(missing: str, module: str, extra: str) -> None:
    """Oracle: a process that cannot import it."""
    program = f"import sys; sys.modules[{missing!r}] = None; import {module}"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("sledenv.machine.extras.MissingPackage: sledenv")
    assert missing in last
    assert last.endswith(f"pip install 'sledenv[{extra}]'")


# Put into a folder that Python finds first: packages of the variable HIDDEN are missing, and whoever asks for the
# module of INTERRUPTED gets SIGINT.
FINDER = """
import os, signal, sys
from importlib.abc import MetaPathFinder

class Finder(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name.partition(".")[0] in os.environ.get("HIDDEN", "").split():
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        if name == os.environ.get("INTERRUPTED"):
            signal.signal(signal.SIGINT, signal.default_int_handler)
            signal.raise_signal(signal.SIGINT)

sys.meta_path.insert(0, Finder())
"""
EXTRAS = "SALib joblib matplotlib pandas pyarrow scipy stable_baselines3 torch tqdm"


def python(folder: Path, *words: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run Python with the finder above."""
    (folder / "sitecustomize.py").write_text(FINDER)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(folder), *sys.path])} | variables
    return subprocess.run([sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True)


@pytest.mark.parametrize(
    ("words", "hidden", "extra"),
    [
        ("demo --out demo", "torch stable_baselines3", "agents"),
        ("demo --out demo", "matplotlib", "agents"),
        ("train --algo sac --runs runs", "torch stable_baselines3", "agents"),
        ("train --algo zero --runs runs", EXTRAS, "benchmark"),
        ("evaluate sled_mat-launch-spin-critic-s0", "torch stable_baselines3", "agents"),
    ],
)
def test_a_script_of_the_agents_tells_a_missing_package_in_one_line(
    words: str, hidden: str, extra: str, tmp_path: Path
) -> None:
    """Oracle: a process that cannot import it; nothing is written."""
    module, *given = words.split()
    done = python(tmp_path, "-m", f"sledenv.agents.{module}", *given, HIDDEN=hidden)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"python -m sledenv.agents.{module}: error: sledenv.")
    assert done.stderr.endswith(f": pip install 'sledenv[{extra}]'\n")
    assert done.stderr.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} <= {"sitecustomize.py", "__pycache__"}


def test_nothing_in_the_package_imports_the_agents_by_the_name_they_are_installed_by() -> None:
    """Oracle: the import statements; import-linter knows the agents by another name, that of their folder."""
    named = set()
    for file in (ROOT / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            match node:
                case ast.Import():
                    named |= {alias.name for alias in node.names}
                case ast.ImportFrom(module=str(module)):
                    named |= {module} | {f"{module}.{alias.name}" for alias in node.names}
    assert "sledenv.benchmark.problem" in named
    assert [name for name in named if f"{name}.".startswith("sledenv.agents.")] == []


def test_a_checkout_that_is_not_installed_says_what_to_do(tmp_path: Path) -> None:
    """Oracle: a process that finds ``src`` of a copy first, whatever else is installed."""
    shutil.copytree(ROOT / "src", tmp_path / "copy" / "src", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    for module in ("sledenv.scenarios.configuration", "sledenv.benchmark.runs"):
        command = [sys.executable, "-c", f"import {module}"]
        environment = os.environ | {"PYTHONPATH": str(tmp_path / "copy" / "src")}
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
        last = done.stderr.strip().splitlines()[-1]
        assert last.startswith("ImportError: sledenv.configs is ")
        assert last.endswith(f"pip install -e {(tmp_path / 'copy').resolve()}")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a source distribution, the wheel that is built of it, and ``sledenv``, the copy that it is built of."""
    home = tmp_path_factory.mktemp("built")
    made = ("__pycache__", "*.egg-info", ".*_cache", ".git", ".hypothesis", ".venv*", "_build", "build", "dist", "runs")
    shutil.copytree(ROOT, home / "sledenv", ignore=shutil.ignore_patterns(*made, "objects"))
    none = os.environ | {"SLEDENV_TARGETS": ""}  # the kernel is not compiled
    subprocess.run(
        [sys.executable, "-c", BUILD, str(home)], cwd=home / "sledenv", env=none, check=True, capture_output=True
    )
    return home


def test_a_wheel_carries_every_file_of_the_package(built: Path) -> None:
    """Oracle: the files of the checkout: modules, templates of pages, agents with what they learned, all YAML."""
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    expected = {f"{place}{name}" for folder, place in HOMES.items() for name in files_below(built / "sledenv" / folder)}
    some = (
        "pages/templates/play.html",
        "py.typed",
        "agents/sac.py",
        "configs/suites/smoke.yaml",
        "configs/tracks/whoops.yaml",
    )
    assert {f"sledenv/{name}" for name in some} <= expected
    assert names == expected


def test_a_source_distribution_carries_package_tests_and_docs(built: Path) -> None:
    """Oracle: the files of the checkout."""
    (source,) = built.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        names = {member.name.partition("/")[2] for member in archive.getmembers() if member.isfile()}
    for folder in (*HOMES, "tests", "docs", "examples", "perf"):
        assert {f"{folder}/{name}" for name in files_below(built / "sledenv" / folder)} <= names
    assert {"README.md", "CHANGELOG.md", "LICENSE", "Makefile", "constraints.txt", "pyproject.toml"} <= names


def test_an_editable_install_works_from_every_folder(built: Path) -> None:
    """Oracle: the files of the clone. Above one that is named sledenv Python finds that folder first."""
    clone, site, empty = built / "sledenv", built / "site", built / "empty"
    for folder in (site, empty):
        folder.mkdir()
    command = [sys.executable, "-c", BUILD_EDITABLE, str(built / "editable")]
    (built / "editable").mkdir()
    subprocess.run(command, cwd=clone, env=os.environ | {"SLEDENV_TARGETS": ""}, check=True, capture_output=True)
    (wheel,) = (built / "editable").glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    files = [clone / name for name in ("src/sledenv/__init__.py", "agents/zero.py", "configs/__init__.py")]
    command = [sys.executable, "-S", "-c", EDITABLE, str(site), *sys.path]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    objects = clone / "src/sledenv/objects"  # lent, or the kernel would be compiled for more than a minute
    shutil.copytree(ROOT / "src/sledenv/objects", objects)
    for folder in (built, clone, empty):
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert [Path(line) for line in done.stdout.splitlines()] == files
    shutil.rmtree(objects)


@pytest.mark.slow
def test_the_unpacked_wheel_finds_all_that_has_a_name(built: Path, tmp_path: Path) -> None:
    """Oracle: the same program in this checkout."""
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    (tmp_path / "empty").mkdir()

    def told(home: Path) -> str:
        command = [sys.executable, "-c", PROGRAM, str(home)]
        environment = os.environ | {"PYTHONPATH": str(home)}
        done = subprocess.run(command, cwd=tmp_path / "empty", env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert told(tmp_path / "site") == told(Path(sledenv.__file__).parents[1])
    assert list((tmp_path / "empty").iterdir()) == []
