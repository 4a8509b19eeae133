"""Runs on a Dask cluster: the same isolated processes, on whatever workers there are.

Workers may come and go. A run whose worker is lost is done again elsewhere; when its results come twice, the second
replaces the first. A run that takes its workers with it again and again ends as a crash. Where the package's version
differs from that of the benchmark nothing is done at all.
"""

from __future__ import annotations

import uuid
from collections.abc import Generator, Iterable
from importlib import import_module
from typing import Any

from pushplan.bench.processes.child import Work
from pushplan.bench.processes.isolation import isolated
from pushplan.bench.processes.machine import package_version
from pushplan.bench.processes.outcome import CRASH, Outcome, Task
from pushplan.bench.processes.work import perform
from pushplan.errors import PushplanError

CONNECT = 10.0
"""Seconds to wait for the scheduler."""


class ClusterError(PushplanError):
    """A cluster cannot be used."""


def cluster_outcomes(tasks: Iterable[Task], address: str, work: Work = perform) -> Generator[Outcome]:
    """Do runs on a cluster and yield what becomes of them, in the order in which they end.

    Closing the iterator cancels what has not ended.

    Args:
        tasks: What to do.
        address: Of the scheduler, e.g. `tcp://host:8786`.
        work: See `IsolatedRun`.

    Raises:
        ClusterError: When Dask is not installed, the scheduler does not answer, or a worker cannot do the work.
    """
    try:
        dask: Any = import_module("distributed")
    except ImportError as error:
        raise ClusterError("this needs Dask: install pushplan[dask]") from error
    try:
        client = dask.Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(f"no scheduler answers at {address}: {error}") from error
    batch = uuid.uuid4().hex[:8]  # without it, a run that is to be done again would be answered from memory
    with client:
        futures = {
            client.submit(_remote, task, work, key=f"{task.key}-{batch}", pure=False): task for task in tasks
        }
        try:
            for future in dask.as_completed(futures, loop=client.loop):
                yield _outcome(future, futures.pop(future))
        finally:
            client.cancel(list(futures), force=True)


def _remote(task: Task, work: Work) -> Outcome:
    """Do a run on a worker."""
    here = package_version()
    if task.version != here:
        raise ClusterError(
            f"a worker has pushplan {here}, the benchmark {task.version}; install the same everywhere"
        )
    return isolated(task, work=work)


def _outcome(future: Any, task: Task) -> Outcome:
    """Return what became of a run whose future has ended."""
    if future.status == "finished":
        outcome: Outcome = future.result()
        return outcome
    if future.status != "error":
        raise ClusterError("the scheduler is gone; go on with --resume when it is back")
    error = future.exception()
    if type(error).__name__ == "KilledWorker":
        return Outcome(task.key, CRASH, "every worker that did this run was lost")
    raise (
        error if isinstance(error, PushplanError) else ClusterError(f"a worker failed: {error!r}")
    ) from error
