"""What posefit itself wrote and reads back: rows of ledgers and whole ones, and folders to resume."""

import json
import os
import re
import shutil
import sqlite3
import zlib
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

import numpy as np

from posefit.fitting.tracker import Frame
from posefit.output.folder import OutputFolder
from posefit.output.identity import digest_of
from posefit.sweep.schema import FILE
from posefit.sweep.writer import NAMES, Writer
from posefit.uncertainty.modes import Posterior
from tests.report.browser import result
from tests.report.searched import cell as search_cell
from tests.report.searched import search_result
from tests.sweep.fake import cells

_FRAME = re.compile(rb"[0-9a-f]{8} (.*)")
SPEC = {"seed": digest_of(1), "method": digest_of("sapso@pca")}
NAME = "subject"


def written(folder: Path) -> dict[str, bytes]:
    """Return a valid content for each of `readers`, which need what is left in `folder`."""
    made = [result(cells(1)[0], 1.0), search_result(search_cell("sapso"), 9)]
    figures = [
        {name: value for name, value in row.items() if name not in NAMES}
        for row in made
    ]
    with Writer(folder / "seed" / FILE) as ledger:
        ledger.plan(cells(2))
        ledger.finish(cells(1)[0].key, result(cells(1)[0], 1.0))
    frame = Frame(
        np.zeros(66), np.zeros(3), 1.0, np.ones((2, 3)), 40, np.array([[20, 2.0], [40, 1.0]]),
        Posterior(np.zeros((2, 66)), np.zeros((2, 3)), np.ones(2)), 0.5, "walk", {"a": np.ones(2), "b": "text"}, 0.1,
    )  # fmt: skip
    with (
        suppress(_ReadError),
        OutputFolder(
            folder / "made" / NAME, False, False, SPEC, lambda _: None
        ) as output,
    ):
        for seed in range(3):
            output.record(frame, dict(np.random.default_rng(seed).bit_generator.state))
        raise _ReadError
    (unfinished,) = (folder / "made").iterdir()
    content, mark = (
        (unfinished / name).read_bytes() for name in ("frames.jsonl", "unfinished.json")
    )
    return {
        "rows": lines(made[0]["spec"], figures[0]), "searches": lines(made[1]["spec"], figures[1]),
        "quarantine": lines(made[0]["spec"], ["it had to"]), "ledger": (folder / "seed" / FILE).read_bytes(),
        "frames": content, "mark": mark,
    }  # fmt: skip


def lines(*values: object) -> bytes:
    """Return values as JSON, one a line."""
    return "\n".join(map(json.dumps, values)).encode()


def mended(content: bytes) -> bytes:
    """Return content whose lines have right checksums, where they are recorded frames."""
    return _FRAME.sub(
        lambda match: b"%08x %s" % (zlib.crc32(match[1]), match[1]), content
    )


def readers() -> dict[str, Callable[[Path], object]]:
    """Return what reads each kind of content; all messages must be clean."""

    from posefit.report.write import write_report
    from posefit.sweep.ledger import Ledger

    def reported(file: Path) -> object:
        out = file.parent / NAME
        summary = write_report(str(file), f"{out}.html", csv=f"{out}.csv")
        with Ledger(file) as ledger:
            ledger.frame()
        return summary.lines

    def whole(path: Path) -> object:
        file = path.with_name(f"{NAME}.sqlite")
        os.replace(path, file)
        return reported(file)

    def in_ledger(kind: str, status: str) -> Callable[[Path], object]:
        def read(path: Path) -> object:
            """Write the texts of a spec and of a row, or of the reasons of a quarantined cell, into a ledger."""
            spec, _, row = path.read_bytes().decode(errors="replace").partition("\n")
            file = path.parent / f"{NAME}-ledger" / FILE
            with Writer(file):
                pass
            with closing(sqlite3.connect(file)) as database, database:
                cell = (
                    "a" * 64,
                    kind,
                    spec,
                    status,
                    row if status != "done" else "[]",
                    row,
                )
                database.execute(
                    "INSERT INTO cells (key, kind, spec, status, faults, row) VALUES (?,?,?,?,?,?)",
                    cell,
                )
            return reported(file)

        return read

    def resumed(name: str) -> Callable[[Path], object]:
        def read(path: Path) -> object:
            room = path.parent / f"{NAME}-room"
            folder = room / f".{NAME}.0123456789abcdef"
            shutil.copytree(next((path.parent / "made").iterdir()), folder)
            os.replace(path, folder / name)
            frames: list[Frame] = []
            with (
                suppress(_ReadError),
                OutputFolder(room / NAME, False, True, SPEC, checked_message) as output,
            ):
                frames, _ = output.earlier()
                raise _ReadError
            return frames

        return read

    return {
        "rows": in_ledger("track", "done"),
        "searches": in_ledger("search", "done"),
        "quarantine": in_ledger("track", "quarantined"),
        "ledger": whole,
        "frames": resumed("frames.jsonl"),
        "mark": resumed("unfinished.json"),
    }


class _ReadError(Exception):
    """Ends a track that was only read."""


def checked_message(message: str) -> None:
    """Raise an error where a message is not one line, is too long or names no file."""
    if message.endswith("the same command with --resume continues from there"):
        return
    if NAME not in message or "\n" in message.strip() or len(message) > 400:
        raise RuntimeError(f"a message of {len(message)} characters: {message}")
