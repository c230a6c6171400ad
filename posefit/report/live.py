"""The report of a running sweep: its progress, and a local server that shows it with the cells done so far.

The page is made again on request, but takes at most a quarter of the time: earlier requests get the last page, or the
last failure. Nothing is written, neither to the ledger nor elsewhere.
"""

import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from time import monotonic, sleep, time
from typing import Any

from posefit.errors import InputError
from posefit.reading import quoted
from posefit.sweep.driver import read_lease
from posefit.sweep.ledger import INDEX, LEASES, ROWS, SHORT, Ledger
from posefit.sweep.log import SUFFIX, is_locked

LOOPBACK = "127.0.0.1"
RELOAD_SECONDS = 5.0  # after which a page loads again, at least
LEDGER_TIMEOUT_SECONDS = 3.0  # that a sweep just started may take to create its ledger
POLL_SECONDS = 0.1
REST_FACTOR = 3.0  # times as long as making a page took, until the next one is made
MAX_PORT = 65_535
THIS_MACHINE = re.compile(r"(127\.0\.0\.1|localhost)(:\d+)?", re.IGNORECASE)  # hosts that a request may name


@dataclass(frozen=True)
class Progress:
    """The numbers of cells of the plan begun last, or of all cells if no plan is known."""

    cells: int | None  # of the plan
    done: int
    quarantined: int
    left: int | None  # neither done nor in quarantine, running ones included
    running: int  # leased by live drivers
    failed: int  # failed attempts at cells that are neither done nor in quarantine, which will be repeated
    seconds: float | None  # estimate for the cells left, at the pace since the plan was begun or resumed


def progress_of(ledger: Ledger, now: float | None = None) -> Progress:
    """Return the progress of the plan that was begun last; `now` is the time in seconds since 1970."""
    ledger.refresh()
    (running, failed), quarantine = _attempts(ledger), ledger.quarantined_keys()
    plans = ledger.plans()
    if not plans:
        return Progress(None, len(ledger), len(quarantine), None, running, failed, None)
    plan = plans[0]
    mine = {plan.keys[k : k + SHORT] for k in range(0, len(plan.keys), SHORT)}
    done, quarantined = (
        sum(bytes.fromhex(key[: 2 * SHORT]) in mine for key in keys) for keys in (ledger.keys(), quarantine)
    )
    left, elapsed = plan.cells - done - quarantined, (time() if now is None else now) - plan.begun
    settled = done + quarantined - plan.settled
    known = running and left and settled > 0 and elapsed > 0.0
    return Progress(plan.cells, done, quarantined, left, running, failed, left * elapsed / settled if known else None)


def _attempts(ledger: Ledger) -> tuple[int, int]:
    """Return how many cells live drivers have leased, and how many attempts at unsettled cells have failed."""
    drivers: list[str] = []
    failed = 0
    for path in (ledger.path / LEASES).glob("[!.]*"):
        with suppress(OSError):
            lease = read_lease(path) or {}
            failed += "failed" in lease
            if "driver" in lease and "failed" not in lease:
                drivers.append(lease["driver"])
    alive = {name: is_locked(ledger.path / ROWS / f"{name}{SUFFIX}") for name in set(drivers)}
    return sum(alive[name] for name in drivers), failed


class LivePage:
    """The page of a growing ledger."""

    def __init__(self, path: str | Path, warn: Callable[[str], None]) -> None:
        self._ledger, self._warn = Ledger(path, warn), warn
        self._lock = threading.Lock()
        self._state: tuple[int, int] | None = None
        self._data: dict[str, Any] = {}
        self._page, self._failure = "", ""
        self._seconds, self._ready = 0.0, 0.0

    def page(self) -> str:
        """Return the page. Raises ValueError where the ledger cannot be read."""
        with self._lock:
            if (began := monotonic()) >= self._ready:
                try:
                    self._page, self._failure = self._make(began), ""
                except (ValueError, OSError) as error:
                    self._failure = str(error)
                self._seconds = monotonic() - began
                self._ready = began + (1.0 + REST_FACTOR) * self._seconds
            if self._failure:
                raise InputError(self._failure)
            return self._page

    def _make(self, began: float) -> str:
        from posefit.report.content import data_of
        from posefit.report.page import document
        from posefit.report.runs import runs_of

        progress = progress_of(self._ledger)
        state = len(self._ledger), len(self._ledger.quarantined_keys())
        if state != self._state:
            self._data = data_of(self._ledger, runs_of(self._ledger, may_be_empty=True), self._warn)
            self._state = state
        reload = max(RELOAD_SECONDS, REST_FACTOR * self._seconds, REST_FACTOR * (monotonic() - began))
        return document({**self._data, "live": {**vars(progress), "reload": reload}})


@contextmanager
def serving(path: str | Path, port: int, warn: Callable[[str], None]) -> Iterator[ThreadingHTTPServer]:
    """Give a server that is ready for `serve_forever`; port 0 is any free one.

    Waits up to three seconds for a missing ledger. Raises ValueError where there is no ledger or the port is taken.
    """
    if not 0 <= port <= MAX_PORT:
        raise InputError(f"--port must be 0 to {MAX_PORT}, got {quoted(port)}")
    until = monotonic() + LEDGER_TIMEOUT_SECONDS
    while not Path(path).is_file() and not (Path(path) / INDEX).exists() and monotonic() < until:
        sleep(POLL_SECONDS)

    class PageHandler(Handler):
        live = LivePage(path, warn)

    try:
        server = ThreadingHTTPServer((LOOPBACK, port), PageHandler)
    except OSError as error:
        raise InputError(f"--port must be one that is free, got {port}: {error.strerror or error}") from None
    with server:
        yield server


def address_of(server: ThreadingHTTPServer) -> str:
    """Return the address for a browser on this machine."""
    return f"http://{LOOPBACK}:{server.server_address[1]}/"


class Handler(BaseHTTPRequestHandler):
    """Answers requests for this machine with the page, and refuses other host names that resolve to it."""

    live: LivePage

    def do_GET(self) -> None:
        """Answer a request."""
        status, kind = 200, "text/plain"
        if not THIS_MACHINE.fullmatch(self.headers.get("Host", "")):
            status, text = 403, "this server answers requests from its own machine only"
        elif self.path.partition("?")[0] != "/":
            status, text = 404, "there is one page here: /"
        else:
            try:
                text, kind = self.live.page(), "text/html"
            except ValueError as error:
                status, text = 500, str(error)
        content = text.encode()
        with suppress(ConnectionError):  # the browser has gone away
            self.send_response(status)
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Log nothing."""
