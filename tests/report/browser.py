"""A headless Chromium for tests of pages, and ledgers to show in it."""

import json
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from posefit.sweep.cell import TrackCell, cell_from
from posefit.sweep.schema import FILE
from posefit.sweep.writer import Writer
from tests.commands import run

# what no page may take for markup
EVIL = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\u2028'\"&"
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


@dataclass
class Watched:
    """A page, and what it should not have done."""

    page: Any
    # errors and messages on the console
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


@contextmanager
def browser() -> Iterator[Any]:
    """Give a browser; the test is skipped where there is none. POSEFIT_BROWSER names one that is elsewhere."""
    library = pytest.importorskip(
        "playwright.sync_api",
        reason="pages need playwright: pip install posefit[browser]",
    )
    program = os.environ.get("POSEFIT_BROWSER") or next(
        filter(None, map(shutil.which, NAMES)), None
    )
    if program is None:
        pytest.skip(f"pages need a browser: none of {', '.join(NAMES)} is installed")
    with library.sync_playwright() as driver:
        chromium = driver.chromium.launch(
            executable_path=program, args=["--no-sandbox"]
        )
        try:
            yield chromium
        finally:
            chromium.close()


@contextmanager
def opened(
    chromium: Any, path: Path | str, width: int = 1280, **how: Any
) -> Iterator[Watched]:
    """Give a file's page, or that of an address, in a window so many pixels wide; offline by default."""
    context = chromium.new_context(
        viewport={"width": width, "height": 900},
        **{"offline": True, "reduced_motion": "reduce", **how},
    )
    watched = Watched(context.new_page())
    watched.page.on("console", lambda message: watched.complaints.append(message.text))
    watched.page.on("pageerror", lambda error: watched.complaints.append(str(error)))
    watched.page.on("request", lambda request: watched.requests.append(request.url))
    try:
        watched.page.goto(path if isinstance(path, str) else path.as_uri())
        yield watched
    finally:
        context.close()


def result(cell: TrackCell, error: float, **more: Any) -> dict[str, Any]:
    """Return a row as large as a real one, with that error in degrees."""
    skill = dict.fromkeys(("mean_pose", "persistence", "nearest"), 1.0 - error / 4.0)
    return {
        "key": cell.key,
        "spec": cell.spec,
        "status": "done",
        "error_degrees": {"mean": error, "std": 0.0, "max": error},
        **dict.fromkeys(
            (
                "geodesic_degrees",
                "free_error_degrees",
                "mpjpe_mm",
                "pa_mpjpe_mm",
                "cost",
            ),
            error,
        ),
        **{
            "iou": 0.9,
            "swap_rate": 0.0,
            "lost_rate": 0.0,
            "held_frames": 0,
            "skill": skill,
            "warnings": [],
        },
        "baselines_degrees": dict.fromkeys(skill, 4.0),
        "prior_floor_degrees": 0.5,
        "seconds_per_frame": 0.01,
        "cpu_seconds_per_frame": 0.008,
        "seconds": 0.01 * cell.frames,
        "evaluations_used": cell.evaluations * cell.frames,
        "dimensions": 9,
        "joint_errors_mm": [error * joint for joint in range(27)],
        "trace": {
            "evaluations": [40, 80, 120],
            "cost": [4.0 * error, 2.0 * error, error],
        },
        "mode_reliability": [],
    } | more


def written(made: Path, *words: object) -> tuple[list[str], str]:
    """Return the lines that `posefit report` prints of a ledger, and the page that it writes beside it."""
    out = made.with_name("report.html")
    done = run("report", made, "--out", out, *words)
    assert done.exit_code == 0, done.stderr
    return done.stdout.splitlines(), out.read_text("utf-8")


def data_in(page: str) -> dict[str, Any]:
    """Return the data that a page holds."""
    data: dict[str, Any] = json.loads(
        page.partition('id="data">')[2].partition("</script>")[0]
    )
    return data


def sure(
    coverage: float, width: float, modes: list[list[float]], unknown: float = 0.0
) -> dict[str, Any]:
    """Return the uncertainty of a row: its 80 % intervals, and narrower and wider ones in step."""
    return {
        "coverage": {"50": coverage - 0.3, "80": coverage, "95": coverage + 0.15},
        "interval_mm": {"50": 0.5 * width, "80": width, "95": 2.0 * width},
        "unknown_rate": unknown,
        "mode_reliability": modes,
    }


def ledger(
    path: Path,
    rows: Iterable[dict[str, Any]],
    failures: Iterable[tuple[TrackCell, list[str]]] = (),
) -> Path:
    """Write a ledger of finished rows and of cells in quarantine with their reasons."""
    with Writer(path / FILE) as writer, writer.transaction():
        for row in rows:
            writer.add(cell_from(row["spec"]))
            writer.finish(row["key"], row)
        for cell, reasons in failures:
            writer.add(cell)
            lost = "UPDATE cells SET status = 'quarantined', faults = ? WHERE key = ?"
            writer._db.execute(lost, [json.dumps(reasons), cell.key])
    return path
