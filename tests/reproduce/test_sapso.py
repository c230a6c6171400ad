"""The repetition of the SAPSO paper's experiments: motions, baselines, and what `posefit reproduce sapso` writes."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from posefit.cli import main
from posefit.evaluation.measures import BASELINES
from posefit.fitting.synthesis import Prediction, Predictor
from posefit.geometry.rotation import wrapped
from posefit.testing.toy import Toy
from posefit.tracking.defaults import completed
from posefit.tracking.front import track
from posefit.tracking.initialise import task_of
from posefit.tracking.options import TrackOptions
from posefit.uncertainty.modes import nearer_mirrored
from posefit_priors.pca import PCA
from posefit_reproduce.experiment import Results, Run
from posefit_reproduce.sapso.experiment import (
    Scale,
    baseline,
    estimate_images,
    follow,
    options_of,
    perform,
)
from posefit_reproduce.sapso.figures import watched_swarm
from posefit_reproduce.sapso.methods import (
    LETTER,
    OURS,
    PARTS,
    ConstantInertia,
    UnclusteredPCA,
    WidePCA,
)
from posefit_reproduce.sapso.motions import (
    CLIPS,
    PaperMotion,
    paper_motions,
    paper_scene,
)
from posefit_reproduce.sapso.tables import Analysis, few_joints

# exemplars needs 715 poses
TINY = Scale(seeds=2, frames=3, views=(0.0, 45.0), around=(0.0, 45.0), iterations=17)
NUMBERED = (
    "3-latents",
    "4-clusters",
    "5-swarm",
    "6-convergence",
    "7-dimensions",
    "9-frames",
)
FIGURES = {f"figure-{name}.png" for name in NUMBERED}
TABLES = {"motions", "table-1", "table-2", "flaws", "claims", "views", "parts", "turn"}


def run(*words: object) -> Result:
    return CliRunner(env={"POSEFIT_CMU": ""}).invoke(
        main, ["reproduce", "sapso", *map(str, words)]
    )


def fails(*words: object) -> str:
    result = run(*words)
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    (line,) = result.stderr.splitlines()
    return line


@pytest.fixture(scope="module")
def walk() -> PaperMotion:
    return paper_motions(None, 3)["walk"]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Result]]:
    out = tmp_path_factory.mktemp("paper") / "out"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("posefit_reproduce.commands.QUICK", vars(TINY))
        yield out, run("--quick", "--out", out)


def test_mistakes_are_reported_in_one_line_and_write_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    clips = tmp_path / "clips"
    (clips / "16").mkdir(parents=True)
    (clips / "16" / "16_15.amc").write_text("")
    assert (
        fails("--seeds", 0, "--out", out) == "posefit: seeds must be at least 1, got 0"
    )
    for folder, missing in ((tmp_path / "nowhere", "16/16_15"), (clips, "16/16_17")):
        line = fails("--clips", folder, "--out", out)
        assert line.startswith(
            f"posefit: clips must be a folder of CMU clips such as {missing}.amc, got {folder}"
        )
    assert "choose a new folder, or one of an earlier reproduction" in fails(
        "--out", clips
    )
    assert "cannot write to this folder" in fails("--out", clips / "16" / "16_15.amc")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert "pip install posefit[figures]" in fails("--out", out)
    assert list(tmp_path.iterdir()) == [clips]


@pytest.mark.slow
def test_the_folder_holds_runs_tables_and_figures_and_the_command_continues(
    written: tuple[Path, Result],
) -> None:
    out, result = written
    assert result.exit_code == 0, result.output
    assert {path.name for path in out.iterdir()} == {
        *FIGURES,
        *(f"{name}.md" for name in TABLES),
        "runs",
        "runs.json",
    }
    for name in FIGURES:
        assert (out / name).read_bytes().startswith(b"\x89PNG")
    for name in TABLES:
        assert (out / f"{name}.md").read_text().strip() in result.stdout
    files = {path: path.stat().st_mtime_ns for path in (out / "runs").iterdir()}
    assert len(files) == len(list(TINY.runs))
    (gone := out / "runs" / "track-walk-sapso_pca-45-1.npz").unlink()
    before = (out / "parts.md").read_text()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("posefit_reproduce.commands.QUICK", vars(TINY))
        assert run("--quick", "--out", out).exit_code == 0
    assert {
        path for path, time in files.items() if path.stat().st_mtime_ns != time
    } == {gone}
    assert (out / "parts.md").read_text() == before


@pytest.mark.slow
def test_tables_show_the_papers_numbers_next_to_ours(
    written: tuple[Path, Result],
) -> None:
    out = written[0]
    rows = [line.split("|") for line in (out / "table-2.md").read_text().splitlines()]
    cells = {row[1].strip(): [cell.strip() for cell in row[2:-1]] for row in rows}
    # table 2: walk, run
    assert cells["PCA + SAPSO"][::2] == ["3.51 / 1.63 / 2.54", "3.88 / 1.38 / 2.37"]
    assert cells["PF"][0] == "4.67 / 2.52 / 5.24"
    assert cells["mean training pose"][0] == ""
    claims = (out / "claims.md").read_text()
    assert set(claims.split("**")[1::2]) <= {"holds", "fails", "not decided"}
    # LFemur of the walk: |-11.397 + 13.015|, ...: the mean of twelve differences is 2.26
    assert "below 2.26 / 2.62 / 1.35 degrees" in claims
    assert len((out / "parts.md").read_text().splitlines()) == 3 + 1 + len(PARTS) + 3


def shifted(motions: dict[str, PaperMotion], degrees: float, joint: slice) -> Results:
    poses = motions["walk"].test.poses.copy()
    poses[:, joint] += np.radians(degrees)
    return Results(
        {Run("track", "walk", OURS, 0.0, seed): {"poses": poses} for seed in range(2)}
    )


def test_errors_are_computed_from_poses() -> None:
    motions = paper_motions(None, 5)
    free = motions["walk"].test.skeleton.free
    analysis = Analysis(shifted(motions, 3.0, slice(0, 66)), motions)
    np.testing.assert_allclose(analysis.errors("walk"), [[3.0, 3.0]])
    np.testing.assert_allclose(analysis.errors("walk", free=True), 3.0)
    assert analysis.free("walk").sum() == free.sum() < 66
    assert few_joints(analysis, "walk")[0, 0] == pytest.approx(3.0 / 22.0)
    analysis = Analysis(shifted(motions, 3.0, slice(0, 3)), motions)
    np.testing.assert_allclose(analysis.errors("walk"), 3.0 * 3.0 / 66.0)
    assert few_joints(analysis, "walk")[0, 0] == pytest.approx(1.0)
    test = motions["walk"].test
    joints = replace(test, poses=test.poses + np.pi * np.eye(1, 66)).joints
    analysis = Analysis(shifted(motions, 180.0, slice(0, 1)), motions)
    assert analysis.swapped("walk")[0, 0] == nearer_mirrored(test.joints, joints).mean()


def test_a_part_that_is_left_out_is_left_out(walk: PaperMotion) -> None:
    plain, wide, loose = (
        prior().fit(walk.angles) for prior in (PCA, WidePCA, UnclusteredPCA)
    )
    np.testing.assert_allclose(wide.high - wide.low, 3.0 * (plain.high - plain.low))
    np.testing.assert_allclose(wide.high + wide.low, plain.high + plain.low)
    corners = np.stack([plain.low, plain.high])
    assert not plain.feasible(corners).all()
    assert loose.feasible(corners).all()


def test_a_constant_inertia_is_that_of_the_middle_of_a_search() -> None:
    search = ConstantInertia(
        Toy(2),
        np.random.default_rng(0),
        population_size=3,
        iterations=60,
        acceleration=0.0,
    )
    for _ in range(4):
        before = search.v.copy()
        search.tell(search.ask(), np.zeros(3))
        inside = np.abs(search.moved) < 1.0  # a wall stops what meets it
        # omega = A / e^(c ln(10 A) / C) with c = C / 2: 0.9 / sqrt(9)
        np.testing.assert_allclose(search.v[inside], 0.3 * before[inside])


def test_every_method_of_the_ablation_runs_at_the_same_cost() -> None:
    scale = replace(TINY, frames=2)
    for method in (*PARTS, LETTER):
        arrays = perform(None, scale, Run("track", "walk", method, 45.0, 0))
        assert arrays["poses"].shape == (2, 66)
        assert arrays["evaluations"] == 40 * (17 if method == LETTER else 18)


def test_no_motion_is_learned_from_that_is_followed() -> None:
    for motion in paper_motions(None, 2).values():
        assert motion.test.name not in [one.name for one in motion.training]
    for test, training in CLIPS.values():
        assert test not in training


def test_the_library_has_the_motions_of_the_clips(cmu: Path) -> None:
    own = paper_motions(None, 100)
    clips = paper_motions(cmu, 100)
    # 16_35 has 162 frames at 120 Hz, 81 at 60 Hz, the first of which is left out
    assert {name: len(motion.test) for name, motion in clips.items()} == {
        "walk": 100,
        "turn": 100,
        "run": 80,
    }
    for name, motion in clips.items():
        assert motion.test.fps == 60.0
        # the library's last frame may come one earlier
        frames = min(len(motion.test), len(own[name].test))
        assert frames >= len(motion.test) - 1
        away = wrapped(own[name].test.poses[:frames] - motion.test.poses[:frames])
        assert np.degrees(np.abs(away)).mean() < 1.0
        yaw = np.degrees(np.unwrap(motion.test.poses[:, 0]))
        assert abs(yaw[-1] - yaw[0]) > 80.0 if name == "turn" else np.ptp(yaw) < 30.0


def test_baselines_are_what_a_track_reports(walk: PaperMotion) -> None:
    quick = {
        "method": "sapso",
        "settings": {"sapso.population_size": 5},
        "evaluations": 10,
    }
    degrees = track(paper_scene(walk, 45.0), train=walk.training, **quick).summary[
        "baselines_degrees"
    ]
    for name in BASELINES:
        away = np.degrees(
            np.abs(
                wrapped(baseline(walk, paper_scene(walk, 45.0), name) - walk.test.poses)
            )
        )
        assert away.mean() == pytest.approx(degrees[name])


def poses_of(frames: Any) -> Any:
    return np.array([frame.pose for frame in frames])


def test_a_run_is_a_track_of_the_same_seed(walk: PaperMotion) -> None:
    scene = paper_scene(walk, 45.0)
    frames = follow(
        scene, walk, Scale(iterations=4), Run("track", "walk", "pso@pca", 45.0, 3)
    )
    box = {"tracker.tilt": "box"}  # Interpretation S16
    again = track(
        scene,
        train=walk.training,
        method="pso@pca",
        evaluations=40 * 5,
        settings=box,
        seed=3,
    )
    np.testing.assert_array_equal(poses_of(frames), again.motion.poses)
    assert [frame.evaluations for frame in frames] == [40 * 5] * 3


# Interpretation S17
def test_a_single_image_is_estimated_by_itself_whatever_its_yaw(
    walk: PaperMotion,
) -> None:
    scene = paper_scene(walk, 45.0)
    images = dict(enumerate(scene.observations))
    frames = estimate_images(scene, images, walk.training, OURS, 4, 3)
    # section 5.3: it is unknown
    for yaw in (scene.yaw, None, (scene.yaw or 0.0) + 2.0):
        (alone,) = estimate_images(
            replace(scene, yaw=yaw), {1: images[1]}, walk.training, OURS, 4, 3
        )
        np.testing.assert_array_equal(alone.pose, frames[1].pose)


# Interpretation S17
def test_the_first_yaw_is_searched_within_45_degrees_of_the_true_one(
    walk: PaperMotion,
) -> None:
    scene = paper_scene(walk, 45.0)
    assert scene.yaw == walk.test.poses[0, 0]
    options = completed(TrackOptions(**options_of(OURS, walk.training, 4)), scene.truth)
    space = Predictor(
        task_of(scene, options, walk.training),
        UnclusteredPCA().fit(walk.angles),
        Prediction(tilt="box"),
    )
    first = space.space(scene.observations[0])
    assert first.root_centre[0] == scene.yaw
    assert np.degrees(first.root_range[0]) == pytest.approx(45.0)


def test_the_swarm_of_figure_5_is_that_of_a_search(walk: PaperMotion) -> None:
    swarm = watched_swarm(walk, 30, 6)
    assert [poses.shape for poses in swarm.poses] == [(30, 66)] * 7
    # Interpretation S16
    settings = {"tracker.tilt": "box", "sapso.population_size": 30}
    scene = paper_scene(walk, 45.0, 1)
    again = track(
        scene,
        train=walk.training,
        evaluations=30 * 7,
        method="sapso",
        settings=settings,
    )
    evaluations, costs = again.frames[0].trace.T
    # a trace has a row where the cost fell, and a swarm's history one an iteration
    falls = np.searchsorted(evaluations, 30 * np.arange(1, 8), side="right") - 1
    np.testing.assert_array_equal(swarm.history, costs[falls])
    # the best pose of all iterations is the search's result
    best = [poses[k] for poses, k in zip(swarm.poses, swarm.best, strict=True)]
    assert any(np.array_equal(pose, again.motion.poses[0]) for pose in best)
