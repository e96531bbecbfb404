"""Runs Gymnasium's own tests with the environments of this package in place of the one that they use.

    python -m tests.gymnasium_suite CHECKOUT [--target NAME] [arguments of pytest]

or ``make gymnasium-tests GYMNASIUM=CHECKOUT``. CHECKOUT is a checkout of Gymnasium, of about the version that is
installed. Its tests are read, and run in a scratch folder with our ids and classes in their text, nothing is kept.
This file is the conftest.py there.
"""

from __future__ import annotations

import argparse
import inspect
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import pytest

from sledenv.envs.info import INFO_KEYS
from sledenv.envs.launch import SledLaunch

_TARGET = "SLEDENV_TARGET"  # names the target to the conftest.py
_PLAIN = gym.wrappers.TimeLimit, gym.wrappers.OrderEnforcing, gym.wrappers.PassiveEnvChecker  # those of gym.make


class Target(NamedTuple):
    """An environment in the place of CartPole."""

    env_id: str
    scalar: str  # classes in sledenv.envs
    batch: str
    native: bool  # whether native batches take the place of SyncVectorEnv and AsyncVectorEnv too


_LAUNCH = "sledenv/SledLaunch-v0", "launch.SledLaunch", "vector.SledLaunchVector"
_DESCENT = "sledenv/SledDescent-v0", "descent.SledDescent", "vector.SledDescentVector"
TARGETS = {
    "launch": Target(*_LAUNCH, native=False),
    "launch-native": Target(*_LAUNCH, native=True),
    "descent": Target(*_DESCENT, native=False),
    "descent-native": Target(*_DESCENT, native=True),
}

# Files that are not run, and why.
LEFT_OUT = {
    "tests/envs/mujoco": "MuJoCo's own environments",
    "tests/envs/registration/test_pprint_registry.py": "a printed list of Gymnasium's own environments",
    "tests/envs/test_env_implementation.py": "rules of single environments of Gymnasium",
    "tests/functional": "JAX's own environments",
    "tests/utils/test_performance.py": "steps per second for a given time",
    "tests/utils/test_play.py": "plays by the keyboard, which needs discrete actions",
    "tests/utils/test_save_video.py": "films of hundreds of episodes, of a thousand pictures each",
    "tests/wrappers/test_human_rendering.py": "a window, in which a descent plays at its own rate",
    "tests/wrappers/vector/test_human_rendering.py": "a window, in which a descent plays at its own rate",
}

_DISCRETE = "its actions are whole numbers"
_SHAPE = "its observations have four entries"
_LONG = "its episodes are longer than these, which may end at their first step"
_ONE = "its episodes are longer than one step"
_OWN = "an attribute, argument or number of CartPole"
_LIST = "takes the dict of info for a list, which goes well while CartPole's is empty"
_WORKERS = "scalar environments and their workers, which a native batch does not have"
_MAKERS = "what makers do to an environment after gym.make does not reach a native batch"
_WORDS = "another message, or another kind of error, for the same mistake"
_SYNC = "asks for a class that the target replaces"
# Tests that fail, and why: of all targets, of native ones, of both with SledLaunch. A name without [ stands for all its
# cases, CartPole-v1 for the id of the target. One that passes, or that is not there, fails the run.
EXCLUDED = {
    "all": {
        "envs/registration/test_env_spec.py::test_env_spec_pprint": _OWN,
        "envs/registration/test_make.py::test_make_render_collection": "draws lists without Gymnasium's wrapper",
        "envs/registration/test_make.py::test_make_with_render_mode": "refuses a mode that CartPole takes",
        "envs/registration/test_make_vec.py::test_make_vec_with_spec[CartPole-v1-kwargs8]": _OWN,
        "envs/registration/test_make_vec.py::test_make_vec_with_spec[CartPole-v1-kwargs9]": _OWN,
        "envs/registration/test_make_vec.py::test_make_vec_with_spec[env_id18-kwargs18]": _OWN,
        "envs/registration/test_make_vec.py::test_make_vec_with_spec[env_id19-kwargs19]": _OWN,
        "envs/registration/test_register.py::test_env_version_suggestions[CartPole-v12-": _OWN,
        "envs/test_rendering.py::test_pygame_selective_init": "draws in memory, and starts no display for a picture",
        "test_core.py::test_get_set_wrapper_attr": _OWN,
        "vector/test_async_vector_env.py::test_call_async_vector_env": _OWN,
        "vector/test_async_vector_env.py::test_reset_async_vector_env": _LIST,
        "vector/test_async_vector_env.py::test_step_async_vector_env": _DISCRETE,
        "vector/test_sync_vector_env.py::test_call_sync_vector_env": _OWN,
        "vector/test_vector_wrapper.py::test_vector_env_wrapper_attributes": _OWN,
        "wrappers/test_action_repeat.py::test_action_repeat_reward_accumulation": _DISCRETE,
        "wrappers/test_clip_reward.py::test_clip_reward_wrapper": _DISCRETE,
        "wrappers/test_frame_stack_observation.py::test_padding_type": _SHAPE,
        "wrappers/test_order_enforcing.py::test_order_enforcing": _DISCRETE,
        "wrappers/test_record_video.py::test_video_length": _LONG,
        "wrappers/test_record_video.py::test_with_rgb_array_list": _LONG,
        "wrappers/test_time_limit.py::test_max_episode_steps": _OWN,
        "wrappers/vector/test_record_video.py::test_video_length": _LONG,
        "wrappers/vector/test_vector_wrappers.py::test_vector_wrapper_equivalence[CartPole-v1-Rescale": _SHAPE,
        "wrappers/vector/test_vectorize_transform.py::test_vectorize_dict_to_box_obs": _SHAPE,
    },
    "native": {
        "envs/registration/test_make_vec.py::test_make_vec_vectorization_mode": _SYNC,
        "envs/registration/test_make_vec.py::test_make_vec_wrappers": _SYNC,
        "vector/test_async_vector_env.py::test_already_closed_async_vector_env": _WORKERS,
        "vector/test_async_vector_env.py::test_reset_out_of_order_async_vector_env": _WORKERS,
        "vector/test_async_vector_env.py::test_set_attr_async_vector_env": _WORKERS,
        "vector/test_async_vector_env.py::test_step_out_of_order_async_vector_env": _WORKERS,
        "vector/test_sync_vector_env.py::test_metadata_sync_vector_env": _WORKERS,
        "vector/test_sync_vector_env.py::test_set_attr_sync_vector_env": _WORKERS,
        "vector/test_sync_vector_env.py::test_sync_vector_determinism": _MAKERS,
        "vector/test_vector_env.py::test_action_count_compatibility": _WORDS,
        "vector/test_vector_env.py::test_partial_reset_failure": _WORDS,
        "vector/test_vector_env.py::test_random_seeds_set_at_retrieval": _MAKERS,
    },
    "launch": {
        "vector/test_vector_env.py::test_action_count_compatibility[Sync]": _ONE,
        "vector/test_vector_env.py::test_partial_reset": _ONE,
        "wrappers/test_delay_observation.py::test_delay_values[2]": _ONE,
        "wrappers/test_delay_observation.py::test_delay_values[3]": _ONE,
        "wrappers/test_delay_observation.py::test_delay_values[4]": _ONE,
        "wrappers/test_frame_stack_observation.py::test_stack_size": _ONE,
        "wrappers/test_time_aware_observation.py::test_default[CartPole-v1]": _ONE,
        "wrappers/vector/test_record_video.py::test_video_folder_and_filenames[AutoresetMode.SAME_STEP]": _ONE,
    },
}
# Tests that are skipped with the target "descent": whether they pass depends on actions that they draw without a seed.
CHANCE = {
    "vector/test_vector_env.py::test_action_count_compatibility[Sync]",
    "wrappers/test_delay_observation.py::test_delay_values[2]",
    "wrappers/test_delay_observation.py::test_delay_values[3]",
    "wrappers/test_delay_observation.py::test_delay_values[4]",
    "wrappers/test_time_aware_observation.py::test_default[CartPole-v1]",
}


def marks(name: str) -> dict[str, pytest.MarkDecorator]:
    """Return the mark of each test that is excluded from a target."""
    target, excluded = TARGETS[name], dict(EXCLUDED["all"])
    if name.startswith("launch"):
        excluded |= EXCLUDED["launch"]
    if target.native:
        excluded |= EXCLUDED["native"]
    made = {test: pytest.mark.xfail(reason=reason, strict=True) for test, reason in excluded.items()}
    if name == "descent":
        made |= {test: pytest.mark.skip(reason=_LONG) for test in CHANCE}
    return {f"tests/{test.replace('CartPole-v1', target.env_id)}": mark for test, mark in made.items()}


def replaced(text: str, target: Target) -> str:
    """Return the text of a file of tests with our environment in place of theirs."""
    (scalar_module, scalar), (batch_module, batch) = target.scalar.split("."), target.batch.split(".")
    theirs, ours = "from gymnasium.envs.classic_control", "from sledenv.envs."
    pairs = {
        f"{theirs} import CartPoleEnv": f"{ours}{scalar_module} import {scalar} as CartPoleEnv",
        f"{theirs}.cartpole import CartPoleVectorEnv": f"{ours}{batch_module} import {batch} as CartPoleVectorEnv",
        '"gymnasium.envs." in env_spec.entry_point': '"sledenv.envs." in env_spec.entry_point',
        "CartPole-v1": target.env_id,
    }
    for old, new in pairs.items():
        text = text.replace(old, new)
    return text


def native_in_place_of(kind: Any) -> Any:
    """Return a class that makes native batches where ``kind`` would hold environments of ours, not wrapped further."""

    class Batch(kind):  # type: ignore[misc]
        def __new__(cls, env_fns: Any, **given: Any) -> Any:
            envs = [make() for make in env_fns]
            spec = envs[0].spec
            native = all(_is_plain(env) and env.spec == spec for env in envs)
            for env in envs:
                env.close()
            if not native:
                return super().__new__(cls)
            mode = given.get("autoreset_mode", gym.vector.AutoresetMode.NEXT_STEP)
            batch = {"autoreset_mode": mode, "info": INFO_KEYS, "vectorization_mode": "vector_entry_point"}
            return gym.make_vec(spec.id, len(envs), **batch | spec.kwargs)

    Batch.__name__ = kind.__name__
    return Batch


def _is_plain(env: Any) -> bool:
    """Whether an environment is what ``gym.make`` makes of an id that has native batches too."""
    while isinstance(env, _PLAIN):
        env = env.env
    return isinstance(env, SledLaunch) and env.spec is not None and env.spec.vector_entry_point is not None


if _TARGET in os.environ and TARGETS[os.environ[_TARGET]].native:  # in the conftest.py, before the tests import them
    gym.vector.SyncVectorEnv = native_in_place_of(gym.vector.SyncVectorEnv)  # type: ignore[misc]
    gym.vector.AsyncVectorEnv = native_in_place_of(gym.vector.AsyncVectorEnv)  # type: ignore[misc]


@pytest.hookimpl(tryfirst=True)  # before pytest's own -k leaves tests out
def pytest_collection_modifyitems(config: pytest.Config, items: list[Any]) -> None:
    """Keep the tests that make an environment of ours, of native targets in a batch; mark those that are excluded."""
    name = os.environ[_TARGET]
    ours = re.compile(rf"{TARGETS[name].env_id}|CartPoleEnv|CartPoleVectorEnv|ENV_ID|_testing_|example_env_list")
    kept, left = [], []
    for item in items:
        source = inspect.getsource(item.function)
        others = [one for one in re.findall(r"[\w/]+-v\d", item.name) if "sledenv/" not in one]
        batched = not TARGETS[name].native or re.search("make_vec|VectorEnv|vectoriser|venv_constructor", source)
        (kept if ours.search(source) and not others and batched else left).append(item)
    files = {item.nodeid.partition("::")[0] for item in items}
    for test, mark in marks(name).items():
        cases = [item for item in items if item.nodeid == test or item.nodeid.startswith(_cases(test))]
        if not cases and test.partition("::")[0] in files:
            raise pytest.UsageError(f"{test} is excluded, but there is no such test")
        for item in cases:
            item.add_marker(mark)
    items[:] = kept
    config.hook.pytest_deselected(items=left)


def _cases(test: str) -> str:
    """How the names of the cases of a test begin."""
    return test if "[" in test else f"{test}["


def run(checkout: Path, name: str, arguments: list[str]) -> int:
    """Run the tests of a checkout with one target, and return how pytest ended."""
    with tempfile.TemporaryDirectory() as folder:
        scratch, chosen = Path(folder), []
        for file in sorted((checkout / "tests").rglob("*.py")):
            copy = scratch / file.relative_to(checkout)
            text = file.read_text(encoding="utf-8")
            new = replaced(text, TARGETS[name])
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_text(new, encoding="utf-8")
            there = copy.relative_to(scratch).as_posix()
            uses = new != text or "tests.envs.utils" in text or "ENV_ID" in text
            if file.name.startswith("test_") and uses and not there.startswith(tuple(LEFT_OUT)):
                chosen.append(there)
        shutil.copy(__file__, scratch / "conftest.py")
        (scratch / "pytest.ini").write_text("[pytest]\n")
        command = [sys.executable, "-m", "pytest", "-q", "-rfE", "-p", "no:cacheprovider", *arguments, *chosen]
        return subprocess.run(command, cwd=scratch, env=os.environ | {_TARGET: name}).returncode


def main() -> int:
    """Run the tests with each target."""
    parser = argparse.ArgumentParser(prog="python -m tests.gymnasium_suite", description=__doc__)
    parser.add_argument("checkout", type=Path, help="folder that has Gymnasium's tests/")
    parser.add_argument("--target", choices=TARGETS, action="append", help="one of them; all by default")
    given, arguments = parser.parse_known_args()
    if not (given.checkout / "tests" / "wrappers").is_dir():
        parser.error(
            f"{given.checkout} holds no tests/wrappers: name a checkout of Gymnasium (its source distribution "
            "holds two files of tests only)"
        )
    failed = False
    for name in given.target or TARGETS:
        print(f"{name}: {TARGETS[name].env_id}", flush=True)
        failed |= run(given.checkout.resolve(), name, arguments) != 0
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
