"""How a process becomes a worker of a pool. What is patched for it is here, and nowhere else.

- A spawned process would import the script that started it once more: while one is started, `__main__` names no file.
- pebble takes a process that ends with status 0 for one that may: in a worker `os._exit(0)` has another status.
"""

import os
import pickle
import signal
import sys
import threading
import warnings
from contextlib import suppress
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any

from posefit.errors import PluginWarning
from posefit.limits import end_with_parent
from posefit.sweep.engine import single_thread

EXIT_ZERO_STATUS = 64  # the status of a process that a job ended with 0
_starting = threading.Lock()


class _Process(SpawnProcess):
    """A process that imports what it runs, but not the script that started it, which may compare without a guard."""

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802
        main = sys.modules["__main__"]
        with _starting:
            before = {
                name: getattr(main, name, None) for name in ("__file__", "__spec__")
            }
            try:
                vars(main).update(dict.fromkeys(before))
                return SpawnProcess._Popen(process)  # type: ignore[attr-defined]
            finally:
                vars(main).update(before)


class Context(SpawnContext):
    """Starts such processes."""

    Process = _Process


def become_worker(parent: int, path: list[str], prepare: bytes) -> None:
    """Make this process a worker: one thread, deaf to Ctrl-C, which is the driver's, and ended with its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
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
