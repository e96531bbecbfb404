"""The spec of an environment, which makes the same one again in any folder."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from gymnasium.envs.registration import EnvSpec

from sledenv.machine.shipped import is_path


class OfAnyFolder:
    """An environment whose spec holds the absolute path of the file of a scenario, as text that JSON takes."""

    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """The spec that Gymnasium made it from, None if it did not."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        scenario = None if spec is None else spec.kwargs.get("scenario")
        if spec is not None and isinstance(scenario, str | os.PathLike):
            name = os.fsdecode(scenario)
            kept = str(Path(name).absolute()) if is_path(name) else name
            spec = replace(spec, kwargs=spec.kwargs | {"scenario": kept})
        self._spec = spec
