"""Agents and baselines that choose the launch of a sled, one file each, and the scripts that train and judge them."""

import sledenv.benchmark  # noqa: F401, all need it: what is missing is said here
