"""What a user types, and what comes back: results, files, and one line for every mistake."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

import posefit.cli
from posefit.cli import main
from posefit.cli.output import say
from posefit.errors import InputError
from posefit.motion import built_in, recorded
from posefit.motion.amc import read_clip, write_amc
from posefit.motion.asf import write_asf
from posefit_priors.pca import PCA
from tests.cases import each
from tests.commands import error_of, printed, run
from tests.files import arrays, csv_rows
from tests.geometry.turns import about
from tests.motion.rigs import STYLES, write_rig
from tests.plugins.test_registry import point, registering

QUICK = ["--evaluations", "50", "--size", "120x90"]
LITTLE = [
    "--method",
    "sapso",
    "--train",
    "walk-a",
    "--evaluations",
    "100",
    "--size",
    "120x90",
]
FILES = {
    "poses.npz", "track.amc", "track.bvh", "track.trc", "track.c3d", "track.glb", "track.mot", "model.osim",
    "angles.csv", "gait.csv", "skeleton.asf", "camera.json", "frames.csv", "summary.json", "overlay.mp4", "summary.png", "track.html",
}  # fmt: skip
TIMES = {"seconds_per_frame", "cpu_seconds_per_frame", "evaluations_per_second"}
KEYS = TIMES | {
    "motion", "method", "seed", "frames", "error_degrees", "mpjpe_mm", "pa_mpjpe_mm", "iou", "swap_rate", "lost_rate",
    "skill", "prior_floor_degrees", "evaluations",
}  # fmt: skip


@pytest.fixture
def clip(tmp_path: Path) -> tuple[Path, Path]:
    motion = built_in.motion("walk-b", frames=12, fps=120.0)
    write_asf(tmp_path / "one.asf", motion.skeleton)
    write_amc(tmp_path / "one.amc", motion)
    return tmp_path / "one.asf", tmp_path / "one.amc"


def test_the_command_is_the_typed_call_and_prints_one_json_object_with_every_key() -> (
    None
):
    summary = printed("track", "walk", "--frames", "0:3", "--seed", "7", *QUICK)
    called = posefit.track(
        "walk", frames=(0, 3), seed=7, evaluations=50, size=(120, 90)
    ).summary
    assert set(summary) >= KEYS
    assert {name: summary[name] for name in KEYS - TIMES} == {
        name: called[name] for name in KEYS - TIMES
    }
    assert set(summary["error_degrees"]) == {"mean", "std", "max"}
    assert set(summary["skill"]) == {"mean_pose", "persistence", "nearest"}
    assert (summary["frames"], summary["evaluations"]) == (3, 3 * 10 * 5)
    assert summary["version"] == posefit.__version__


def test_track_writes_a_folder_that_can_be_opened_again(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    result = run("track", "walk", "--frames", "0:5", "--out", out, "--verbose", *QUICK)
    assert result.exit_code == 0, result.stderr
    assert {path.name for path in out.iterdir()} == FILES
    assert [path.name for path in out.parent.iterdir()] == ["out"]
    assert "error deg" in result.stdout
    assert "mean training pose" in result.stdout
    stored = arrays(out / "poses.npz")
    assert stored["poses"].shape == (5, 66)
    again = read_clip(out / "skeleton.asf", out / "track.amc", fps=30.0)
    difference = (again.poses - stored["poses"] + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(difference, 0.0, atol=1e-8)
    np.testing.assert_allclose(again.translations, stored["translations"], atol=1e-9)
    errors = [float(row["error_degrees"]) for row in csv_rows(out / "frames.csv")]
    assert len(errors) == 5
    summary = json.loads((out / "summary.json").read_text())
    assert np.mean(errors) == pytest.approx(summary["error_degrees"]["mean"])
    video = cv2.VideoCapture(str(out / "overlay.mp4"))
    assert [video.read()[0] for _ in range(6)] == [True] * 5 + [False]
    assert cv2.imread(str(out / "summary.png")).shape[1] > 600
    assert posefit.Camera.from_json(out / "camera.json").width == 120
    for words, message in (
        (
            [out],
            "expected a source, got the folder of a track: give the video, masks or motion that it was made from",
        ),
        (
            ["walk", "--camera", out / "poses.npz"],
            "got arrays: a calibration is a text, as json.dump({name: array.tolist() for "
            "name, array in numpy.load(FILE).items()}, ...) writes it",
        ),
    ):
        assert error_of("track", *words).endswith(message)


def test_the_same_seed_gives_the_same_poses_with_any_number_of_threads() -> None:
    tracks = [
        posefit.track("walk", frames=(0, 4), evaluations=240, seed=3, threads=threads)
        for threads in (1, 2)
    ]
    np.testing.assert_array_equal(tracks[0].motion.poses, tracks[1].motion.poses)
    other = posefit.track("walk", frames=(0, 4), evaluations=240, seed=4)
    assert np.abs(other.motion.poses - tracks[0].motion.poses).max() > 0.0


def test_fit_finds_the_pose_of_one_frame(tmp_path: Path) -> None:
    summary = printed("fit", "walk", "--frame", "7", "--out", tmp_path / "fit", *QUICK)
    assert len(summary["pose_degrees"]) == 66
    assert summary["frames"] == 1
    fit = posefit.fit("walk", frame=7, evaluations=50, size=(120, 90))
    np.testing.assert_allclose(np.degrees(fit.pose), summary["pose_degrees"], atol=1e-5)
    assert fit.frame.trace.shape[1] == 2


def test_a_folder_does_not_hide_a_built_in_motion(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        assert (
            printed(
                "track", "walk", "--frames", "0:2", "--out", "walk", "--force", *QUICK
            )["translation"]
            == "known"
        )


def test_a_shell_completes_methods_and_motions() -> None:
    def completed(words: str, place: int) -> list[str]:
        asked = {
            "COMP_WORDS": words,
            "COMP_CWORD": str(place),
            "_POSEFIT_COMPLETE": "bash_complete",
        }
        return (
            CliRunner().invoke(main, [], prog_name="posefit", env=asked).stdout.split()
        )

    assert "plain,sapso" in completed("posefit track walk --method sap", 4)
    assert "plain,sapso@pca" in completed("posefit track walk --method sapso@p", 4)
    assert {"plain,walk", "file,wa"} <= set(completed("posefit track wa", 2))


def test_a_result_has_three_lines_and_messages_only_where_they_are_wanted() -> None:
    result = run("track", "walk", "--frames", "0:5", *QUICK)
    assert len(result.stdout.splitlines()) == 3
    assert all(
        f"{phase} " in result.stderr for phase in ("masks", "build", "track", "write")
    )
    assert run("track", "walk", "--frames", "0:5", "--quiet", *QUICK).stderr == ""


def test_a_bvh_of_another_program_is_tracked_and_its_frames_keep_their_numbers(
    tmp_path: Path,
) -> None:
    walk = recorded.clip("16_15").motion().frames(0, 12)
    out = tmp_path / "out"
    path = write_rig(
        tmp_path / "rig.bvh", walk, STYLES["mixamo"], 100.0, about(0, np.pi / 2)
    )
    words = ["--frames", "5:8", *LITTLE]
    assert run("track", path, "--out", out, *words).exit_code == 0
    summary = json.loads((out / "summary.json").read_text())
    unit, axis = summary["warnings"]
    assert unit.startswith(f"{path}: lengths are taken as centimetres")
    reason = "because the person stands along it"
    assert axis == f"{path}: z is taken to be up, {reason}; --up sets it"
    for name in ("frames.csv", "angles.csv"):
        rows = csv_rows(out / name)
        assert [int(float(row["frame"])) for row in rows] == [5, 6, 7]
        assert [float(row["seconds"]) for row in rows] == pytest.approx(
            [5 / 30, 6 / 30, 7 / 30], abs=1e-3
        )
    assert arrays(out / "poses.npz")["frames"].tolist() == [5, 6, 7]
    assert (
        (out / "track.trc").read_text().splitlines()[6].startswith(f"6\t{5 / 30:.6f}")
    )
    stated = printed("track", path, "--unit", "cm", "--up", "z", *words)
    assert stated["warnings"] == []
    assert stated["mpjpe_mm"] == pytest.approx(summary["mpjpe_mm"])


def test_an_amc_is_tracked_with_the_asf_in_its_folder_at_cmus_rate_or_a_given_one(
    clip: tuple[Path, Path],
) -> None:
    text = clip[1].read_text()
    clip[1].write_text(text[text.index(":FULLY") :])
    assumed = printed("track", clip[1], *LITTLE)
    given = printed("track", clip[1], "--rate", "60", *LITTLE)
    assert (assumed["frames"], given["frames"]) == (3, 6)
    assert "120 frames a second are assumed" in assumed["warnings"][0]
    assert given["warnings"] == []
    clip[0].unlink()
    assert "expected --asf or exactly one .asf file in its folder, got 0" in error_of(
        "track", clip[1]
    )


def test_an_existing_folder_is_kept_unless_forced(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run("track", "walk", "--frames", "0:2", "--out", out, *QUICK).exit_code == 0
    before = (out / "summary.json").read_text()
    assert "expected a new folder" in error_of(
        "track", "walk", "--frames", "0:3", "--out", out, *QUICK
    )
    assert (out / "summary.json").read_text() == before
    assert (
        run(
            "track", "walk", "--frames", "0:3", "--out", out, "--force", *QUICK
        ).exit_code
        == 0
    )
    assert json.loads((out / "summary.json").read_text())["frames"] == 3
    link = tmp_path / "link"
    link.symlink_to(out)
    force = ["track", "walk", "--frames", "0:2", "--force", *QUICK, "--out"]
    (tmp_path / "nowhere").symlink_to(tmp_path / "nothing")
    for path in (link, tmp_path / "nowhere"):
        assert f"{path.name}: expected a folder to write to, got a link" in error_of(
            *force, path
        )
    before = sorted(path.name for path in out.iterdir())
    (out / "precious.txt").write_text("mine")
    assert "got one with precious.txt, which posefit did not write" in error_of(
        *force, out
    )
    (out / "precious.txt").unlink()
    gait = (out / "gait.csv").rename(tmp_path / "gait.csv")
    (out / "gait.csv").mkdir()
    (out / "gait.csv" / "precious.txt").write_text("mine")
    assert "got one with gait.csv, which posefit did not write" in error_of(*force, out)
    assert (out / "gait.csv" / "precious.txt").read_text() == "mine"
    shutil.rmtree(out / "gait.csv")
    (out / "gait.csv").symlink_to(gait)
    assert "got one with gait.csv, which posefit did not write" in error_of(*force, out)
    assert (link.is_symlink(), sorted(path.name for path in out.iterdir())) == (
        True,
        before,
    )


def test_a_folder_of_somebodys_own_files_is_never_replaced(tmp_path: Path) -> None:
    for name, content in (
        ("summary.json", '{"version": "mine"}'),
        ("summary.json", "["),
        ("angles.csv", "mine"),
    ):
        own = tmp_path / name.partition(".")[0] / str(len(content))
        own.mkdir(parents=True)
        (own / name).write_text(content)
        message = error_of(
            "track", "walk", "--frames", "0:2", "--force", "--out", own, *QUICK
        )
        assert (
            f"expected a folder of earlier results to replace, got one with {name}"
            in message
        )
        assert [(path.name, path.read_text()) for path in own.iterdir()] == [
            (name, content)
        ]
    (tmp_path / "empty").mkdir()
    assert (
        run(
            "track",
            "walk",
            "--frames",
            "0:2",
            "--force",
            "--out",
            tmp_path / "empty",
            *QUICK,
        ).exit_code
        == 0
    )


def test_a_mistake_is_reported_in_one_line_and_status_2(tmp_path: Path) -> None:
    for words, message in [
        (["wlak"], "did you mean 'walk'?"),
        (
            ["16_999"],
            "motion must be a file, a folder, a recorded motion that posefit motions lists, or one of walk, ",
        ),
        (["library"], "a recorded motion that posefit motions lists, or one of walk, "),
        (["lost/"], "lost: no such file or folder"),
        (
            ["walk", "--train", "lost/"],
            "lost: no such file or folder",
        ),
        (
            ["walk", "--roi", "1,2,3,4"],
            "roi applies only to video, got (1, 2, 3, 4) for a motion",
        ),
        (
            ["walk", "--extraction", "median"],
            "extraction applies only to video, got 'median' for a motion",
        ),
        (
            ["lost.avi", "--size", "320x240"],
            "size applies only to motions, got (320, 240) for a video",
        ),
        (["lost.amc"], "lost.amc: no such file"),
        (["walk.txt"], "walk.txt: no such file"),
        (["walk", "--size", "320"], "expected WIDTHxHEIGHT"),
        (["walk", "--size", "0x9"], "size must be from 1x1"),
        (["walk", "--frames", "3"], "expected A:B"),
        (["walk", "--live", "-"], "SOURCE must be left out with --live, got walk"),
        (["--live", "-", "--force"], "--force must be left out with --live, got it"),
        (
            ["--live", "-", "--write", "bvh"],
            "--write must be left out with --live, got bvh",
        ),
        (
            ["--live", "-", "--without-subject", "02", "--without-subject", "16"],
            "--without-subject must be left out with --live, got 02, 16",
        ),
        (["walk", "--device", "tpu"], "device must be one of cpu, cuda, got 'tpu'"),
        (["walk", "--camera", "no.json"], "no.json"),
        (
            ["walk-a", "--train", "walk-a"],
            "train must not contain the source itself, got walk-a",
        ),
        (["walk", "--seed", "abc"], "expected a whole number such as 30, got 'abc'"),
        (["walk", "--fps", "30,0"], "expected a number such as 1.75, got '30,0'"),
        (["walk", "--wrong"], "No such option"),
        (["walk", "--seed", "-1"], "seed must be 0 or more, got -1"),
    ]:
        assert message in error_of("track", *words, "--out", tmp_path / "out")
        assert list(tmp_path.iterdir()) == []


def test_plugins_are_listed_with_their_origin_and_settings() -> None:
    rows = {row["name"]: row for row in json.loads(run("plugins", "--json").stdout)}
    sapso = rows["sapso"]
    origin = {
        "kind": "optimiser",
        "distribution": "posefit",
        "next_frame": "start",
        "version": posefit.__version__,
    }
    assert (
        origin.items()
        <= {name: value for name, value in sapso.items() if name != "settings"}.items()
    )
    assert {"name": "cooling", "type": "float", "default": 0.95} in sapso["settings"]
    assert {"name": "limits", "type": "asf | training", "default": "asf"} in rows[
        "full"
    ]["settings"]
    text = run("plugins").stdout
    assert "optimiser sapso (posefit" in text
    assert "cooling: float = 0.95" in " ".join(text.split())
    assert all(row["summary"] for row in rows.values())


def test_a_plugin_of_any_kind_is_shown_with_the_meaning_of_each_setting() -> None:
    for name, words in (
        (
            "sapso",
            "--set sapso.cooling: float = 0.95 (gamma) Factor on the temperature",
        ),
        ("full", "--set full.limits: asf | training = asf"),
        ("masks", "It has no settings."),
    ):
        assert words in " ".join(run("plugins", "show", name).stdout.split())
    message = error_of("plugins", "show", "sapzo")
    assert "plugin must be one of annealed, " in message
    assert message.endswith("got 'sapzo'; did you mean 'sapso'?")


def test_the_doctor_lists_working_and_broken_plugins(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from posefit import registry

    result = run("plugins", "doctor")
    assert result.exit_code == 0
    assert "offers optimiser sapso, optimiser pso, optimiser random" in result.stdout
    offers = "offers optimiser sapso-letter, command reproduce, command bench"
    assert re.search(
        rf"^loaded    reproduce \(posefit .*\): {offers}$", result.stdout, re.MULTILINE
    )
    cause = "ImportError: no module named 'lost'"
    trace = "Traceback ...\n  line 7, in bad"
    broken = registry.Plugin(
        "bad", "posefit-bad", "1.0", "broken", cause, traceback=trace
    )
    with pytest.warns(UserWarning, match="'worse' of posefit-worse 1.0 is left out"):
        worse = registry.load(
            [point("worse", ImportError("no module named 'lost',\n  nor 'here'"))],
            variables={},
        )
    installed = (*registry.registry().plugins, broken, *worse)
    monkeypatch.setattr(registry, "plugins_of", lambda *_: installed)
    result = run("plugins", "doctor")
    assert result.exit_code == 1
    assert f"broken    bad (posefit-bad 1.0): {cause}\n" in result.stdout
    assert (
        f"broken    worse (posefit-worse 1.0): {cause}, nor 'here'\n" in result.stdout
    )
    assert "line 7, in bad" not in result.stdout
    verbose = run("plugins", "doctor", "-v").stdout
    assert (
        "no module named 'lost'\n          Traceback ...\n            line 7, in bad\n"
        in verbose
    )


def test_the_doctor_names_plugins_that_register_nothing_and_the_next_step(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from posefit import registry

    def doctor(module: object) -> tuple[int, str]:
        installed = registry.load([point("mine", module)], variables={})
        monkeypatch.setattr(registry, "plugins_of", lambda *_: installed)
        result = run("plugins", "doctor")
        return result.exit_code, result.stdout

    # without the mark of a hook
    status, text = doctor(SimpleNamespace(posefit_register_optimisers=print))
    assert status == 1
    assert "empty     mine (posefit-mine 1.0): registers nothing: " in text
    assert text.endswith("all plugins are loaded, but not all offer something\n")
    status, text = doctor(registering(("spiral", PCA), ("snail", PCA)))
    assert status == 0
    assert (
        "    next: posefit check optimiser spiral\n          next: posefit check optimiser snail\n"
        in text
    )
    assert text.endswith("all plugins work\n")


def test_an_unknown_command_names_the_nearest_wherever_it_is() -> None:
    for words, name, path in (
        (["doctor"], "doctor", "posefit plugins doctor"),
        (["trak"], "trak", "posefit track"),
        (["plugins", "check"], "check", "posefit check"),
        (["plugins", "docter"], "docter", "posefit plugins doctor"),
        (["suite", "rn"], "rn", "posefit suite run"),
        (["optimizers"], "optimizers", "posefit plugins"),
        (["segmenter"], "segmenter", "posefit plugins"),
    ):
        assert (
            error_of(*words)
            == f"posefit: No such command {name!r}; did you mean {path!r}?"
        )
    assert error_of("zebra") == "posefit: No such command 'zebra'; see posefit --help"
    # near the name of a command of another group, which does something else
    assert (
        error_of("suite", "extrat")
        == "posefit: No such command 'extrat'; see posefit suite --help"
    )


def test_check_reports_every_rule_and_how_many_ran() -> None:
    result = run("check", "optimiser", "random")
    assert result.exit_code == 0, result.output
    assert re.search(r"\d+ checks ran, 0 failed, \d+ skipped", result.stdout)
    assert "it is the baseline itself" in result.stdout
    report = json.loads(
        run("check", "prior", "pca", "--set", "components=4", "--json").stdout
    )
    passed = {
        "check": "ranges",
        "outcome": "passed",
        "detail": "4 latents",
        "traceback": "",
    }
    assert passed in report["results"]
    for command, message in (
        ("check optimiser nothing", "optimiser must be one of .*"),
        ("check optimiser mixture", "got 'mixture'; its kind is segmenter"),
        ("check optimiser pca", "got 'pca'; its kind is prior"),
        ("check optimizer sapso", r"got 'optimizer'; did you mean 'optimiser'\?"),
        ("track walk --method mixture", "got 'mixture'; its kind is segmenter"),
        ("track walk --method pca", "got 'pca'; as a prior it is @pca"),
        ("check prior pca --set colour=red", "a setting of pca must be one of .*"),
        ("check prior pca --set colour", "a setting must be SETTING=VALUE.*"),
    ):
        assert re.search(f"{message}$", error_of(*command.split())), command


def installed(
    kind: str, name: str, folder: Path
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Write a new plugin and install it offline; return what runs Python modules in its folder, with it installed."""
    made = folder / "mine"
    site = folder / "site"
    result = run("plugins", "new", name, "--kind", kind, "--out", made)
    assert result.exit_code == 0, result.output
    module = name.replace("-", "_")
    files = {"pyproject.toml", "README.md", f"posefit_{module}.py", f"test_{module}.py"}
    assert {path.name for path in made.iterdir()} == files
    pip = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-index",
        "--no-deps",
        "--no-build-isolation",
    ]
    subprocess.run(
        [*pip, "--target", str(site), str(made)], check=True, capture_output=True
    )
    environment = {**os.environ, "PYTHONPATH": str(site)}

    def called(*words: str, **more: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", *words]
        return subprocess.run(
            command,
            cwd=made,
            env={**environment, **more},
            capture_output=True,
            text=True,
        )

    tests = called("pytest", "-q", "-p", "no:cacheprovider", f"test_{module}.py")
    assert tests.returncode == 0, tests.stdout
    assert "passed" in tests.stdout
    return called


@each("kind", ["optimiser", "prior", "tracker", "start", "segmenter"])
@pytest.mark.slow
def test_a_new_plugin_installs_offline_and_passes_its_own_test(
    kind: str, tmp_path: Path
) -> None:
    called = installed(kind, "my-own", tmp_path)
    if kind not in ("start", "segmenter"):  # which take no motion
        method = {"optimiser": "my-own", "prior": "@my-own", "tracker": "my-own"}[kind]
        used = called(
            "posefit", "track", "walk", "--method", method, "--frames", "0:3", "--json"
        )
        assert used.returncode == 0, used.stderr
        assert "my-own" in json.loads(used.stdout)["method"]


@pytest.mark.slow
def test_a_new_command_installs_offline_and_passes_its_own_test(tmp_path: Path) -> None:
    called = installed("command", "how-far", tmp_path)
    assert "how-far  " in called("posefit", "--help").stdout
    used = called("posefit", "how-far", "--frames", "30")
    assert used.returncode == 0, used.stderr
    assert used.stdout.startswith("walk ")
    assert "offers command how-far" in called("posefit", "plugins", "doctor").stdout
    left_out = called("posefit", "how-far", POSEFIT_BLOCK_PLUGINS="posefit-how-far")
    assert left_out.returncode == 2
    assert "No such command 'how-far'" in left_out.stderr


def test_a_new_plugin_has_new_names_and_replaces_nothing(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    hidden = "name must give a new module, got '{0}': its module posefit_{0} would hide the module"
    for words, message in [
        (
            ["track", "--kind", "command"],
            "name must be new, got 'track', which posefit already registers",
        ),
        (
            ["bench", "--kind", "command"],
            "name must be new, got 'bench', which posefit already registers",
        ),
        (
            ["sapso"],
            "name must be new, got 'sapso', which posefit already registers",
        ),
        *(([name], hidden.format(name)) for name in ("swarm", "reproduce", "envs")),
        (["9 lives"], "name must be lower-case letters"),
        (
            ["a", "--kind", "camera"],
            "kind must be one of optimiser, prior, tracker, start, segmenter, command",
        ),
        (["a", "--out", tmp_path / "mine"], "got one that exists"),
    ]:
        assert message in error_of("plugins", "new", "--out", tmp_path / "x", *words)
    assert list(tmp_path.iterdir()) == [tmp_path / "mine"]


@each(
    ("name", "class_name"),
    [("none", "NoneTracker"), ("true", "TrueTracker"), ("frame", "FrameTracker")],
)
def test_a_new_plugins_class_has_a_name_that_is_free(
    name: str, class_name: str, tmp_path: Path
) -> None:
    assert (
        run(
            "plugins", "new", name, "--kind", "tracker", "--out", tmp_path / "x"
        ).exit_code
        == 0
    )
    text = (tmp_path / "x" / f"posefit_{name}.py").read_text()
    assert f"class {class_name}:" in text
    compile(text, name, "exec")


def test_settings_are_given_by_plugin_and_name() -> None:
    sets = [
        "--set",
        "sapso.cooling=0.5",
        "--set",
        "tracker.root_range_degrees=30,10,10",
    ]
    settings = printed(
        "track", "walk", "--frames", "0:2", "--method", "sapso", *QUICK, *sets
    )["settings"]
    assert settings["optimiser"]["cooling"] == 0.5
    assert settings["tracker"] == {"root_range_degrees": [30, 10, 10]}


def test_a_setting_that_makes_no_sense_is_reported_in_one_line() -> None:
    for text, message in [
        (
            "sapso",
            "a setting must be NAME.SETTING=VALUE such as sapso.cooling=0.9, got 'sapso'",
        ),
        ("sapso=3", "tracker.relocalise_gap, tracker.variant, got 'sapso'"),
        (
            "lens.phi=4.2",
            "a setting must belong to one of annealed, pca, tracker, which are in use here, got 'lens.phi'",
        ),
        ("sapso.cooling=2", "cooling must lie in 0 to 1, got 2"),
        ("tracker.floor=0", "floor must be above 0, got 0"),
    ]:
        assert message in error_of(
            "track", "walk", "--frames", "0:2", *QUICK, "--set", text
        )


@each(
    ("command", "libraries"),
    [
        ("--help", "numba scipy cv2 sklearn numpy pandas tqdm"),
        (
            "track walk --frames 0:2 --size 120x90 --evaluations 80 --out OUT",
            "sklearn scipy.stats scipy.optimize pandas matplotlib cmaes skimage numba.cuda",
        ),
    ],
)
def test_a_command_loads_no_library_that_it_can_do_without(
    command: str, libraries: str, tmp_path: Path
) -> None:
    words = command.replace("OUT", str(tmp_path / "out")).split()
    script = (
        f"import sys; from posefit.cli import main; main({words!r}, standalone_mode=False);"
        f"print([name for name in {libraries.split()!r} if name in sys.modules])"
    )
    ran = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert ran.stdout.splitlines()[-1] == "[]"


def test_names_from_outside_do_not_steer_the_terminal(
    capsys: pytest.CaptureFixture[str],
) -> None:
    say("warning: a\x1b]0;b\x07.mp4\nsecond line")
    assert capsys.readouterr().err == "warning: a\\x1b]0;b\\x07.mp4\nsecond line\n"
    for words in (
        ["track", "n" * 3000],
        ["track", "walk", "--camera", "n" * 3000],
        ["n" * 3000],
    ):
        assert len(error_of(*words)) < 400
    assert error_of("track", "a\x1b[31m\nb.amc").startswith(
        r"posefit: a\x1b[31m\nb.amc: no such file"
    )


def test_a_mistake_is_a_traceback_for_who_debugs_and_a_fault_of_the_program_always(
    monkeypatch: Any,
) -> None:
    assert isinstance(run("--debug", "track", "wlak").exception, InputError)
    fault = ValueError("operands could not be broadcast together")
    monkeypatch.setattr("posefit.tracking.front.track_scene", Mock(side_effect=fault))
    assert type(run("track", "walk", "--frames", "0:1").exception) is ValueError


@each(
    "words, called",
    [
        (["track", "walk"], "posefit.tracking.front.track"),
        (["fit", "walk"], "posefit.tracking.front.fit"),
        (["extract", "a.mp4", "--out", "a"], "posefit.footage.extract.extract"),
        (["sweep", "default", "--out", "a"], "posefit.sweep.plan.Plan.of"),
        (["report", "a"], "posefit.report.write.write_report"),
        (["suite", "run", "sapso"], "posefit.suites.running.run_on"),
        (["plugins"], "posefit.cli.inspection.listing"),
    ],
)
def test_ctrl_c_while_a_command_runs_is_reported_in_one_line_and_a_status(
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    tmp_path: Path,
    words: list[str],
    called: str,
) -> None:
    with monkeypatch.context() as patch:
        patch.chdir(tmp_path)
        patch.setattr(called, Mock(side_effect=KeyboardInterrupt))
        patch.setattr(sys, "argv", ["posefit", *words])
        with pytest.raises(SystemExit) as end:
            posefit.cli.run()
    assert end.value.code == 130
    assert "Aborted!" in capfd.readouterr().err.splitlines()


def test_ctrl_c_while_posefit_is_imported_is_reported_in_one_line_and_a_status() -> (
    None
):
    code = """
import runpy, signal, sys
class Interrupting:
    def find_spec(name, path=None, target=None):
        if name == "click":
            signal.raise_signal(signal.SIGINT)
sys.meta_path.insert(0, Interrupting)
runpy.run_module("posefit", run_name="__main__")
"""
    end = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert (end.returncode, end.stdout, end.stderr) == (130, "", "Aborted!\n")
