"""Checks an installed plugin in a separate process, so that no plugin stops a report.

`python -m posefit.testing.process` is that process. It reads what to check as JSON,
and writes a line of JSON before and after each check. The plugin's prints go to
standard error. If the process ends or hangs during a check, that check has failed, and
another process continues with the next one.
"""

import faulthandler
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from posefit.errors import InputError, warn_in_one_line
from posefit.fitting.check import one_of
from posefit.limits import end_with_parent, memory
from posefit.testing import checks_of, results
from posefit.testing.results import Check, Report, Result, not_run

GIGABYTES = 4.0  # memory limit of a check
OVERRUN_SECONDS = 5.0  # how long a check may overrun before its process is ended


def check_in_process(
    kind: Any, name: str, settings: Sequence[str] = (), only: Sequence[str] = ()
) -> Report:
    """Return the report on an installed plugin.

    Args:
        kind: Kind of plugin, such as "optimiser".
        name: Its registered name.
        settings: Texts such as `population_size=20`.
        only: Names of the checks to run, all by default.

    Raises:
        ValueError: A setting or a check is wrong, or the plugin cannot be loaded.
    """
    task: dict[str, Any] = {
        "kind": kind,
        "name": name,
        "settings": list(settings),
        "only": list(only),
    }
    task |= {
        "parent": os.getpid(),
        "path": sys.path,
        "seconds": results.SECONDS,
        "overrun": OVERRUN_SECONDS,
    }
    done: list[Result] = []
    while True:
        messages, blame = _messages(task)
        plugin = messages[0] if messages else {}
        if "mistake" in plugin:
            raise InputError(plugin["mistake"])
        if "checks" not in plugin:
            raise InputError(
                f"{kind} {name!r}: it must load in a separate process; {blame}"
            )
        for message in messages:
            # the others say that a check begins
            if "outcome" in message:
                done.append(Result(**message))
        # the process ended during this check: it failed, and the next ones get a new
        # process
        if "outcome" not in messages[-1]:
            done.append(
                Result(messages[-1].get("begins", plugin["checks"][0]), "failed", blame)
            )
        wanted = plugin["checks"][plugin["checks"].index(done[-1].name) + 1 :]
        while wanted and (skipped := not_run(wanted[0], done)):
            done.append(skipped)
            wanted.pop(0)
        if not wanted:
            return Report(plugin["label"], tuple(done))
        task["only"] = wanted


def _messages(task: dict[str, Any]) -> tuple[list[dict[str, Any]], str]:
    """Return the messages of a checking process, and why it ended.

    Processes that the plugin started are killed with it.
    """
    with tempfile.TemporaryFile() as written:
        process = subprocess.Popen(
            [sys.executable, "-m", __name__],
            stdin=subprocess.PIPE,
            stdout=written,
            start_new_session=True,
        )
        try:
            process.communicate(json.dumps(task).encode())
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            status = process.wait()
        ended = time.monotonic()
        written.seek(0)
        messages = [json.loads(line) for line in written]
    # a process that was ended by its own timer reports no reason
    if messages and ended - messages[-1].get("at", ended) > results.SECONDS:
        return messages, f"it must end within {results.SECONDS:g} s, and did not"
    if status >= 0:
        how = f"exit status {status}"
    else:
        how = signal.Signals(-status).name
    return messages, f"it must not end the program, got {how}"


def _check() -> None:
    """Run the checks that standard input describes, and end this process."""
    faulthandler.enable()
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    # the plugin's prints must not mix with the messages
    os.dup2(2, 1)
    task = json.load(sys.stdin)
    end_with_parent(task["parent"])

    def send(**message: Any) -> None:
        out.write(json.dumps(message) + "\n")
        out.flush()

    sys.path[:] = task["path"]
    warn_in_one_line()
    try:
        label, checks = _checks(
            task["kind"], task["name"], task["settings"], task["only"]
        )
    except (ValueError, ImportError) as mistake:
        send(mistake=str(mistake))
        return
    send(checks=[check.name for check in checks], label=label)
    done: list[Result] = []
    with memory(GIGABYTES):
        for check in checks:
            send(begins=check.name, at=time.monotonic())
            # ends the process even in compiled code, which a Python signal cannot
            # interrupt
            faulthandler.dump_traceback_later(
                task["seconds"] + task["overrun"], exit=True
            )
            done.append(not_run(check.name, done) or check.run(task["seconds"]))
            send(**vars(done[-1]))
    sys.stdout.flush()
    # threads that the plugin left running would keep an ordinary exit waiting
    os._exit(0)


def _checks(
    kind: Any, name: str, texts: Sequence[str], only: Sequence[str]
) -> tuple[str, list[Check]]:
    from posefit.registry import registry
    from posefit.settings import parse_texts

    offer = registry().offer(kind, name)
    if rivals := registry().rivals(offer):
        labels = []
        for plugin in rivals:
            labels.append(f"{plugin.name} ({plugin.distribution} {plugin.version})")
        theirs = ", ".join(labels)
        raise InputError(
            f"{kind} {name!r} must be registered by one plugin, "
            f"got {offer.distribution}, which is used, "
            f"and {theirs}, which is left out: give it another name"
        )
    settings = parse_texts(offer.name, offer.factory, texts)
    if kind == "prior" and settings:
        # check here: each check would report the same invalid value
        offer.factory(**settings)
    registered = {"optimiser": "next_frame", "tracker": "looks_ahead"}
    if kind in registered:
        more = [getattr(offer, registered[kind])]
    else:
        more = []
    checks = checks_of(kind, offer.factory, settings, *more)
    names = [check.name for check in checks]
    for rule in only:
        one_of("--only", rule, names)
    if only:
        checks = [check for check in checks if check.name in only]
    return offer.label, checks


if __name__ == "__main__":
    _check()
