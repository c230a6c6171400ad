"""What posefit itself wrote and reads back: rows, quarantine, leases and plans of ledgers, and folders to resume."""

import json
import os
import re
import shutil
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np

from posefit.fitting.tracker import Frame
from posefit.sweep.log import encoded
from posefit.tracking.identity import digest_of
from posefit.tracking.outputs import OutputFolder
from posefit.uncertainty.modes import Posterior
from tests.report.browser import result
from tests.report.searched import cell as search_cell
from tests.report.searched import search_result
from tests.sweep.fake import cells

_ROW = re.compile(rb'\{"key": "([0-9a-f]{64})", "crc": "[0-9a-f]{8}", "row": (\{.*\})\}')
_FRAME = re.compile(rb"[0-9a-f]{8} (.*)")
SPEC = {"seed": digest_of(1), "method": digest_of("sapso@pca")}
NAME = "subject"


def written(folder: Path) -> dict[str, bytes]:
    """Return a valid content for each of `readers`, which need what is left in `folder`."""
    tracks = [result(cell, 1.0 + k).row for k, cell in enumerate(cells(3))]
    searches = [search_result(search_cell("sapso", 1, 9, 10_000 + k), 9 + k).row for k in range(3)]
    logs = [b"".join(encoded(row["key"], {**row, "joints": [0, 0, 0]}) for row in rows) for rows in (tracks, searches)]
    lost = {**{name: tracks[0][name] for name in ("key", "spec")}, "status": "quarantined", "reasons": ["it had to"]}
    lease = {"driver": "20260101T000000-00000000", "process": 1, "host": "h", "rows": 0, "failed": "so", "own": True}
    frame = Frame(
        np.zeros(66), np.zeros(3), 1.0, np.ones((2, 3)), 40, 0.1, np.ones(2), np.ones(9), np.array([20, 40]),
        {"a": np.ones(2), "b": "text"}, 0.1, Posterior(np.zeros((2, 66)), np.zeros((2, 3)), np.ones(2)), (), 0.5, "walk",
    )  # fmt: skip
    with suppress(_ReadError), OutputFolder(folder / "made" / NAME, False, False, SPEC, lambda _: None) as output:
        for seed in range(3):
            output.record(frame, dict(np.random.default_rng(seed).bit_generator.state))
        raise _ReadError
    (unfinished,) = (folder / "made").iterdir()
    content, mark = ((unfinished / name).read_bytes() for name in ("frames.jsonl", "unfinished.json"))
    return {
        "rows": logs[0], "searches": logs[1], "quarantine": json.dumps(lost).encode(), "lease": json.dumps(lease).encode(),
        "frames": content, "mark": mark,
    }  # fmt: skip


def mended(content: bytes) -> bytes:
    """Return content whose lines have right checksums, where they are rows or recorded frames."""

    def row(match: re.Match[bytes]) -> bytes:
        crc = zlib.crc32(match[1] + match[2])
        return b'{"key": "%s", "crc": "%08x", "row": %s}' % (match[1], crc, match[2])

    content = _ROW.sub(row, content)
    return _FRAME.sub(lambda match: b"%08x %s" % (zlib.crc32(match[1]), match[1]), content)


def readers() -> dict[str, Callable[[Path], object]]:
    """Return what reads each kind of content; all messages must be clean."""
    from posefit.report.write import leaderboard_lines, write_report
    from posefit.sweep.driver import Driver
    from posefit.sweep.ledger import Ledger, create

    def in_ledger(place: str) -> Callable[[Path], object]:
        def read(path: Path) -> object:
            folder = path.parent / f"{NAME}-ledger"
            create(folder)
            os.replace(path, folder / place)
            say = checked_message
            summary = write_report(folder, f"{folder}.html", warn=say, csv=f"{folder}.csv")
            Ledger(folder, say).frame()
            return leaderboard_lines(summary)

        return read

    def in_sweep(place: str) -> Callable[[Path], object]:
        def read(path: Path) -> object:
            folder = path.parent / f"{NAME}-ledger"
            create(folder)
            cell = cells(1)[0]
            os.replace(path, folder / place.format(cell.key))
            with Driver(folder, checked_message) as driver:
                driver.ledger.quarantined()
                return driver.lease(cell)

        return read

    def resumed(name: str) -> Callable[[Path], object]:
        def read(path: Path) -> object:
            room = path.parent / f"{NAME}-room"
            folder = room / f".{NAME}.0123456789abcdef"
            shutil.copytree(next((path.parent / "made").iterdir()), folder)
            os.replace(path, folder / name)
            frames: list[Frame] = []
            with suppress(_ReadError), OutputFolder(room / NAME, False, True, SPEC, checked_message) as output:
                frames, _ = output.earlier()
                raise _ReadError
            return frames

        return read

    return {
        "rows": in_ledger("rows/a.jsonl"),
        "searches": in_ledger("rows/a.jsonl"),
        "quarantine": in_ledger(f"quarantine/{cells(1)[0].key}.json"),
        "lease": in_sweep("leases/{}.1"),
        "frames": resumed("frames.jsonl"),
        "mark": resumed("unfinished.json"),
    }


class _ReadError(Exception):
    """Ends a track that was only read."""


def checked_message(message: str) -> None:
    """Raise an error where a message is not one line, is too long or names no file."""
    if message.endswith("the same command with --resume goes on from there"):
        return
    if NAME not in message or "\n" in message.strip() or len(message) > 400:
        raise RuntimeError(f"a message of {len(message)} characters: {message}")
