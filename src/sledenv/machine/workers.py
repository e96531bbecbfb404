"""Calls that do not depend on each other, made by processes here or by the nodes of a Ray cluster."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from joblib import Parallel, cpu_count, delayed, parallel_config

Call = tuple[Callable[..., Any], tuple[Any, ...]]  # a function that can be pickled and what it is given
Runner = Callable[[list[Call]], Iterator[Any]]


def runner(workers: int | None = None, ray: str | None = None) -> Runner:
    """Return what makes calls and yields what they return, each as soon as it is there, in no order.

    Parameters
    ----------
    workers : int, optional
        Processes, by default one for each core that this one may use; of a cluster all that it has.
    ray : str, optional
        Address of a Ray cluster, "local" to start one here.

    Raises
    ------
    ImportError
        If Ray is asked for and missing.
    """
    return _through_ray(ray) if ray is not None else _through_joblib(workers or cpu_count())


def _through_joblib(workers: int) -> Runner:
    def run(calls: list[Call]) -> Iterator[Any]:
        # One thread in each process: more processes than cores would only wait for each other.
        alike = {"inner_max_num_threads": 1, "initializer": _end_with, "initargs": (os.getpid(),)}
        count = min(workers, max(len(calls), 2))  # of one alone joblib makes no process
        with parallel_config(backend="loky", n_jobs=count, **alike):
            yield from Parallel(return_as="generator_unordered")(delayed(_call)(call, given) for call, given in calls)

    return run


def _through_ray(address: str) -> Runner:
    try:
        import ray
    except ImportError as error:
        raise ImportError("ray: a cluster needs Ray: pip install ray") from error

    def run(calls: list[Call]) -> Iterator[Any]:
        # The working folder holds the agents, and one thread is what a task has asked for.
        environment = {"env_vars": {"NUMBA_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join([os.getcwd(), *sys.path])}}
        with ray.init(address=address, runtime_env=environment, log_to_driver=False):
            task = ray.remote(_call)
            pending = [task.remote(call, given) for call, given in calls]
            while pending:
                (done,), pending = ray.wait(pending)
                yield ray.get(done)

    return run


def _end_with(parent: int) -> None:
    """End this process soon after its parent, which may have been killed, also while this one was being started.

    It would go on with what waits for it, or wait for more, and so would what tracks the resources of both.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.2)
        os._exit(1)

    if os.name == "posix":  # elsewhere the parent of an orphan stays its parent
        threading.Thread(target=watch, daemon=True).start()


def _call(call: Callable[..., Any], given: tuple[Any, ...]) -> Any:
    return call(*given)
