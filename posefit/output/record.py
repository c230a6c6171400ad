"""The record of a track's frames so far: one line per frame, with a checksum.

An interrupted track is resumed from it.
"""

import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.tracker import Frame
from posefit.reading import cut
from posefit.uncertainty.modes import Posterior

ARRAY = "number of an array"


def append_frame(path: Path, frame: Frame, state: Mapping[str, Any]) -> None:
    """Append a frame to a file, with the state of the random generator after it."""
    posterior = None if frame.posterior is None else frame.posterior.as_dict()
    text = json.dumps(
        {**vars(frame), "posterior": posterior, "state": state}, default=_encoded
    ).encode()
    with path.open("ab") as file:
        file.write(b"%08x %s\n" % (zlib.crc32(text), text))


def write_carried(path: Path, number: int, state: Mapping[str, Any]) -> None:
    """Write the state that a filter carries from a frame to the next.

    See `posefit.fitting.carried`.
    """
    arrays: list[Array] = []

    def apart(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            arrays.append(value)
            return {ARRAY: len(arrays) - 1}
        return value.item()  # a NumPy number

    text = json.dumps({"number": number, "state": state}, default=apart)
    named = {f"array_{k}": array for k, array in enumerate(arrays)}
    with path.open("wb") as file:
        np.savez(file, text=np.array(text), **named)  # type: ignore[arg-type]


def read_carried(path: Path) -> tuple[int, dict[str, Any]] | None:
    """Return a frame's number, and the state that a filter carried from it.

    Returns None if the file does not exist or is damaged.
    """
    if not path.is_file() or path.is_symlink():
        return None
    try:
        with np.load(path, allow_pickle=False) as file:

            def whole(mapping: dict[str, Any]) -> Any:
                if mapping.keys() == {ARRAY}:
                    return file[f"array_{int(mapping[ARRAY])}"]
                return mapping

            read = json.loads(str(file["text"]), object_hook=whole)
        return int(read["number"]), dict(read["state"])
    except Exception:  # a damaged file may raise anything
        return None


def read_frames(path: Path) -> tuple[list[Frame], dict[str, Any] | None, str]:
    """Read the frames of a record, and cut the record off where it is damaged.

    An incomplete last line, which was being written when the track ended, is accepted.

    Returns:
        The frames; the state of the random generator after them, or None if there are
        no frames; and where the file is damaged, or "" if it is not.
    """
    frames = list[Frame]()
    whole_lines = list[bytes]()
    state = None
    damage = ""
    recorded = path.read_bytes() if path.is_file() and not path.is_symlink() else b""
    for number, line in enumerate(recorded.splitlines(keepends=True), 1):
        try:
            frame, state = _frame_of(line)
        except Exception as error:  # a damaged line may raise anything
            if line.endswith(b"\n"):
                cause = cut(" ".join(str(error).split()))
                damage = f"{path} line {number}: expected a frame, got {cause}"
            break
        frames.append(frame)
        whole_lines.append(line)
    whole = b"".join(whole_lines)
    if whole != recorded:
        path.write_bytes(whole)
    return frames, state, damage


def _encoded(value: Any) -> Any:
    """Return a value as JSON can hold it: arrays with their type, others as text."""
    if isinstance(value, np.ndarray | np.generic):
        return {"dtype": str(value.dtype), "values": value.tolist()}
    return dict(value) if isinstance(value, Mapping) else str(value)


def _decoded(mapping: dict[str, Any]) -> Any:
    if mapping.keys() == {"dtype", "values"}:
        return np.array(mapping["values"], dtype=mapping["dtype"])
    return mapping


def _frame_of(line: bytes) -> tuple[Frame, dict[str, Any]]:
    """Return a recorded frame and the random state after it, or raise if damaged."""
    checksum, _, text = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or checksum != b"%08x" % zlib.crc32(text):
        raise InputError("a damaged one")
    row = json.loads(text, object_hook=_decoded)
    state = row.pop("state")
    posterior = row.pop("posterior")
    # raises an error if this is not the state of a generator
    np.random.default_rng(0).bit_generator.state = state
    if posterior is not None:
        posterior = Posterior.from_dict(posterior)
    return Frame(**row, posterior=posterior), state
