"""Both kinds of environments, of one lane and of many, and what it means that two of them give the same."""

from __future__ import annotations

from functools import partial
from typing import Final

import pytest
from gymnasium.utils.env_checker import data_equivalence

from sledenv.envs import DESCENT_ID, LAUNCH_ID
from sledenv.envs.descent import SledDescent
from sledenv.envs.launch import SledLaunch
from sledenv.envs.vector import SledDescentVector, SledLaunchVector

SCALAR: Final = {LAUNCH_ID: SledLaunch, DESCENT_ID: SledDescent}
NATIVE: Final = {LAUNCH_ID: SledLaunchVector, DESCENT_ID: SledDescentVector}
WIDTH: Final = {LAUNCH_ID: 2, DESCENT_ID: 1}  # of an action
both_ids = pytest.mark.parametrize("env_id", SCALAR)
equal = partial(data_equivalence, exact=True)  # in types, dtypes, keys and values
