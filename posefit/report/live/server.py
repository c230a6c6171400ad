"""A server of this machine alone that shows how far a sweep is, and the report of the cells that are done.

The page is made anew when it is asked for and something has changed, but never so often that making it takes more than
a quarter of the time. Nothing is written, neither to the ledger nor elsewhere.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from time import monotonic
from typing import Any

from posefit.report.live.progress import progress_so_far
from posefit.sweep.ledger import Ledger

LOOPBACK = "127.0.0.1"
AGAIN = 5.0  # seconds after which a page loads itself anew, at least
REST = 3.0  # times as long as making a report took, until the next one is made
LARGEST_PORT = 65_535


class Showing:
    """The page of a ledger that grows."""

    def __init__(self, path: str | Path, say: Callable[[str], None]) -> None:
        self._ledger, self._say = Ledger(path, say), say
        self._lock = threading.Lock()
        self._state: tuple[int, int] | None = None
        self._data: dict[str, Any] = {}
        self._took, self._ready = 0.0, 0.0

    def page(self) -> str:
        """Return the page as it is now."""
        from posefit.report.content import data_of
        from posefit.report.page.webpage import document
        from posefit.report.runs import runs_so_far

        with self._lock:
            progress = progress_so_far(self._ledger)
            state = len(self._ledger), len(self._ledger.sentenced())
            if state != self._state and monotonic() >= self._ready:
                began = monotonic()
                self._data = data_of(self._ledger, runs_so_far(self._ledger), self._say)
                self._state, self._took = state, monotonic() - began
                self._ready = monotonic() + REST * self._took
            rows = len(self._data["rows"]["key"])
            live = {**asdict(progress), "rows": rows, "again": max(AGAIN, REST * self._took)}
            return document({**self._data, "live": live})


@contextmanager
def serving(path: str | Path, port: int, say: Callable[[str], None]) -> Iterator[ThreadingHTTPServer]:
    """Give a server that is ready for `serve_forever`; port 0 is any that is free.

    Raises ValueError where the folder is no ledger, or the port cannot be had.
    """
    if not 0 <= port <= LARGEST_PORT:
        raise ValueError(f"--port must be 0 to {LARGEST_PORT}, got {port}")
    showing = Showing(path, say)

    class Handler(_Handler):
        shown = showing

    try:
        server = ThreadingHTTPServer((LOOPBACK, port), Handler)
    except OSError as error:
        raise ValueError(f"--port must be one that is free, got {port}: {error.strerror or error}") from None
    with server:
        yield server


def address_of(server: ThreadingHTTPServer) -> str:
    """Return what a browser on this machine opens."""
    return f"http://{LOOPBACK}:{server.server_address[1]}/"


class _Handler(BaseHTTPRequestHandler):
    """Answers with the page, to who asks for this machine: a name that somebody else points here is refused."""

    shown: Showing

    def do_GET(self) -> None:
        """Answer a request."""
        port = self.server.server_address[1]  # type: ignore[index]
        if self.headers.get("Host") not in (f"{LOOPBACK}:{port}", f"localhost:{port}"):
            self._answer(403, "this server answers to its own machine alone", "text/plain")
        elif self.path.partition("?")[0] != "/":
            self._answer(404, "there is one page here: /", "text/plain")
        else:
            try:
                self._answer(200, self.shown.page(), "text/html")
            except (ValueError, OSError) as error:  # the ledger has gone away
                self._answer(500, str(error), "text/plain")

    def _answer(self, status: int, text: str, kind: str) -> None:
        content = text.encode()
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(content)))
        self.send_header("Cache-Control", "no-store")
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Say nothing of each request."""
