"""Runs in processes of their own: whatever happens in one ends that run alone, and becomes its outcome.

The standard library's fork server has everything imported and compiled (`preload`). Each run is a fresh process
forked from it. No run sees what another one left behind, its peak memory is its own, and it can be killed at any
moment. An executor of `concurrent.futures` says where: threads of this process, or the workers of a Dask cluster,
each of which starts the process of one run after the other.

Memory counts as what a run takes on top of the code and kernels that it starts with. A thread of the run looks at its
resident set a few times a second; a run that grows faster, or asks for a lot at once, is refused memory by the kernel
(RLIMIT_DATA). The address space as a whole (RLIMIT_AS) would say little: compiled code and thread stacks reserve much
that they never use.
"""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import resource
import signal
import socket
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib import import_module
from itertools import islice
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.connection import wait as wait_for
from multiprocessing.context import ForkServerContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from pushplan.bench import outcome
from pushplan.bench.outcome import LOG, Outcome, perform, resident_megabytes
from pushplan.bench.store import cpu_model, package_version
from pushplan.bench.suite import RunSpec
from pushplan.errors import PushplanError

Work = Callable[[RunSpec, Path], Outcome]
"""What a run's process does; a function of a module, so that the process finds it by name."""

PRELOAD = "pushplan.bench.preload"
"""Module that the fork server imports."""

NAME = "pushplan-run"
"""Name of the processes of runs."""

OUTPUT = "output.txt"
"""File in the run's folder that takes the process's standard streams."""

WATCH = 0.05
"""Seconds between two looks at the memory of a run."""

LINGER = 5.0
"""Seconds that the process of a run may take to end after it has sent its outcome."""

HEADROOM = 1000.0
"""MB beyond the memory limit at which the kernel refuses more: what a run may grow by between two looks at it."""

TOO_LARGE = 77
"""Exit code of a process that has taken too much memory."""

MOST_OUTPUT = 4000
"""Characters of what a process that died has written, kept for people: as many of its beginning as of its end."""

CONNECT = 10.0
"""Seconds to wait for the scheduler of a cluster."""

PHASES = ("posing_time", "timing_time", "execution_time", "logging_time", "validation_time", "trials_time")
"""Parts of a run's total time, beside that of the search."""


Engine = Callable[[Iterable[RunSpec]], Generator[Outcome]]
"""Does runs and yields how they ended, in the order in which they end."""


class ExecutorError(PushplanError):
    """Runs cannot be executed: a cluster cannot be used."""


# --- where runs are done ----------------------------------------------------------------------------------------


@contextmanager
def local_engine(jobs: int, scratch: Path | None = None, work: Work = perform) -> Iterator[Engine]:
    """Yield what does runs on this machine; closing its iterator kills those that go on.

    Args:
        jobs: Runs at a time.
        scratch: Folder for the files of runs; None for the system's place for temporary files.
        work: What a run's process does.
    """
    start = _context().Process(target=int)  # the fork server gets ready, which compiles the first time
    start.start()
    start.join()
    with ThreadPoolExecutor(jobs) as executor:
        do = partial(isolated, scratch=scratch, work=work)
        yield partial(_outcomes, executor=executor, do=do, most=jobs, stop=_kill_runs)


def _kill_runs() -> None:
    with _STARTS:
        for process in multiprocessing.active_children():
            if process.name == NAME:
                process.kill()


@contextmanager
def cluster_engine(address: str, work: Work = perform) -> Iterator[Engine]:
    """Yield what does runs on the workers of a Dask cluster; leaving it cancels those that wait.

    Workers may come and go. A run whose worker is lost is done again elsewhere; one that takes its workers with it
    again and again ends as a crash.

    Args:
        address: Of the scheduler, e.g. `tcp://host:8786`.
        work: What a run's process does.

    Raises:
        ExecutorError: When Dask is not installed or the scheduler does not answer.
    """
    try:
        dask: Any = import_module("distributed")
    except ImportError as error:
        raise ExecutorError("this needs Dask: install pushplan[dask]") from error
    try:
        client = dask.Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ExecutorError(f"no scheduler answers at {address}: {error}") from error
    with client:
        executor = client.get_executor(pure=False)
        try:
            yield partial(_outcomes, executor=executor, do=partial(_isolated_on_worker, work=work))
        finally:
            executor.shutdown(wait=False)


def _outcomes(
    specs: Iterable[RunSpec],
    executor: Executor,
    do: Callable[[RunSpec], Outcome],
    most: int | None = None,
    stop: Callable[[], None] | None = None,
) -> Generator[Outcome]:
    """Submit runs, `most` at a time, each when there is a place for it, and yield how they end.

    Where the iterator is closed before, `stop` is called until those that have begun are over.
    """
    waiting = iter(specs)
    live: dict[Future[Outcome], RunSpec] = {}
    try:
        while True:
            for spec in islice(waiting, None if most is None else most - len(live)):
                live[executor.submit(do, spec)] = spec
            if not live:
                return
            for future in wait(live, return_when=FIRST_COMPLETED).done:
                yield _outcome(future, live.pop(future))
    finally:
        for future in live:
            future.cancel()
        while stop is not None and not all(future.done() for future in live):
            stop()
            time.sleep(0.01)


def _outcome(future: Future[Outcome], spec: RunSpec) -> Outcome:
    try:
        return future.result()
    except PushplanError:
        raise
    except CancelledError as error:
        raise ExecutorError("the scheduler is gone; go on with --resume when it is back") from error
    except Exception as error:
        if type(error).__name__ == "KilledWorker":
            return Outcome(spec.key, outcome.CRASH, "every worker that did this run was lost")
        raise ExecutorError(f"a worker failed: {error!r}") from error


# --- one run, as seen by who wants it ---------------------------------------------------------------------------


def isolated(spec: RunSpec, scratch: Path | None = None, work: Work = perform) -> Outcome:
    """Do a run in a process of its own and return how it ended, whatever happens to it."""
    with tempfile.TemporaryDirectory(prefix=f"{spec.key}-", dir=scratch, ignore_cleanup_errors=True) as name:
        folder = Path(name).absolute()
        began = time.monotonic()
        ended = _ended(work, spec, folder)
        seconds = time.monotonic() - began
        whole, part = folder / LOG, folder / f"{LOG}.partial"
        log = next((path.read_bytes() for path in (whole, part) if path.exists()), None)
        values = {**ended.values, "total_time": seconds}
        if ended.values.get("time") is not None:
            known = (v for name, v in ended.values.items() if name == "time" or name in PHASES)
            values["overhead_time"] = seconds - sum(v or 0.0 for v in known)
        return replace(
            ended, values=values, log=log, whole=whole.exists(), host=socket.gethostname(), cpu=cpu_model()
        )


def _ended(work: Work, spec: RunSpec, folder: Path) -> Outcome:
    context = _context()
    reading, writing = context.Pipe(duplex=False)
    process = context.Process(target=_do_run, args=(writing, work, spec, folder), name=NAME)
    with reading:
        with writing, _STARTS:
            process.start()
        try:
            if wait_for([reading, process.sentinel], spec.seconds):
                sent: Outcome = reading.recv()
                return sent
            process.kill()
            return Outcome(spec.key, outcome.TIMEOUT, _with_output(f"killed after {spec.seconds:g} s", folder))
        except (EOFError, OSError):  # the process died before it had sent all
            code = _exit_code(process)
            if code == TOO_LARGE:
                text = f"killed with more than {spec.megabytes:g} MB in use"
                return Outcome(spec.key, outcome.OUT_OF_MEMORY, text)
            return Outcome(spec.key, outcome.CRASH, _with_output(_death(code), folder))
        finally:
            _exit_code(process)


def _exit_code(process: BaseProcess) -> int | None:
    """Return the exit code of a process that is ending; kill it if it does not."""
    if not wait_for([process.sentinel], LINGER):
        process.kill()
    with _STARTS:  # the fork server tells the code once, to the first of all threads that asks
        process.join()
    return process.exitcode


def _isolated_on_worker(spec: RunSpec, work: Work) -> Outcome:
    here = package_version()
    if spec.version != here:
        raise ExecutorError(
            f"a worker has pushplan {here}, the benchmark {spec.version}; install the same everywhere"
        )
    if multiprocessing.current_process().daemon:
        raise ExecutorError(
            "a worker may not start processes; start it with DASK_DISTRIBUTED__WORKER__DAEMON=False or --no-nanny"
        )
    return isolated(spec, work=work)


SAFE_PATH = "PYTHONSAFEPATH"
_STARTS = threading.Lock()
"""Held while processes start and end: `multiprocessing` looks at all of them then, from whichever thread."""


def _context() -> ForkServerContext:
    """Return what starts processes: they are forked from one that has loaded all that runs and `__main__` need."""
    main = getattr(sys.modules["__main__"], "__spec__", None)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([PRELOAD, __name__, *([main.name] if main is not None else [])])
    # Python puts the working directory first on the path of the fork server, which would import a `secrets.py` there.
    # The variable is set while the server starts only: programs that the caller starts look up modules as ever.
    with _STARTS:
        before = os.environ.get(SAFE_PATH)
        os.environ[SAFE_PATH] = "1"
        try:
            forkserver.ensure_running()
        finally:
            if before is None:
                os.environ.pop(SAFE_PATH, None)
            else:
                os.environ[SAFE_PATH] = before
    return context


UNKNOWN_END = 255
"""Exit code that `multiprocessing` makes up where its fork server does not tell how a process ended."""


def _with_output(text: str, folder: Path) -> str:
    """Add the beginning and the end of what the process of a run has written on its standard streams."""
    path = folder / OUTPUT
    written = path.read_text(errors="replace").strip() if path.exists() else ""
    if len(written) > MOST_OUTPUT:
        # A crash says what it was at its beginning; its modules take pages after that.
        written = f"{written[: MOST_OUTPUT // 2]}\n...\n{written[-MOST_OUTPUT // 2 :]}"
    return f"{text}\n{written}" if written else text


def _death(code: int | None) -> str:
    if code == UNKNOWN_END:
        return "the process ended, and the fork server cannot say how"
    if code is None or code >= 0:
        return f"the process ended by itself with exit code {code}"
    name = signal.Signals(-code).name if -code in list(signal.Signals) else f"signal {-code}"
    hint = ", as the system does when memory runs out" if -code == signal.SIGKILL else ""
    return f"killed by {name}{hint}"


# --- one run, in its process ------------------------------------------------------------------------------------


def _do_run(writing: Connection, work: Work, spec: RunSpec, folder: Path) -> None:
    with writing:
        writing.send(_worked(work, spec, folder))


def _worked(work: Work, spec: RunSpec, folder: Path) -> Outcome:
    """Do the work of a run within its limits and return how it ended, as far as its process can tell."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # which ends also what hangs in compiled code
    output = os.open(folder / OUTPUT, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(output, 1)
    os.dup2(output, 2)
    faulthandler.enable(file=2)
    threading.Thread(target=_watch, args=(resident_megabytes() + spec.megabytes,), daemon=True).start()
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        data = next(int(line.split()[1]) for line in lines if line.startswith("VmData"))  # KiB
        most = data * 1024 + int((spec.megabytes + HEADROOM) * 1e6)
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
        return work(spec, folder)
    except MemoryError:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))  # so that it can be told
        return Outcome(spec.key, outcome.OUT_OF_MEMORY, f"more than {spec.megabytes:g} MB were asked for")
    except PushplanError as error:
        return Outcome(spec.key, outcome.ERROR, f"{type(error).__name__}: {error}")
    except BaseException as error:  # SystemExit is a way of ending a run, too
        return Outcome(spec.key, outcome.ERROR, f"{type(error).__name__}: {error}\n{traceback.format_exc()}")


def _watch(megabytes: float) -> None:
    """End this process when it takes too much memory, or when who wanted it is gone."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    while not wait_for([parent.sentinel], timeout=WATCH):
        if resident_megabytes() > megabytes:
            os._exit(TOO_LARGE)
    os._exit(1)
