"""A folder to resume gives the frames before the first damaged line, and names that line."""

from contextlib import suppress
from pathlib import Path

from posefit.tracking.outputs import OutputFolder
from tests.cases import each
from tests.fuzz.written import SPEC, mended, written


@each(
    ("old", "new", "right", "reason"),
    [
        (b"40", b"4\xff", False, "a damaged one"),
        (b'"lost": 0.5', b'"lost": 2', True, "lost of a frame must lie in 0 to 1, got 2"),
        (b'"bit_generator": "PCG64"', b'"bit_generator": "none"', True, "state must be for a PCG64"),
        (b'"evaluations"', b'"evaluation"', True, "unexpected keyword argument 'evaluation'"),
    ],
)
def test_frames_before_the_first_damaged_one_are_kept(
    old: bytes, new: bytes, right: bool, reason: str, tmp_path: Path
) -> None:
    lines = written(tmp_path)["frames"].splitlines(keepends=True)
    assert old in lines[1]
    lines[1] = lines[1].replace(old, new, 1)
    (unfinished,) = (tmp_path / "made").iterdir()
    (unfinished / "frames.jsonl").write_bytes(mended(b"".join(lines)) if right else b"".join(lines))
    messages: list[str] = []
    folder = OutputFolder(tmp_path / "made" / "subject", False, True, SPEC, messages.append)
    with suppress(KeyboardInterrupt), folder as output:
        assert len(output.earlier()[0]) == 1
        raise KeyboardInterrupt
    assert "frames.jsonl line 2: expected a frame, got" in messages[0]
    assert reason in messages[0]
