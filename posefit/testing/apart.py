"""Checks an installed plugin in a process of its own, so that whatever it does is a result and nothing else.

`python -m posefit.testing.apart` is that process: it reads what to check as JSON, and writes a line of JSON for each
check that it begins and one for each that has ended. What the plugin prints goes to standard error. Where the process
ends in the middle of a check, or has to be ended, that check has failed, and another process goes on with the next.
"""

import faulthandler
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from posefit import testing
from posefit.limits import memory
from posefit.testing import results
from posefit.testing.fresh import apart_from_prints
from posefit.testing.results import Check, Report, Result, Results

GIGABYTES = 4.0  # what a check may need
GRACE = 5.0  # seconds that a check may overrun its limit before its process is ended
STARTING = 120.0  # seconds until the process has loaded the plugin
LEAVING = 0.5  # seconds that it has to end by itself


def check_apart(kind: Any, name: str, settings: Sequence[str] = (), only: Sequence[str] = ()) -> Report:
    """Return what the checks, or `only` those named, say of an installed plugin with settings such as `shrink=0.9`.

    Raises ValueError where a setting or a check is wrong, or the plugin cannot be loaded.
    """
    found, wanted, label = Results(), None, ""
    while wanted is None or wanted:
        with _process(kind, name, settings, only if wanted is None else wanted) as process:
            conversation = _Conversation(process, f"{kind} {name!r}")
            left = conversation.run(found)
        label = conversation.label
        done = {one.name for one in found.all}
        wanted = [rule for rule in left if rule not in done]
        while wanted and (skipped := found.not_run(wanted[0])):
            found.add(skipped)
            wanted.pop(0)
    return Report(label, found.all)


class _Conversation:
    """What one process says, until it has no more to say or is ended."""

    def __init__(self, process: "subprocess.Popen[bytes]", label: str) -> None:
        self._process, self._rest, self._late = process, b"", False
        self.label = label  # how an error names the plugin

    def run(self, found: Results) -> list[str]:
        """Return the names of the checks that it was about to run; add the results of those that it ran."""
        names: list[str] | None = None
        running, patience = "", STARTING
        while (word := self._word(patience)) is not None:
            if "mistake" in word:
                raise ValueError(word["mistake"])
            if "checks" in word:
                names, self.label = word["checks"], word["label"]
            elif "begins" in word:
                running, patience = word["begins"], results.SECONDS + GRACE
            elif "name" in word:
                found.add(Result(**word))
                running, patience = "", GRACE
            if "ends" in word or found.not_run(""):
                return names or []
        if names is None:
            raise ValueError(f"{self.label}: it must load in a process of its own; {self._end()}")
        done = {one.name for one in found.all}
        found.add(Result(running or next(name for name in names if name not in done), "failed", self._end()))
        return names

    def _word(self, patience: float) -> dict[str, Any] | None:
        """Return the next thing it says; None where it has ended, or takes too long."""
        assert self._process.stdout is not None
        until = time.monotonic() + patience
        while b"\n" not in self._rest:
            ready, _, _ = select.select([self._process.stdout], [], [], max(0.0, until - time.monotonic()))
            more = os.read(self._process.stdout.fileno(), 65536) if ready else b""
            if not more:
                self._late = not ready
                return None
            self._rest += more
        line, _, self._rest = self._rest.partition(b"\n")
        word: dict[str, Any] = json.loads(line)
        return word

    def _end(self) -> str:
        """Return how the process ended, as a result tells it; one that is late says where it is and ends."""
        if self._late:
            self._process.send_signal(signal.SIGABRT)
            return f"it must end within {results.SECONDS:g} s, and did not"
        status = self._process.wait()
        how = f"exit status {status}" if status >= 0 else signal.Signals(-status).name
        return f"it must not end the program, got {how}"


@contextmanager
def _process(kind: Any, name: str, settings: Sequence[str], only: Sequence[str]) -> Iterator["subprocess.Popen[bytes]"]:
    """Start a process that checks a plugin; afterwards neither it nor what it started is left."""
    what: dict[str, Any] = {"kind": kind, "name": name, "settings": list(settings), "only": list(only)}
    what |= {"path": sys.path, "seconds": results.SECONDS}
    process = subprocess.Popen(
        [sys.executable, "-m", __name__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(json.dumps(what).encode())
        process.stdin.close()
        yield process
    finally:
        with suppress(subprocess.TimeoutExpired):
            process.wait(LEAVING)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()


def main() -> None:
    """Check what standard input asks for."""
    faulthandler.enable()
    answer = os.fdopen(apart_from_prints(), "w", encoding="utf-8")
    asked = json.load(sys.stdin)

    def say(**word: Any) -> None:
        answer.write(json.dumps(word) + "\n")
        answer.flush()

    sys.path[:] = asked["path"]
    results.SECONDS = asked["seconds"]
    try:
        label, checks = _checks(asked["kind"], asked["name"], asked["settings"], asked["only"])
    except (ValueError, ImportError) as mistake:
        say(mistake=str(mistake))
        return
    say(checks=[check.name for check in checks], label=label)
    with memory(GIGABYTES):
        for check in checks:
            say(begins=check.name)
            say(**vars(check.run()))
    say(ends=True)


def _checks(kind: Any, name: str, texts: Sequence[str], only: Sequence[str]) -> tuple[str, list[Check]]:
    """Return how an error names a plugin, and its checks; here, as what they import takes its time."""
    from posefit.registry import registry
    from posefit.settings import parse_texts

    offer = registry().offer(kind, name)
    settings = parse_texts(offer.name, offer.factory, texts)
    if kind == "prior" and settings:
        offer.factory(**settings)  # a value that makes no sense is one mistake, not one a check
    checks = {
        "optimiser": lambda: testing.optimiser_checks(offer.factory, next_frame=offer.next_frame, settings=settings),
        "prior": lambda: testing.prior_checks(offer.factory, settings=settings),
        "tracker": lambda: testing.tracker_checks(offer.factory, settings=settings),
        "segmenter": lambda: testing.segmenter_checks(offer.factory, settings=settings),
    }[kind]()
    names = [check.name for check in checks]
    for one in only:
        if one not in names:
            raise ValueError(f"--only must be one of {', '.join(names)}, got {one!r}")
    return offer.label, [check for check in checks if not only or check.name in only]


if __name__ == "__main__":
    main()
