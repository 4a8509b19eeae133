"""Executes each run in its own process, so that a crash ends only that run and becomes its outcome.

The standard library's fork server has imported and compiled everything (`preload`), and each run is a new process
forked from it. Runs share no state, each has its own peak memory, and each can be killed at any time. An executor of
`concurrent.futures` starts these processes one after the other: from threads of this process, or from the workers of
a Dask cluster.

The memory limit of a run excludes the code and kernels that it starts with. A thread of the run checks its resident
set several times a second. The kernel (RLIMIT_DATA) refuses memory to a run that grows faster. A limit of the address
space (RLIMIT_AS) would not help: compiled code and thread stacks reserve much more than they use.
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
"""Work of a run's process: a function at module level, because the process imports it by name."""

PRELOAD = "pushplan.bench.preload"
"""Module that the fork server imports."""

NAME = "pushplan-run"
"""Name of the processes of runs."""

OUTPUT = "output.txt"
"""File in the run's folder with the standard streams of the process."""

WATCH = 0.05
"""Time between two checks of the memory of a run, s."""

LINGER = 5.0
"""Largest time from the outcome of a run to the end of its process, s."""

HEADROOM = 1000.0
"""Distance of the kernel's limit from the memory limit, MB: a run can grow by this much between two checks."""

TOO_LARGE = 77
"""Exit code of a process that exceeded the memory limit."""

MOST_OUTPUT = 4000
"""Largest output of a dead process in its message, letters: half from the start, half from the end."""

CONNECT = 10.0
"""Time to wait for the scheduler of a cluster, s."""

PHASES = ("posing_time", "timing_time", "execution_time", "logging_time", "validation_time", "trials_time")
"""Parts of a run's total time, without the search."""


Engine = Callable[[Iterable[RunSpec]], Generator[Outcome]]
"""Executes runs and yields their outcomes in the order in which they end."""


class ExecutorError(PushplanError):
    """Runs cannot be executed, because a cluster cannot be used."""


# --- engines ----------------------------------------------------------------------------------------------------


@contextmanager
def local_engine(jobs: int, scratch: Path | None = None, work: Work = perform) -> Iterator[Engine]:
    """Yield an engine for runs on this machine; closing its iterator kills running runs.

    Args:
        jobs: Number of parallel runs.
        scratch: Folder for the files of runs; None for the system's folder of temporary files.
        work: Work of a run's process.
    """
    start = _context().Process(target=int)  # starts the fork server, which compiles kernels the first time
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
    """Yield an engine for runs on the workers of a Dask cluster; leaving it cancels waiting runs.

    Workers can join and leave. A run whose worker is lost is repeated elsewhere; a run that repeatedly kills its
    workers ends as a crash.

    Args:
        address: Address of the scheduler, e.g. `tcp://host:8786`.
        work: Work of a run's process.

    Raises:
        ExecutorError: If Dask is not installed or the scheduler does not answer.
    """
    try:
        dask: Any = import_module("distributed")
    except ImportError as error:
        raise ExecutorError("--scheduler needs Dask: install pushplan[dask]") from error
    try:
        client = dask.Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ExecutorError(f"the scheduler at {address} does not answer: {error}") from error
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
    """Submit runs, at most `most` at a time, and yield their outcomes.

    If the iterator is closed early, `stop` is called until all started runs have ended.
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
        raise ExecutorError("lost the connection to the scheduler; continue later with --resume") from error
    except Exception as error:
        if type(error).__name__ == "KilledWorker":
            return Outcome(spec.key, outcome.CRASH, "this run repeatedly killed its worker")
        raise ExecutorError(f"a worker failed: {error!r}") from error


# --- one run, from outside its process --------------------------------------------------------------------------


def isolated(spec: RunSpec, scratch: Path | None = None, work: Work = perform) -> Outcome:
    """Execute a run in its own process and return its outcome, even if the process crashes."""
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
        except (EOFError, OSError):  # the process died before it sent its outcome
            code = _exit_code(process)
            if code == TOO_LARGE:
                text = f"killed because it used more than {spec.megabytes:g} MB"
                return Outcome(spec.key, outcome.OUT_OF_MEMORY, text)
            return Outcome(spec.key, outcome.CRASH, _with_output(_death(code), folder))
        finally:
            _exit_code(process)


def _exit_code(process: BaseProcess) -> int | None:
    """Return the exit code of an ending process; kill it if it does not end."""
    if not wait_for([process.sentinel], LINGER):
        process.kill()
    with _STARTS:  # the fork server reports the code only once, to the first thread
        process.join()
    return process.exitcode


def _isolated_on_worker(spec: RunSpec, work: Work) -> Outcome:
    here = package_version()
    if spec.version != here:
        raise ExecutorError(
            f"a worker has pushplan {here}, but the benchmark has {spec.version}; install the same version everywhere"
        )
    if multiprocessing.current_process().daemon:
        raise ExecutorError(
            "a worker cannot start processes; start it with DASK_DISTRIBUTED__WORKER__DAEMON=False or --no-nanny"
        )
    return isolated(spec, work=work)


SAFE_PATH = "PYTHONSAFEPATH"
_STARTS = threading.Lock()
"""Held while processes start and end, because `multiprocessing` then checks all of them from any thread."""


def _context() -> ForkServerContext:
    """Return the context that starts processes, forked from a server with all imports of runs and `__main__`."""
    main = getattr(sys.modules["__main__"], "__spec__", None)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([PRELOAD, __name__, *([main.name] if main is not None else [])])
    # Without it, the working directory is first on the fork server's path, which would import a `secrets.py` there.
    # The variable is set only while the server starts, so that it does not affect other programs of the caller.
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
"""Exit code of `multiprocessing` if its fork server does not report how a process ended."""


def _with_output(text: str, folder: Path) -> str:
    """Return a text with the start and the end of the output of a run's process."""
    path = folder / OUTPUT
    written = path.read_text(errors="replace").strip() if path.exists() else ""
    if len(written) > MOST_OUTPUT:
        # The reason of a crash is at the start; the list of its modules fills pages after it.
        written = f"{written[: MOST_OUTPUT // 2]}\n...\n{written[-MOST_OUTPUT // 2 :]}"
    return f"{text}\n{written}" if written else text


def _death(code: int | None) -> str:
    if code == UNKNOWN_END:
        return "the process ended for an unknown reason"
    if code is None or code >= 0:
        return f"the process ended by itself with exit code {code}"
    name = signal.Signals(-code).name if -code in list(signal.Signals) else f"signal {-code}"
    hint = ", perhaps by the system because it ran out of memory" if -code == signal.SIGKILL else ""
    return f"killed by {name}{hint}"


# --- one run, inside its process --------------------------------------------------------------------------------


def _do_run(writing: Connection, work: Work, spec: RunSpec, folder: Path) -> None:
    with writing:
        writing.send(_worked(work, spec, folder))


def _worked(work: Work, spec: RunSpec, folder: Path) -> Outcome:
    """Do the work of a run within its limits and return its outcome, as known inside its process."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # also ends compiled code that hangs
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
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))  # memory to report the outcome
        return Outcome(spec.key, outcome.OUT_OF_MEMORY, f"requested more than {spec.megabytes:g} MB")
    except PushplanError as error:
        return Outcome(spec.key, outcome.ERROR, f"{type(error).__name__}: {error}")
    except BaseException as error:  # SystemExit also ends a run
        return Outcome(spec.key, outcome.ERROR, f"{type(error).__name__}: {error}\n{traceback.format_exc()}")


def _watch(megabytes: float) -> None:
    """End this process if it uses too much memory, or if its parent has ended."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    while not wait_for([parent.sentinel], timeout=WATCH):
        if resident_megabytes() > megabytes:
            os._exit(TOO_LARGE)
    os._exit(1)
