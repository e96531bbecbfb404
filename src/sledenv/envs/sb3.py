"""The native vector environments as a stable-baselines3 VecEnv."""

from __future__ import annotations

import reprlib
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.core import RenderFrame
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from sledenv.envs.info import checked_info
from sledenv.envs.inputs import checked_options
from sledenv.envs.task import TaskOptions
from sledenv.envs.vector import SledVectorEnv
from sledenv.envs.viewer import METADATA, Viewer
from sledenv.machine.extras import needs
from sledenv.simulation.rules import checked_mapping, checked_seed, is_whole

with needs("agents", __name__):
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import VecEnv
    from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn


_OF_ENVIRONMENTS = {"scenario", "render_mode", "max_episode_steps", *TaskOptions.__annotations__}
_OWN = {  # what environments take and make_vec_env decides
    "info": "info is an argument of make_vec_env",
    "autoreset_mode": "lanes are reset in the step with which they end, as stable-baselines3 expects",
    "num_envs": "n_envs is an argument of make_vec_env",
}


def make_vec_env(
    env_id: str,
    n_envs: int = 1,
    seed: int | None = None,
    start_index: int = 0,
    *,
    env_kwargs: dict[str, Any] | None = None,
    info: Sequence[str] = ("is_success",),
    **others: Any,
) -> SledVecEnv:
    """Make the native batch of an environment: as ``stable_baselines3.common.env_util.make_vec_env``.

    ``PPO("MlpPolicy", make_vec_env("sledenv/SledLaunch-v0", 1024)).learn(50_000)`` is a whole training run. Lanes tell
    of their episodes what SB3's ``Monitor`` does: ``ep_rew_mean``, ``evaluate_policy`` and ``EvalCallback`` have raw
    returns, also where ``VecNormalize`` scales rewards.

    Parameters
    ----------
    env_id : str
        Such as "sledenv/SledLaunch-v0".
    n_envs : int
        Number of lanes.
    seed : int, optional
        Lane i is seeded with ``seed + i`` at the first reset; by numpy's own random numbers without one.
    start_index : int
        The action space is seeded with ``seed + start_index``.
    env_kwargs : dict, optional
        Arguments of the environment, such as ``{"scenario": "sled_mat"}``; with ``"render_mode": "rgb_array"`` it can
        be drawn, which stable-baselines3 takes by default.
    info : sequence of str
        Entries of the scalar environment's info to give; each costs a dict of every lane at every step.

    Raises
    ------
    TypeError
        For what is no id, and for the other arguments of stable-baselines3: those of wrappers, monitors and workers,
        which the lanes of a batch do not have.
    """
    for name in others:
        if name in _OF_ENVIRONMENTS:
            raise TypeError(f"{name}: is an argument of the environment, give it in env_kwargs={{{name!r}: ...}}")
        hint = "VecMonitor(..., filename) writes a file; stable_baselines3's make_vec_env makes lanes with wrappers"
        raise TypeError(f"{name}: is no argument of a native batch, whose lanes have no wrappers of their own; {hint}")
    if not isinstance(env_id, str):
        raise TypeError(f"env_id = {env_id!r}: must be an id such as 'sledenv/SledLaunch-v0'")
    given, kwargs = checked_info(info), checked_mapping("env_kwargs", env_kwargs)
    for name, why in _OWN.items():
        if name in kwargs:
            raise TypeError(f"env_kwargs[{name!r}] = {kwargs[name]!r}: must be left out, {why}")
    start_index = checked_seed(start_index, "start_index")
    if seed is not None:
        seed = checked_seed(seed)
    env = gym.make_vec(
        env_id,
        num_envs=n_envs,
        vectorization_mode="vector_entry_point",
        autoreset_mode=AutoresetMode.SAME_STEP.value,
        info=given,
        **kwargs,
    )
    adapter = SledVecEnv(env)
    adapter.seed(seed)
    if seed is not None:
        adapter.action_space.seed(seed + start_index)
    return adapter


class SledVecEnv(VecEnv):
    """Adapter that gives what ``DummyVecEnv`` of the scalar environments in a ``Monitor`` each gives, bit for bit.

    It does not wrap them in SB3's ``VecMonitor``, whose sums go on where a lane is reset alone, which has no
    ``reset_infos`` of the lanes and cannot be pickled.

    Parameters
    ----------
    env : VectorEnv
        A native vector environment in autoreset mode "SameStep".

    Raises
    ------
    TypeError, ValueError
        For another kind of environment or another mode.
    """

    def __init__(self, env: gym.vector.VectorEnv[Any, Any, Any]) -> None:
        native = getattr(env, "unwrapped", None)
        if env is not native or not isinstance(native, SledVectorEnv):
            raise TypeError(f"env = {env!r}: must be a native vector environment, not wrapped")
        if native.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"autoreset_mode = {native.autoreset_mode.value!r}: must be 'SameStep'")
        self.env = native
        self.spec = native.spec
        super().__init__(native.num_envs, native.single_observation_space, native.single_action_space)
        self.metadata = METADATA
        self._begun = time.time()

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode in every lane, with the seeds and options set for this reset.

        Raises
        ------
        TypeError, ValueError
            For an unknown option, or a wrong context or split; all lanes stay where they are.
        """
        seeds, options = self._seeds, self._options
        self._reset_seeds()
        self._reset_options()
        observations, info = self.env.reset(
            seed=seeds, options=_shared_options(options, {"split": self.env.task.split})
        )
        self.reset_infos = lane_infos(info, self.num_envs)
        return observations

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keep the actions for :meth:`step_wait`."""
        self.actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Advance every lane by one step; ended lanes begin their next episode.

        Raises
        ------
        gymnasium.error.InvalidAction, gymnasium.error.ResetNeeded
            As the native environment.
        """
        paid, steps = self.env.episodes.paid.copy(), self.env.episodes.steps.copy()  # lanes that end begin anew
        observations, rewards, terminated, truncated, info = self.env.step(self.actions)
        dones = terminated | truncated
        infos = lane_infos(info, self.num_envs)
        returns, lengths = (paid + rewards).tolist(), (steps + 1).tolist()
        elapsed = round(time.time() - self._begun, 6)
        for i in np.flatnonzero(dones).tolist():
            begun = infos[i]
            episode = {"r": round(returns[i], 6), "l": lengths[i], "t": elapsed}  # as Monitor has it
            infos[i] = begun.pop("final_info") | {"episode": episode, "terminal_observation": begun.pop("final_obs")}
            self.reset_infos[i] = begun
        for lane, cut in zip(infos, (truncated & ~terminated).tolist(), strict=True):
            lane["TimeLimit.truncated"] = cut
        return observations, rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """Close the native environment."""
        self.env.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return a picture of each lane, None in another render mode than "rgb_array"."""
        if self.render_mode != "rgb_array":
            warnings.warn(f"render_mode = {self.render_mode!r}: must be 'rgb_array' for pictures", stacklevel=2)
            return [None] * self.num_envs
        return list(self.env.render() or ())  # type: ignore[arg-type]

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of each lane."""
        return [getattr(lane, attr_name) for lane in self._lanes(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of all lanes.

        Raises
        ------
        ValueError
            If only some are meant: lanes share their attributes.
        """
        if sorted(lane.index for lane in self._lanes(indices)) != list(range(self.num_envs)):
            raise ValueError(f"indices = {indices!r}: lanes share their attributes, so all must be set at once")
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of each lane, such as ``reset``."""
        return [getattr(lane, method_name)(*method_args, **method_kwargs) for lane in self._lanes(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Return for each lane whether it has a wrapper: they tell what ``Monitor`` does, and have no other."""
        return [issubclass(Monitor, wrapper_class) for _ in self._lanes(indices)]

    def set_options(self, options: list[dict[str, Any]] | dict[str, Any] | None = None) -> None:
        """Keep options for the next reset, which reads them.

        Parameters
        ----------
        options : dict or list of dict, optional
            For all lanes, or one per lane.

        Raises
        ------
        TypeError, ValueError
            For anything else, for another number of them, or if they hold what cannot be copied.
        """
        if isinstance(options, Mapping | None):
            options = dict(options or {})
        elif not isinstance(options, list | tuple):
            raise TypeError(f"options = {options!r}: must be a mapping, or a list of one per lane")
        elif len(options) != self.num_envs:
            raise ValueError(f"options has {len(options)} entries: must be one per lane, {self.num_envs}")
        try:
            super().set_options(options)
        except TypeError as error:  # of copy.deepcopy
            raise TypeError(
                f"options = {reprlib.repr(options)}: must hold numbers, words and arrays: {error}"
            ) from error

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Give each lane a seed for the next reset, ``seed`` to the first one, or one that is drawn."""
        return super().seed(None if seed is None else checked_seed(seed))

    def _lanes(self, indices: VecEnvIndices) -> list[Lane]:
        lanes = range(self.num_envs)
        given: Any = lanes if indices is None else indices if isinstance(indices, Iterable) else [indices]
        if not all(map(is_whole, given := list(given))):
            raise TypeError(f"indices = {indices!r}: must be the number of a lane, a sequence of them, or None")
        if not all(-len(lanes) <= lane < len(lanes) for lane in given):
            raise IndexError(f"indices = {indices!r}: must be among {len(lanes)} lanes")
        return [Lane(self.env, lanes[lane]) for lane in given]


class Lane:
    """One lane of a native batch, seen as a scalar environment.

    What is not listed here, such as ``task``, is shared by all lanes.
    """

    def __init__(self, env: SledVectorEnv, index: int) -> None:
        self.env = env
        self.index = index
        self.observation_space = env.single_observation_space
        self.action_space = env.single_action_space
        self.metadata = METADATA
        self.unwrapped = self

    @property
    def np_random(self) -> np.random.Generator | None:
        """The random stream of the lane, None before the first reset."""
        return self.env.episodes.generators[self.index]

    @property
    def np_random_seed(self) -> int | None:
        """Seed of the lane, None before the first reset."""
        return self.env.np_random_seed[self.index]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode in this lane; the others go on.

        Raises
        ------
        TypeError, ValueError
            As the native environment.
        """
        mask = np.arange(self.env.num_envs) == self.index
        seeds = [seed if own else None for own in mask.tolist()]
        observations, info = self.env.reset(seed=seeds, options=checked_options(options) | {"reset_mask": mask})
        return observations[self.index], lane_infos(info, self.env.num_envs)[self.index]

    def render(self) -> RenderFrame | None:
        """Return what the render mode asks for of this lane."""
        return self._viewer.render() if self.env.render_mode else None

    def film(self) -> Iterator[NDArray[np.uint8]]:
        """Draw the film of all that has happened in this lane since the last call or the reset."""
        return self._viewer.film()

    def close(self) -> None:
        """Close the window of this lane, if there is one."""
        for viewer in self.env.episodes.viewers[self.index : self.index + 1]:
            viewer.close()

    def get_wrapper_attr(self, name: str) -> Any:
        """Return an attribute, as Gymnasium's environments do."""
        return getattr(self, name)

    def has_wrapper_attr(self, name: str) -> bool:
        """Whether there is an attribute, as Gymnasium's environments tell."""
        return hasattr(self, name)

    def step(self, *given: Any) -> None:
        """Raise: the lanes of a batch advance together."""
        raise NotImplementedError("a lane cannot be stepped, kept or restored alone")

    snapshot = restore = step

    @property
    def _viewer(self) -> Viewer:
        if not self.env.episodes.begun:
            raise ResetNeeded("call reset before render")
        if not self.env.episodes.viewers:
            raise AttributeError("lanes cannot be drawn without a render_mode")
        return self.env.episodes.viewers[self.index]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.env, name)


def lane_infos(infos: dict[str, Any], lanes: int) -> list[dict[str, Any]]:
    """Return the info of each lane out of Gymnasium's vector form, as plain Python values.

    Parameters
    ----------
    infos : dict
        Arrays of shape (lanes,) in dicts, each ``key`` with a mask ``_key``.
    lanes : int
    """
    listed: list[dict[str, Any]] = [{} for _ in range(lanes)]
    for key, values in infos.items():
        if key.startswith("_"):
            continue
        column = lane_infos(values, lanes) if isinstance(values, dict) else values.tolist()
        for i in np.flatnonzero(infos[f"_{key}"]).tolist():
            listed[i][key] = column[i]
    return listed


def _shared_options(options: list[dict[str, Any]], default: dict[str, Any]) -> dict[str, Any] | None:
    """Options of the batch from those of each lane."""
    for lane, given in enumerate(options):
        if not isinstance(given, Mapping):
            raise TypeError(f"options of lane {lane} = {given!r}: must be a mapping")
    keys = {key: None for given in options for key in given}  # in order
    return {key: [given.get(key, default.get(key)) for given in options] for key in keys} or None
