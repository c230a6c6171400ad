"""The report of a running sweep: its progress, failures and results so far, served to this machine alone."""

import io
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from email.message import Message
from http.client import HTTPConnection
from http.server import ThreadingHTTPServer
from pathlib import Path

import pytest

from posefit.report.live import LOOPBACK, Handler, LivePage, Progress, address_of, progress_of, serving
from posefit.sweep.driver import Driver, Lease
from posefit.sweep.ledger import PLANS, Ledger
from tests.commands import error_of, run
from tests.report.browser import browser, data_in, ledger, opened, result
from tests.sweep.fake import cells

PLAN = [replace(cell, frames=4) for cell in cells(6)]


@pytest.fixture
def begun(tmp_path: Path) -> Path:
    """Return a ledger in which three of six cells were run, of which one was there before, and one failed for good."""
    path = ledger(tmp_path / "results", [result(PLAN[0], 1.0)])
    with Driver(path) as driver:
        driver.ledger.begin(cell.key for cell in PLAN)
    return ledger(path, [result(cell, 2.0) for cell in PLAN[1:3]], [(PLAN[3], ["ValueError: it had to"])])


@contextmanager
def served(path: str | Path) -> Iterator[ThreadingHTTPServer]:
    with serving(path, 0, lambda _: None) as server:
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def page_of(folder: str | Path, path: str = "/", **headers: str) -> tuple[int, str]:
    """Return the status and the text of a server's page."""
    with (
        served(folder) as server,
        closing(HTTPConnection(LOOPBACK, server.server_address[1], timeout=60)) as connection,
    ):
        connection.request("GET", path, headers=headers)
        response = connection.getresponse()
        return response.status, response.read().decode()


def test_progress_is_of_the_plan_that_was_begun_last(begun: Path) -> None:
    (plan,) = Ledger(begun).plans()
    assert (plan.cells, plan.settled) == (6, 1)
    idle = progress_of(Ledger(begun), now=plan.begun + 30.0)
    assert idle == Progress(6, 3, 1, 2, 0, 0, None)  # no driver works on it
    with Driver(begun) as driver:
        assert isinstance(driver.lease(PLAN[4]), Lease)
        # three cells were settled in half a minute, so the two that are left take twenty seconds
        assert progress_of(Ledger(begun), now=plan.begun + 30.0) == Progress(6, 3, 1, 2, 1, 0, 20.0)


def test_attempts_that_failed_are_counted_until_their_cell_is_settled(begun: Path) -> None:
    with Driver(begun) as driver:
        for _ in range(2):
            lease = driver.lease(PLAN[4])
            assert isinstance(lease, Lease)
            driver.fail(lease, "ValueError: it had to")
        assert progress_of(Ledger(begun)).failed == 2
        again = driver.lease(PLAN[4])
        assert isinstance(again, Lease)
        driver.finish(again, result(PLAN[4], 1.0))
        assert progress_of(Ledger(begun)).failed == 0


def test_a_continued_plan_is_one_plan_and_a_later_one_comes_first(begun: Path) -> None:
    with Driver(begun) as driver:
        driver.ledger.begin(cell.key for cell in PLAN)
        assert [(plan.cells, plan.settled) for plan in driver.ledger.plans()] == [(6, 4)]
        driver.ledger.begin(cell.key for cell in PLAN[4:])
    assert [plan.cells for plan in Ledger(begun).plans()] == [2, 6]
    assert progress_of(Ledger(begun)) == Progress(2, 0, 0, 2, 0, 0, None)


def test_a_damaged_plan_is_none(begun: Path) -> None:
    (path,) = (begun / PLANS).iterdir()
    path.write_bytes(path.read_bytes()[:-3])
    (begun / PLANS / "bad.cells").write_bytes(b"[" * 200_000)  # nested too deeply to be read
    assert progress_of(Ledger(begun)) == Progress(None, 3, 1, None, 0, 0, None)
    with Driver(begun) as driver:
        driver.ledger.begin(cell.key for cell in PLAN)
        assert len(driver.ledger.plans()) == 1


def test_the_page_is_the_report_with_the_progress_and_reasons(begun: Path) -> None:
    status, text = page_of(begun)
    data = data_in(text)
    assert status == 200
    assert data["live"] == {"cells": 6, "done": 3, "quarantined": 1, "left": 2, "running": 0, "failed": 0, "seconds": None,
                            "reload": data["live"]["reload"]}  # fmt: skip
    assert data["live"]["reload"] >= 5.0
    assert data["failures"][0]["reasons"] == ["ValueError: it had to"]


def test_requests_of_this_machine_get_one_page_even_before_the_first_cell_is_done(tmp_path: Path) -> None:
    path = ledger(tmp_path / "results", [])
    assert data_in(page_of(path)[1])["rows"]["key"] == []
    for host in ("evil.example", "localhost.evil.example", "localhost:80@evil.example", ""):
        assert page_of(path, Host=host)[0] == 403, host
    for host in ("localhost", "LocalHost:1", "127.0.0.1"):
        assert page_of(path, Host=host)[0] == 200, host
    assert [page_of(path, path=name)[0] for name in ("/../etc/passwd", "/?x")] == [404, 200]


def test_early_requests_get_the_last_page_or_the_last_failure(begun: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    now, made = [100.0], []

    def takes_two_seconds(self: LivePage, began: float) -> str:
        made.append(began)
        now[0] += 2.0
        if len(made) == 2:
            raise OSError("the disk has gone")
        return f"page {len(made)}"

    monkeypatch.setattr("posefit.report.live.monotonic", lambda: now[0])
    monkeypatch.setattr(LivePage, "_make", takes_two_seconds)
    showing = LivePage(begun, lambda _: None)
    assert [showing.page(), showing.page()] == ["page 1", "page 1"]
    now[0] = 108.0  # of eight seconds two were work
    for _ in range(2):
        with pytest.raises(ValueError, match="the disk has gone"):
            showing.page()
    assert made == [100.0, 108.0]
    now[0] = 116.0
    assert showing.page() == "page 3"


def test_a_closed_connection_is_no_error(capsys: pytest.CaptureFixture[str], begun: Path) -> None:
    class Gone(Handler):
        def __init__(self) -> None:
            self.path, self.request_version, self.requestline, self.command = "/", "HTTP/1.1", "GET / HTTP/1.1", "GET"
            self.headers = Message()
            self.headers["Host"] = "localhost"
            self.live, self.wfile = LivePage(begun, lambda _: None), Closed()

    class Closed(io.BytesIO):
        def write(self, _: object) -> int:
            written.append(1)
            raise BrokenPipeError

    written: list[int] = []
    Gone().do_GET()
    assert len(written) == 1  # no second answer, which would say 500
    assert capsys.readouterr().err == ""


def test_serving_waits_for_a_ledger_that_a_sweep_is_about_to_begin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def begin(seconds: float) -> None:
        ledger(tmp_path / "results", [])

    monkeypatch.setattr("posefit.report.live.sleep", begin)
    with serving(tmp_path / "results", 0, lambda _: None) as server:
        assert address_of(server).startswith("http://127.0.0.1:")


def test_a_taken_port_is_refused(begun: Path) -> None:
    with socket.create_server((LOOPBACK, 0)) as taken:
        port = taken.getsockname()[1]
        assert f"--port must be one that is free, got {port}: " in error_of("report", begun, "--serve", "--port", port)


def test_ctrl_c_ends_it_with_status_0_after_one_line_with_the_address(begun: Path) -> None:
    before = sorted(begun.rglob("*"))
    words = [sys.executable, "-c", "from posefit.cli import main; main()", "report", str(begun), "--serve"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        line = process.stdout.readline()
        assert re.fullmatch(rf"showing {re.escape(str(begun))} at http://127\.0\.0\.1:\d+/ until Ctrl-C\n", line)
        time.sleep(0.3)
        os.kill(process.pid, signal.SIGINT)
        assert process.wait(60) == 0
        assert process.stdout.read() == process.stderr.read() == ""
    assert sorted(begun.rglob("*")) == before


def test_ctrl_c_ends_it_with_status_0_before_it_answers_too(begun: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("posefit.report.live.serving", interrupted)
    assert run("report", begun, "--serve").exit_code == 0


@pytest.mark.slow
def test_a_browser_shows_the_progress_and_loads_the_page_again(begun: Path) -> None:
    with browser() as chromium, served(begun) as server, Driver(begun) as driver:
        driver.lease(PLAN[4])
        with opened(chromium, address_of(server), offline=False) as watched:
            text = watched.page.locator("#live-text").inner_text()
            assert text.startswith("4 of 6 cells: 3 done, 1 quarantined; 1 running, about ")
            assert "ValueError: it had to" in watched.page.inner_text("#trouble")
            lease = driver.lease(PLAN[5])
            assert isinstance(lease, Lease)
            driver.finish(lease, result(PLAN[5], 3.0))
            watched.page.get_by_text("5 of 6 cells").wait_for(timeout=60_000)
            watched.page.locator("#live-stop").check()
            assert watched.complaints == []
