"""How a process becomes a worker of a pool. What is patched for it is here, and nowhere else.

- A spawned process would import the script that started it once more: while one is started, `__main__` names no file.
- pebble takes a process that ends with status 0 for one that may: in a worker `os._exit(0)` has another status.
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

EXIT_ZERO_STATUS = 64  # the status of a process that a job ended with 0
_starting = threading.Lock()
# by a module's name: its members, and those that can be called as they were when it was first seen
_functions: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {}
# which a process may handle
_SIGNALS = sorted(
    signal.valid_signals()
    - {getattr(signal, name, None) for name in ("SIGKILL", "SIGSTOP")}
)


class _Process(SpawnProcess):
    """A process that imports what it runs, but not the script that started it, which may compare without a guard."""

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802
        main = sys.modules["__main__"]
        with _starting, _interrupts_blocked():
            before = {
                name: getattr(main, name, None) for name in ("__file__", "__spec__")
            }
            try:
                vars(main).update(dict.fromkeys(before))
                return SpawnProcess._Popen(process)  # type: ignore[attr-defined]
            finally:
                vars(main).update(before)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Start processes with Ctrl-C blocked, which they are deaf to only once they have imported what ignores it.

    A terminal sends it to all processes: in between it would end a worker with a traceback. For this process it waits.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # which would end with the interrupt unblocked, were it started with the first process
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Context(SpawnContext):
    """Starts such processes, and ends what they have started."""

    def __init__(self) -> None:
        super().__init__()
        self._started: list[_Process] = []

    def Process(  # type: ignore[override]  # noqa: N802, as its class is called
        self, *arguments: Any, **more: Any
    ) -> _Process:
        """Return a process that is to be started."""
        process = _Process(*arguments, **more)
        self._started.append(process)
        return process

    def end_orphans(self) -> None:
        """End the processes whose worker has ended: those that a cell started are in the worker's group."""
        for process in self._started.copy():
            if process.pid is not None and not _exists(process.pid):
                self._started.remove(process)
                with suppress(OSError, AttributeError):
                    os.killpg(process.pid, signal.SIGKILL)


def _exists(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@contextmanager
def left_as_it_was() -> Iterator[None]:
    """Undo afterwards what the body does to this process: its folder, variables, paths, signals and random numbers.

    So is what NumPy is to do about a division by zero. A worker runs cells of all methods, and what one of them leaves
    behind would reach the others.
    """
    state = _first_state()
    try:
        with np.errstate():
            yield
    finally:
        state.restore()


@lru_cache(maxsize=1)
def _first_state() -> "_State":
    """Return the state that the first job finds; each later job finds the same."""
    return _State()


class _State:
    """The state of this process at the moment, to which it can return; after most jobs nothing has to be undone."""

    def __init__(self) -> None:
        self._folder = os.getcwd()
        self._variables = dict(os.environ)
        self._path = sys.path[:]
        self._handlers = _handlers()
        self._numbers = random.getstate()
        self._bits = mtrand.get_bit_generator()
        self._numpy = np.random.get_state()  # noqa: NPY002

    def restore(self) -> None:
        """Undo what has changed since."""
        os.chdir(self._folder)
        if dict(os.environ) != self._variables:
            os.environ.clear()
            os.environ.update(self._variables)
        sys.path[:] = self._path
        if (handlers := _handlers()) != self._handlers:
            for number, before, now in zip(
                _SIGNALS, self._handlers, handlers, strict=True
            ):
                # None is a handler that is not Python's
                if before is not None and now != before:
                    signal.signal(number, before)
        random.setstate(self._numbers)
        if mtrand.get_bit_generator() is not self._bits:
            mtrand.set_bit_generator(self._bits)
        np.random.set_state(self._numpy)  # noqa: NPY002


@contextmanager
def functions_kept() -> Iterator[None]:
    """Put back afterwards the functions and classes of modules that the body has replaced.

    A plugin that replaces `numpy.linalg.norm`, say, would change what the next method computes in this process.
    Modules that the body loads itself are left as they are.
    """
    for name, module in tuple(sys.modules.items()):
        if name not in _functions and isinstance(module, ModuleType):
            members = vars(module)
            _functions[name] = (
                members,
                {member: value for member, value in members.items() if callable(value)},
            )
    try:
        yield
    finally:
        for members, functions in _functions.values():
            for member, function in functions.items():
                if members.get(member) is not function:
                    members[member] = function


def _handlers() -> list[Any]:
    """Return the handler of each signal. `signal.getsignal` looks for its name as well, which takes much longer."""
    return list(map(_signal.getsignal, _SIGNALS))


def become_worker(parent: int, path: list[str], prepare: bytes) -> None:
    """Make this process a worker: one thread, deaf to Ctrl-C, which is the driver's, and ended with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # what a cell starts is not to inherit that it is blocked
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    # so that a kill from outside looks like one
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    # a group of its own: what a terminal or a script sends to the driver is not for it
    with suppress(AttributeError):
        os.setpgid(0, 0)
    sys.path[:] = path
    # the driver has warned of them
    warnings.simplefilter("ignore", PluginWarning)
    leave = os._exit
    os._exit = lambda status: leave(status or EXIT_ZERO_STATUS)  # see above
    single_thread()
    end_with_parent(parent)
    if (called := pickle.loads(prepare)) is not None:
        called()
