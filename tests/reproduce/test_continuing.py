"""A folder of a reproduction holds runs of one scale, of the same clips and of one build."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.motion.amc import write_amc
from posefit.motion.asf import write_asf
from posefit.motion.built_in import motion
from posefit_reproduce import experiment
from posefit_reproduce.commands import QUICK, paper_experiment
from posefit_reproduce.experiment import Experiment, Run, reproduce
from posefit_reproduce.sapso.experiment import Scale
from posefit_reproduce.sapso.motions import CLIPS
from tests.cases import each

pytest.importorskip("matplotlib")
FIRST = Run("track", "walk", "a")
SECOND = Run("track", "walk", "b")


def perform(run: Run) -> dict[str, Any]:
    return {"poses": np.zeros((2, 66))}


def continued(out: Path, *runs: Run, **shared: Any) -> None:
    reproduce(
        Experiment(runs, perform, lambda _: [], lambda _: [], shared), out, 1, None
    )


@each(
    ("shared", "message"),
    [
        (
            {"frames": 100, "clips": "library"},
            "frames must be 15, as before, to resume, got 100",
        ),
        (
            {"frames": 15, "clips": "mine"},
            "clips must be 'library', as before, to resume, got 'mine'",
        ),
    ],
)
def test_runs_of_another_scale_or_other_clips_are_refused(
    tmp_path: Path, shared: dict[str, Any], message: str
) -> None:
    out = tmp_path / "out"
    continued(out, FIRST, frames=15, clips="library")
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    for runs in ((FIRST,), (FIRST, SECOND)):
        with pytest.raises(ValueError, match=message):
            continued(out, *runs, **shared)
    assert {
        path: path.read_bytes() for path in out.rglob("*") if path.is_file()
    } == before
    continued(out, FIRST, SECOND, frames=15, clips="library")
    assert len(list((out / "runs").iterdir())) == 2


def test_another_build_reads_runs_and_adds_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    continued(tmp_path / "out", FIRST)
    monkeypatch.setattr(experiment, "posefit_build", lambda: "posefit 0.1.0 00000000")
    continued(tmp_path / "out", FIRST)
    with pytest.raises(
        ValueError,
        match="build must be 'posefit .*', as before, to resume, got 'posefit 0.1.0 0000",
    ):
        continued(tmp_path / "out", FIRST, SECOND)


def test_a_folder_without_a_record_is_read_with_a_warning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    continued(tmp_path / "out", FIRST, frames=100)
    (tmp_path / "out" / "runs.json").unlink()
    assert capsys.readouterr().err == ""
    continued(tmp_path / "out", FIRST, frames=100)
    assert "runs.json is missing" in capsys.readouterr().err
    for content in ("[]", "{", '{"frames": 1}'):
        (tmp_path / "out" / "runs.json").write_text(content)
        with pytest.raises(
            ValueError, match=r"runs\.json: not a record of the conditions of runs"
        ):
            continued(tmp_path / "out", FIRST, frames=100)


def test_a_quick_experiment_is_another_one_and_more_seeds_are_not() -> None:
    whole, more, quick = (
        paper_experiment(None, scale).shared
        for scale in (Scale(), Scale(20), Scale(**QUICK))
    )
    assert whole == more
    assert whole["frames"] == 100
    assert quick["frames"] == 15


def test_clips_equal_their_files(tmp_path: Path) -> None:
    def shared(folder: Path) -> Any:
        return paper_experiment(str(folder), Scale(**QUICK)).shared["clips"]

    walk, (one, other) = (
        motion("walk", frames=300, fps=120.0),
        (tmp_path / "a", tmp_path / "b"),
    )
    for clip in {
        clip for test, training in CLIPS.values() for clip in (test, *training)
    }:
        (one / clip).parent.mkdir(parents=True, exist_ok=True)
        write_asf(
            (one / clip).with_name(f"{clip.partition('/')[0]}.asf"), walk.skeleton
        )
        write_amc(one / f"{clip}.amc", walk)
    shutil.copytree(one, other, copy_function=shutil.copyfile)  # at another time
    assert shared(one) == shared(other)
    with (other / "16" / "16_15.amc").open("a") as file:
        file.write("\n")
    assert shared(one) != shared(other)
