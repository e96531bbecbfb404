"""Imports: a first use of the environments loads little, and no modules import each other."""

from __future__ import annotations

import ast
import importlib.metadata
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import gymnasium

import sledenv

HEAVY = (
    *("Box2D", "SALib", "joblib", "matplotlib", "pandas", "pygame", "rich", "scipy.stats"),
    *("stable_baselines3", "tensorboard", "torch", "tqdm"),
)
PROGRAM = f"""
import sys
import gymnasium
before = set(sys.modules)
import sledenv
env = gymnasium.make("sledenv/SledLaunch-v0")
env.reset(seed=0)
env.step(env.action_space.sample())
gymnasium.make_vec("sledenv/SledLaunch-v0", num_envs=2)
print([name for name in {HEAVY!r} if name in set(sys.modules) - before])
"""


def test_the_package_says_what_it_registers_and_its_version() -> None:
    """Oracle: Gymnasium's registry; the installed distribution."""
    assert [name for name in gymnasium.registry if name.startswith("sledenv/") and name not in sledenv.__doc__] == []
    assert sledenv.__version__ == importlib.metadata.version("sledenv")


def test_an_archive_says_that_it_must_be_installed(tmp_path: Path) -> None:
    """Oracle: the message; scenarios and kernels are files."""
    with zipfile.ZipFile(tmp_path / "one.zip", "w") as archive:
        archive.write(sledenv.__file__, "sledenv/__init__.py")
    program = f"import sys; sys.path.insert(0, {str(tmp_path / 'one.zip')!r}); import sledenv"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "ImportError: sledenv cannot be imported from an archive" in done.stderr


def test_an_episode_without_pictures_loads_no_optional_package() -> None:
    """Oracle: sys.modules of a fresh process."""
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_policy_is_evaluated_without_a_learning_framework() -> None:
    """Oracle: sys.modules of a fresh process."""
    program = """
import sys
import sledenv
before = sorted({"pandas", "scipy"} & set(sys.modules))
found = sledenv.evaluate(lambda seen: 0.0 * seen[:, :1], "sled_rollers", contexts=2)
print(before, len(found.rewards), sorted({"stable_baselines3", "torch"} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[] 2 []"


def imported(file: Path) -> Iterator[str]:
    """Names that a file imports anywhere, in functions, for types and by ``import_module`` too."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        match node:
            case ast.Import(names=names):
                yield from (alias.name for alias in names)
            case ast.ImportFrom(module=str(module), names=names):
                yield from (f"{module}.{alias.name}" for alias in names)
            case ast.Call(
                func=ast.Name("import_module") | ast.Attribute(attr="import_module"), args=[ast.Constant(str(name)), *_]
            ):
                yield name


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Oracle: the sources have an order in which each needs only what is before it."""
    home = Path(__file__).parents[1] / "src"
    files = {".".join(file.relative_to(home).with_suffix("").parts): file for file in home.glob("sledenv/**/*.py")}
    files = {name.removesuffix(".__init__"): file for name, file in files.items()}

    def module(name: str) -> str:
        while name and name not in files:
            name = name.rpartition(".")[0]
        return name

    needs = {name: {module(one) for one in imported(file)} - {"", name} for name, file in files.items()}
    assert "sledenv.pages.notebook" in needs["sledenv.pages"]  # in a function
    assert len(list(TopologicalSorter(needs).static_order())) == len(files)
