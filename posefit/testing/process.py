"""Checks an installed plugin in a process of its own, so that whatever it does becomes a result.

`python -m posefit.testing.process` is that process: it reads what to check as JSON, and writes a line of JSON before
and after each check. What the plugin prints goes to standard error. A check in which the process ends or hangs has
failed, and another process goes on with the next one. `python -m posefit.testing.process trace` reads a pickled
optimiser case and writes its trace.
"""

import faulthandler
import json
import os
import pickle
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from posefit import testing
from posefit.errors import InputError
from posefit.limits import memory
from posefit.testing import results
from posefit.testing.results import Check, Report, Result, not_run

GIGABYTES = 4.0  # what a check may need
OVERRUN_SECONDS = 5.0  # that a check may overrun its limit before its process is ended
START_SECONDS = 120.0  # until the process has loaded the plugin
LEAVE_SECONDS = 0.5  # that it has to end by itself


def check_in_process(kind: Any, name: str, settings: Sequence[str] = (), only: Sequence[str] = ()) -> Report:
    """Return the report on an installed plugin with settings such as `population_size=20`; `only` names the checks.

    Raises ValueError where a setting or a check is wrong, or the plugin cannot be loaded.
    """
    done: list[Result] = []
    wanted, label = None, f"{kind} {name!r}"
    while wanted is None or wanted:
        with _process(kind, name, settings, only if wanted is None else wanted) as process:
            names, label = _converse(process, label, done)
        wanted = [rule for rule in names if rule not in {result.name for result in done}]
        while wanted and (skipped := not_run(wanted[0], done)):
            done.append(skipped)
            wanted.pop(0)
    return Report(label, tuple(done))


def _converse(process: "subprocess.Popen[bytes]", label: str, done: list[Result]) -> tuple[list[str], str]:
    """Add the results of one process to `done`; return the checks that it was to run, and the plugin's label."""
    assert process.stdout is not None
    names: list[str] | None = None
    running, limit, rest, late = "", START_SECONDS, b"", False
    while not late:
        until = time.monotonic() + limit
        while b"\n" not in rest:
            ready, _, _ = select.select([process.stdout], [], [], max(0.0, until - time.monotonic()))
            more = os.read(process.stdout.fileno(), 65536) if ready else b""
            late = not ready
            if not more:
                break
            rest += more
        if b"\n" not in rest:
            break
        line, _, rest = rest.partition(b"\n")
        message: dict[str, Any] = json.loads(line)
        if "mistake" in message:
            raise InputError(message["mistake"])
        if "checks" in message:
            names, label = message["checks"], message["label"]
        elif "begins" in message:
            running, limit = message["begins"], results.SECONDS + OVERRUN_SECONDS
        elif "name" in message:
            done.append(Result(**message))
            running, limit = "", OVERRUN_SECONDS
        if "ends" in message or not_run("", done):
            return names or [], label
    if late:  # the process is made to print where it hangs
        process.send_signal(signal.SIGABRT)
        end = f"it must end within {results.SECONDS:g} s, and did not"
    else:
        status = process.wait()
        how = f"exit status {status}" if status >= 0 else signal.Signals(-status).name
        end = f"it must not end the program, got {how}"
    if names is None:
        raise InputError(f"{label}: it must load in a process of its own; {end}")
    finished = {result.name for result in done}
    done.append(Result(running or next(name for name in names if name not in finished), "failed", end))
    return names, label


@contextmanager
def _process(kind: Any, name: str, settings: Sequence[str], only: Sequence[str]) -> Iterator["subprocess.Popen[bytes]"]:
    """Start a process that checks a plugin; afterwards neither it nor what it started is left."""
    task: dict[str, Any] = {"kind": kind, "name": name, "settings": list(settings), "only": list(only)}
    task |= {"path": sys.path, "seconds": results.SECONDS}
    process = subprocess.Popen(
        [sys.executable, "-m", __name__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(json.dumps(task).encode())
        process.stdin.close()
        yield process
    finally:
        with suppress(subprocess.TimeoutExpired):
            process.wait(LEAVE_SECONDS)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()


def _check() -> int:
    """Check what standard input asks for; return 0."""
    faulthandler.enable()
    out = os.fdopen(_stdout_kept_apart(), "w", encoding="utf-8")
    task = json.load(sys.stdin)

    def send(**message: Any) -> None:
        out.write(json.dumps(message) + "\n")
        out.flush()

    sys.path[:] = task["path"]
    results.SECONDS = task["seconds"]
    try:
        label, checks = _checks(task["kind"], task["name"], task["settings"], task["only"])
    except (ValueError, ImportError) as mistake:
        send(mistake=str(mistake))
        return 0
    send(checks=[check.name for check in checks], label=label)
    with memory(GIGABYTES):
        for check in checks:
            send(begins=check.name)
            send(**vars(check.run()))
    send(ends=True)
    return 0


def _checks(kind: Any, name: str, texts: Sequence[str], only: Sequence[str]) -> tuple[str, list[Check]]:
    """Return a plugin's label and its checks."""
    from posefit.registry import registry
    from posefit.settings import parse_texts

    offer = registry().offer(kind, name)
    settings = parse_texts(offer.name, offer.factory, texts)
    if kind == "prior" and settings:
        offer.factory(**settings)  # a value that makes no sense is one mistake, not one a check
    options = {"next_frame": offer.next_frame} if kind == "optimiser" else {}
    checks: list[Check] = getattr(testing, f"{kind}_checks")(offer.factory, settings=settings, **options)
    names = [check.name for check in checks]
    for rule in only:
        if rule not in names:
            raise InputError(f"--only must be one of {', '.join(names)}, got {rule!r}")
    return offer.label, [check for check in checks if not only or check.name in only]


def _trace() -> int:
    """Write the trace of a pickled optimiser case; return 0, or 3 where its factory cannot be imported here."""
    out = _stdout_kept_apart()
    path, payload = pickle.load(sys.stdin.buffer)
    sys.path[:] = path
    try:
        case = pickle.loads(payload)
    except Exception:
        return 3
    trace = case.trace()
    with os.fdopen(out, "wb") as stream:
        stream.write(pickle.dumps(trace))
    return 0


def _stdout_kept_apart() -> int:
    """Return a file descriptor of what was standard output; whatever is printed from now on goes to standard error."""
    out = os.dup(1)
    os.dup2(2, 1)
    return out


if __name__ == "__main__":
    sys.exit((_trace if sys.argv[1:] == ["trace"] else _check)())
