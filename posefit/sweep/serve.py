"""The side of a worker process: how it starts, and how it runs the jobs it is sent.

`posefit.sweep.worker` is the driver's side.
"""

import _signal  # type: ignore[import-not-found]
import os
import pickle
import random
import signal
import sys
import threading
import warnings
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np
from numpy.random import mtrand

from posefit.errors import PluginWarning
from posefit.limits import end_with_parent, memory
from posefit.sweep.engine import Run, text_of

MARK = "POSEFIT_WORKER"  # the environment variable with the mark of a worker
STARTED = b""  # a worker sends this once, when it can take jobs
# environment variables with the number of threads of libraries
THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
# all signals but the two that no process can handle
_SIGNALS = sorted(
    signal.valid_signals()
    - {getattr(signal, name, None) for name in ("SIGKILL", "SIGSTOP")}
)


def serve(
    parent: int, path: list[str], connection: Connection, task: bytes, gigabytes: float
) -> None:
    """Run each job that the driver sends. Answers are pickled.

    An answer is a pair: the job's result, and the reason if it failed.
    """
    become_worker(parent, path)
    connection.send_bytes(STARTED)
    process = os.getpid()
    prepared: tuple[Run, State] | None = None
    while True:
        try:
            job = connection.recv_bytes()
        except (EOFError, OSError):
            # the driver has ended: `end_with_parent` ends this process and all others
            threading.Event().wait()
        try:
            if prepared is None:
                prepared = _prepared(task)
            run, state = prepared
            try:
                # NumPy's handling of floating-point errors is restored by `errstate`
                with memory(gigabytes), np.errstate():
                    result = run(pickle.loads(job))
            finally:
                state.restore()
            answer = cloudpickle.dumps((result, None))
        except MemoryError:
            reason = f"it needed more memory than its limit of {gigabytes:g} GB"
            answer = pickle.dumps((None, reason))
        # also SystemExit: a cell that exits must not end its worker
        except BaseException as error:
            answer = pickle.dumps((None, text_of(error)))
        # if the job forked, only the original process may answer
        if os.getpid() != process:
            os._exit(0)
        connection.send_bytes(answer)


def _prepared(task: bytes) -> tuple[Run, "State"]:
    """Prepare this process, and return the function of its jobs and its state."""
    run, prepare = pickle.loads(task)
    if prepare is not None:
        prepare()
    return run, State()


def become_worker(parent: int, path: list[str]) -> None:
    """Make this process a worker.

    It has one thread, ignores Ctrl-C, which the driver handles, and ends with its
    parent.

    Args:
        parent: The process id of the driver.
        path: The driver's `sys.path`.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # a process that a cell starts must not inherit the block
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    # a handler of the parent's would hide that the worker was killed from outside
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    # in another process group, it does not receive the signals sent to the driver's
    with suppress(AttributeError):
        os.setpgid(0, 0)
    sys.path[:] = path
    # the driver has already issued these warnings
    warnings.simplefilter("ignore", PluginWarning)
    single_thread()
    end_with_parent(parent, partial(end_marked, os.environ[MARK]))


def single_thread() -> None:
    """Limit each library of this process to one thread, as cells run side by side."""
    # these libraries read the variables when they are loaded
    os.environ.update(dict.fromkeys(THREADS, "1"))
    # numba, once loaded, raises an error at its next compilation if the number changed
    if "numba" not in sys.modules:
        os.environ["NUMBA_NUM_THREADS"] = "1"
    import cv2
    import numba
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    threadpool_limits(1)


class State:
    """The state of this process that a job may change, to be restored after each.

    It is the folder, the environment variables, `sys.path`, the signal handlers and the
    global random numbers. A worker runs cells of several methods, and the changes of
    one must not reach the others.
    """

    def __init__(self) -> None:
        self._folder = os.getcwd()
        self._variables = dict(os.environ)
        self._path = sys.path[:]
        self._handlers = _handlers()
        self._random = random.getstate()
        self._bit_generator = mtrand.get_bit_generator()
        self._numpy_random = np.random.get_state()  # noqa: NPY002

    def restore(self) -> None:
        """Undo all changes since this object was made."""
        os.chdir(self._folder)
        # most jobs change nothing, and a comparison is faster than writing everything
        if dict(os.environ) != self._variables:
            os.environ.clear()
            os.environ.update(self._variables)
        sys.path[:] = self._path
        if _handlers() != self._handlers:
            for number, before in zip(_SIGNALS, self._handlers, strict=True):
                # None means a handler that Python did not install
                if before is not None:
                    signal.signal(number, before)
        random.setstate(self._random)
        mtrand.set_bit_generator(self._bit_generator)
        np.random.set_state(self._numpy_random)  # noqa: NPY002


def _handlers() -> list[Any]:
    """Return the handler of each signal."""
    # `signal.getsignal` also looks up the handler's name, which takes much longer
    return list(map(_signal.getsignal, _SIGNALS))


def end_marked(mark: str) -> None:
    """End all other processes whose environment has a mark, where /proc lists them."""
    for path in Path("/proc").glob("[0-9]*/environ"):
        process = int(path.parent.name)
        # a process may end meanwhile, and others do not let us read theirs
        with suppress(OSError):
            if process != os.getpid() and mark.encode() in path.read_bytes():
                os.kill(process, signal.SIGKILL)
