"""A server of this machine alone that shows how far a sweep is, and the report of the cells that are done.

The page is made anew when it is asked for, but never so often that making it takes more than a quarter of the time,
whether it could be made or not: whoever asks too early gets what was made last. Nothing is written, neither to the
ledger nor elsewhere.
"""

import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from posefit.report.live.progress import progress_so_far
from posefit.sweep.ledger import INDEX, Ledger

LOOPBACK = "127.0.0.1"
AGAIN = 5.0  # seconds after which a page loads itself anew, at least
PATIENCE = 3.0  # seconds that a ledger may take to appear: a sweep that is started needs some to begin it
LOOK = 0.1  # seconds between looks for it
REST = 3.0  # times as long as making a report took, until the next one is made
LARGEST_PORT = 65_535
THIS_MACHINE = re.compile(r"(127\.0\.0\.1|localhost)(:\d+)?", re.IGNORECASE)  # what a request may ask for


class Showing:
    """The page of a ledger that grows."""

    def __init__(self, path: str | Path, say: Callable[[str], None]) -> None:
        self._ledger, self._say = Ledger(path, say), say
        self._lock = threading.Lock()
        self._state: tuple[int, int] | None = None
        self._data: dict[str, Any] = {}
        self._document: Callable[[dict[str, Any]], str] = str
        self._made, self._failed = "", ""
        self._took, self._ready = 0.0, 0.0

    def page(self) -> str:
        """Return the page. Raises ValueError where the ledger cannot be read."""
        with self._lock:
            if monotonic() >= self._ready:
                began = monotonic()
                try:
                    self._made, self._failed = self._page(began), ""
                except (ValueError, OSError) as error:  # the ledger has gone away
                    self._failed = str(error)
                finally:
                    self._took = monotonic() - began
                    self._ready = began + (1.0 + REST) * self._took
            if self._failed:
                raise ValueError(self._failed)
            return self._made

    def _page(self, began: float) -> str:
        """Return the page as it is now."""
        progress = progress_so_far(self._ledger)
        state = len(self._ledger), len(self._ledger.quarantined_keys())
        if state != self._state:
            self._data, self._document = self._report()
            self._state = state
        again = max(AGAIN, REST * self._took, REST * (monotonic() - began))
        return self._document({**self._data, "live": {**asdict(progress), "again": again}})

    def _report(self) -> tuple[dict[str, Any], Callable[[dict[str, Any]], str]]:
        """Return what the report says so far, and what makes a page of it."""
        from posefit.report.content import data_of
        from posefit.report.page.webpage import document
        from posefit.report.runs import runs_so_far
        from posefit.report.search.content import data_of_searches
        from posefit.report.search.page.webpage import search_document
        from posefit.report.search.rows import holds_searches, searches_of

        if holds_searches(self._ledger):
            return data_of_searches(searches_of(self._ledger)), search_document
        return data_of(self._ledger, runs_so_far(self._ledger), self._say), document


@contextmanager
def serving(path: str | Path, port: int, say: Callable[[str], None]) -> Iterator[ThreadingHTTPServer]:
    """Give a server that is ready for `serve_forever`; port 0 is any that is free.

    Where there is no ledger yet it is waited for, three seconds at most. Raises ValueError where the folder is none, or
    the port cannot be had.
    """
    if not 0 <= port <= LARGEST_PORT:
        raise ValueError(f"--port must be 0 to {LARGEST_PORT}, got {port}")
    _wait_for(Path(path))
    showing = Showing(path, say)

    class Shown(Handler):
        shown = showing

    try:
        server = ThreadingHTTPServer((LOOPBACK, port), Shown)
    except OSError as error:
        raise ValueError(f"--port must be one that is free, got {port}: {error.strerror or error}") from None
    with server:
        yield server


def _wait_for(path: Path) -> None:
    """Wait until a sweep that was started just now has begun its ledger; not for ever, and not for a file."""
    if path.is_file() or (path / INDEX).exists():
        return
    until = monotonic() + PATIENCE
    while monotonic() < until and not (path / INDEX).exists():
        sleep(LOOK)


def address_of(server: ThreadingHTTPServer) -> str:
    """Return what a browser on this machine opens."""
    return f"http://{LOOPBACK}:{server.server_address[1]}/"


class Handler(BaseHTTPRequestHandler):
    """Answers with the page, to who asks for this machine: a name that somebody else points here is refused."""

    shown: Showing

    def do_GET(self) -> None:
        """Answer a request."""
        if not THIS_MACHINE.fullmatch(self.headers.get("Host", "")):
            self._answer(403, "this server answers to its own machine alone", "text/plain")
        elif self.path.partition("?")[0] != "/":
            self._answer(404, "there is one page here: /", "text/plain")
        else:
            try:
                status, text, kind = 200, self.shown.page(), "text/html"
            except ValueError as error:
                status, text, kind = 500, str(error), "text/plain"
            self._answer(status, text, kind)

    def _answer(self, status: int, text: str, kind: str) -> None:
        content = text.encode()
        with suppress(ConnectionError):  # nobody waits for it any more
            self.send_response(status)
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
            self.send_header("Content-Length", str(len(content)))
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Say nothing of each request."""
