"""The frames of a track as they come, a line each with its checksum: what a track that ended too early goes on from."""

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
    """Add a frame to a file, and the state of the random generator after it."""
    posterior = None if frame.posterior is None else frame.posterior.as_dict()
    text = json.dumps(
        {**vars(frame), "posterior": posterior, "state": state}, default=_encoded
    ).encode()
    with path.open("ab") as file:
        file.write(b"%08x %s\n" % (zlib.crc32(text), text))


def write_carried(path: Path, number: int, state: Mapping[str, Any]) -> None:
    """Write what a filter carries from a frame, by its number: see `posefit.fitting.carried`."""
    arrays: list[Array] = []

    def apart(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            arrays.append(value)
            return {ARRAY: len(arrays) - 1}
        return value.item()  # a number of NumPy

    text = json.dumps({"number": number, "state": state}, default=apart)
    named = {f"array_{k}": array for k, array in enumerate(arrays)}
    with path.open("wb") as file:
        np.savez(file, text=np.array(text), **named)  # type: ignore[arg-type]


def read_carried(path: Path) -> tuple[int, dict[str, Any]] | None:
    """Return what a filter carried from a frame, and its number; None where a file holds no such thing."""
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
    except Exception:  # whatever a damaged file raises
        return None


def read_frames(path: Path) -> tuple[list[Frame], dict[str, Any] | None, str]:
    """Return the frames that a file records, the random generator's state after them, and where the file is damaged.

    From there on it is cut off; a line that was being written when the track ended is no damage.
    """
    frames = list[Frame]()
    whole_lines = list[bytes]()
    state = None
    damage = ""
    recorded = path.read_bytes() if path.is_file() and not path.is_symlink() else b""
    for number, line in enumerate(recorded.splitlines(keepends=True), 1):
        try:
            frame, state = _frame_of(line)
        except Exception as error:  # whatever a damaged line raises
            if line.endswith(b"\n"):
                damage = f"{path} line {number}: expected a frame, got {cut(' '.join(str(error).split()))}"
            break
        frames.append(frame)
        whole_lines.append(line)
    if (whole := b"".join(whole_lines)) != recorded:
        path.write_bytes(whole)
    return frames, state, damage


def _encoded(value: Any) -> Any:
    """Return what JSON holds of a frame's values: arrays with their type, else what it prints as."""
    if isinstance(value, np.ndarray | np.generic):
        return {"dtype": str(value.dtype), "values": value.tolist()}
    return dict(value) if isinstance(value, Mapping) else str(value)


def _decoded(mapping: dict[str, Any]) -> Any:
    if mapping.keys() == {"dtype", "values"}:
        return np.array(mapping["values"], dtype=mapping["dtype"])
    return mapping


def _frame_of(line: bytes) -> tuple[Frame, dict[str, Any]]:
    """Return a recorded frame, and the state of the random generator after it. Raises an error where it is damaged."""
    checksum, _, text = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or checksum != b"%08x" % zlib.crc32(text):
        raise InputError("a damaged one")
    row = json.loads(text, object_hook=_decoded)
    state = row.pop("state")
    posterior = row.pop("posterior")
    np.random.default_rng(0).bit_generator.state = state  # raises where it is none
    return Frame(
        **row, posterior=None if posterior is None else Posterior.from_dict(posterior)
    ), state
