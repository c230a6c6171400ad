"""Turns a process into a worker of a pool. All patches of other libraries are here.

- A spawned process would import the script that started it again. So `__main__` names
  no file while a process is started.
- pebble assumes that a process that ends with status 0 was allowed to. So `os._exit(0)`
  has another status in a worker.
"""

import _signal  # type: ignore[import-not-found]
import os
import pickle
import random
import signal
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from multiprocessing import resource_tracker
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any

import numpy as np
from numpy.random import mtrand

from posefit.errors import PluginWarning
from posefit.limits import end_with_parent
from posefit.sweep.engine import single_thread

EXIT_ZERO_STATUS = 64  # the status of a process in which a job called `os._exit(0)`
_starting = threading.Lock()
# By module name: its members, and a copy of its callable members from before any job.
_functions: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {}
# all signals but the two that no process can handle
_SIGNALS = sorted(
    signal.valid_signals()
    - {getattr(signal, name, None) for name in ("SIGKILL", "SIGSTOP")}
)


class _Process(SpawnProcess):
    """A process that does not import the script that started it.

    The script may start a comparison without an `if __name__ == "__main__"`.
    """

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802
        main = sys.modules["__main__"]
        with _starting, _interrupts_blocked():
            names = ("__file__", "__spec__")
            before = {name: getattr(main, name, None) for name in names}
            try:
                vars(main).update(dict.fromkeys(before))
                return SpawnProcess._Popen(process)  # type: ignore[attr-defined]
            finally:
                vars(main).update(before)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C while the body starts processes, which inherit the block.

    A terminal sends Ctrl-C to all processes. A worker ignores it only once it has
    imported `become_worker`; before that, Ctrl-C would end it with a traceback. This
    process receives it after the body.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Starting the first process would start the tracker as well, which unblocks the
    # interrupt. So start it before the block.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Context(SpawnContext):
    """Starts worker processes, and ends the processes that they leave behind."""

    def __init__(self) -> None:
        super().__init__()
        self._started: list[_Process] = []

    def Process(  # type: ignore[override]  # noqa: N802, as its class is called
        self, *arguments: Any, **more: Any
    ) -> _Process:
        """Return a new process, not yet started."""
        process = _Process(*arguments, **more)
        self._started.append(process)
        return process

    def end_orphans(self) -> None:
        """End the processes whose worker has ended.

        A process that a cell started belongs to its worker's process group.
        """
        for process in self._started.copy():
            # a process that was not started has neither a number nor a status
            if process.pid is None or process.exitcode is None:
                continue
            self._started.remove(process)
            # Windows has no process groups
            with suppress(OSError, AttributeError):
                os.killpg(process.pid, signal.SIGKILL)


@contextmanager
def left_as_it_was() -> Iterator[None]:
    """Undo afterwards the changes that the body makes in this process.

    These are the folder, the environment variables, `sys.path`, the signal handlers,
    the global random numbers and NumPy's handling of floating-point errors. A worker
    runs cells of all methods, and the changes of one must not reach the others.
    """
    state = _first_state()
    try:
        with np.errstate():
            yield
    finally:
        state.restore()


@lru_cache(maxsize=1)
def _first_state() -> "_State":
    """Return the state before the first job, to which each job returns."""
    return _State()


class _State:
    """The state of this process when the object was made, to which it can return."""

    def __init__(self) -> None:
        self._folder = os.getcwd()
        self._variables = dict(os.environ)
        self._path = sys.path[:]
        self._handlers = _handlers()
        self._numbers = random.getstate()
        self._bits = mtrand.get_bit_generator()
        self._numpy = np.random.get_state()  # noqa: NPY002

    def restore(self) -> None:
        """Undo all changes since then."""
        os.chdir(self._folder)
        # most jobs change nothing, and a comparison is faster than writing everything
        if dict(os.environ) != self._variables:
            os.environ.clear()
            os.environ.update(self._variables)
        sys.path[:] = self._path
        if (handlers := _handlers()) != self._handlers:
            for number, before, now in zip(
                _SIGNALS, self._handlers, handlers, strict=True
            ):
                # None means a handler that Python did not install
                if before is not None and now != before:
                    signal.signal(number, before)
        random.setstate(self._numbers)
        if mtrand.get_bit_generator() is not self._bits:
            mtrand.set_bit_generator(self._bits)
        np.random.set_state(self._numpy)  # noqa: NPY002


@contextmanager
def functions_kept() -> Iterator[None]:
    """Put back afterwards the functions and classes of modules that the body replaces.

    A plugin that replaces `numpy.linalg.norm`, for example, would change the results of
    the next method in this process. Modules that the body itself loads do not change.
    """
    for name, module in tuple(sys.modules.items()):
        if name in _functions or not isinstance(module, ModuleType):
            continue
        members = vars(module)
        functions = {}
        for member, value in members.items():
            if callable(value):
                functions[member] = value
        _functions[name] = members, functions
    try:
        yield
    finally:
        for members, functions in _functions.values():
            for member, function in functions.items():
                if members.get(member) is not function:
                    members[member] = function


def _handlers() -> list[Any]:
    """Return the handler of each signal."""
    # `signal.getsignal` also looks up the handler's name, which takes much longer
    return list(map(_signal.getsignal, _SIGNALS))


def become_worker(parent: int, path: list[str], prepare: bytes) -> None:
    """Make this process a worker.

    It has one thread, ignores Ctrl-C, which the driver handles, and ends with its
    parent.

    Args:
        parent: The process id of the driver.
        path: The driver's `sys.path`.
        prepare: A pickled function to call first, or a pickled None.
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
    leave = os._exit
    # the module's docstring says why
    os._exit = lambda status: leave(status or EXIT_ZERO_STATUS)
    single_thread()
    end_with_parent(parent)
    if (called := pickle.loads(prepare)) is not None:
        called()
