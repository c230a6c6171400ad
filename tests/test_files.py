"""Files and folders appear whole or not at all."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from posefit.files import MARK as UNFINISHED
from posefit.files import Unfinished, new_file, new_folder, replaced_file

MARK = b"<!-- ours -->"
FULL = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
NEW = pytest.mark.parametrize("opened", [new_folder, new_file])


def content_of(path):
    """Return the file in a folder that was made, or the file itself."""
    return path / "a" if path.is_dir() else path


def fail(opening, error):
    with opening as building:
        content_of(building).write_text("a")
        raise error


@NEW
def test_a_name_appears_when_its_content_is_whole(tmp_path, opened):
    target = tmp_path / "out.csv"
    with opened(target) as building:
        content_of(building).write_text("a")
        assert building.suffix == ".csv"
        assert not target.exists()
    assert content_of(target).read_text() == "a"
    assert list(tmp_path.iterdir()) == [target]


@NEW
def test_a_failure_leaves_nothing(tmp_path, opened):
    for error, raised, message in (
        (RuntimeError("no"), RuntimeError, "no"),
        (KeyboardInterrupt("stop"), KeyboardInterrupt, "stop"),
        (
            FULL,
            ValueError,
            "cannot write to .*out: No space left on device",
        ),
    ):
        with pytest.raises(raised, match=message):
            fail(opened(tmp_path / "out"), error)
        assert list(tmp_path.iterdir()) == []


@NEW
def test_a_name_that_is_taken_or_has_no_place_is_refused(tmp_path, opened):
    (tmp_path / "file").write_text("mine")
    for path, message in (
        ("file", "file: expected a new name to write to, got one that exists"),
        (
            "none/out",
            "cannot write to .*out: No such file or directory",
        ),
        ("file/out", "cannot write to .*out: Not a directory"),
    ):
        with pytest.raises(ValueError, match=message), opened(tmp_path / path):
            pass
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.parametrize(
    "opened", [new_folder, new_file, lambda path: replaced_file(path, MARK)]
)
def test_a_link_at_the_name_counts_as_existing_and_is_not_followed(tmp_path, opened):
    (tmp_path / "theirs").write_bytes(MARK)
    (tmp_path / "out").symlink_to(tmp_path / "theirs")
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    for name in ("out", "dangling"):
        with (
            pytest.raises(ValueError, match="expected a new name"),
            opened(tmp_path / name),
        ):
            pass
    assert (tmp_path / "theirs").read_bytes() == MARK
    assert {path.name for path in tmp_path.iterdir()} == {"theirs", "out", "dangling"}


@NEW
@pytest.mark.parametrize("links", [True, False])
def test_of_two_writers_at_once_the_first_to_end_has_the_name(
    tmp_path, monkeypatch, opened, links
):
    def refuse(*_):  # as a file system without hard links
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    if not links:
        monkeypatch.setattr(os, "link", refuse)
    taken = pytest.raises(
        ValueError, match="out: expected a new name to write to, got one that exists"
    )
    with taken, opened(tmp_path / "out") as late:
        content_of(late).write_text("late")
        with opened(tmp_path / "out") as early:
            assert early != late
            content_of(early).write_text("early")
    assert content_of(tmp_path / "out").read_text() == "early"
    assert list(tmp_path.iterdir()) == [tmp_path / "out"]


def test_a_failure_leaves_an_earlier_file_unchanged(tmp_path):
    path = tmp_path / "out.html"
    path.write_bytes(MARK + b"one")
    with pytest.raises(ValueError, match="No space left on device"):
        fail(replaced_file(path, MARK), FULL)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [
        ("out.html", MARK + b"one")
    ]


def test_only_marked_folders_of_this_target_that_are_not_in_use_count_as_interrupted(
    tmp_path,
):
    target = tmp_path / "out"
    in_use = Unfinished.begin(target, {"seed": 0})
    ended = Unfinished.begin(target, {"seed": 1})
    ended.close()
    (tmp_path / ".out.partial").mkdir()
    for k, mark in enumerate(("no JSON", '{"target": "other", "info": {}}', "[]")):
        (tmp_path / f".out.{k}").mkdir()
        (tmp_path / f".out.{k}" / UNFINISHED).write_text(mark)
    (tmp_path / ".out.4").symlink_to(ended.path)
    assert [
        (folder.path, folder.info) for folder in Unfinished.interrupted(target)
    ] == [(ended.path, {"seed": 1})]
    assert Unfinished.interrupted(target) == []  # it is in use now
    in_use.close()
    assert [folder.path for folder in Unfinished.interrupted(target)] == [in_use.path]


def test_of_an_unfinished_folder_only_named_files_are_removed(tmp_path):
    kept, removed = (Unfinished.begin(tmp_path / "out", {}) for _ in range(2))
    (kept.path / "theirs").write_text("theirs")
    for unfinished in (kept, removed):
        (unfinished.path / "ours").write_text("")
        unfinished.remove(["ours"])
    assert [path.name for path in kept.path.iterdir()] == ["theirs"]
    assert not removed.path.exists()


def test_a_finished_folder_replaces_an_earlier_one_but_no_other_files(tmp_path):
    target = tmp_path / "out"
    for text in ("one", "two"):
        place = Unfinished.begin(target, {})
        (place.path / "ours").write_text(text)
        place.finish(["ours"], replace=True)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert [(path.name, path.read_text()) for path in target.iterdir()] == [
        ("ours", "two")
    ]
    place = Unfinished.begin(target, {})
    (target / "theirs").write_text("theirs")
    with pytest.raises(OSError, match="theirs"):
        place.finish(["ours"], replace=True)
    assert sorted(path.name for path in target.iterdir()) == ["ours", "theirs"]
    assert place.path.is_dir()


def test_the_first_of_two_tracks_to_finish_gets_the_folders_name(tmp_path):
    late, early = (Unfinished.begin(tmp_path / "out", {}) for _ in range(2))
    (late.path / "ours").write_text("late")
    (early.path / "ours").write_text("early")
    early.finish(["ours"], replace=False)
    with pytest.raises(OSError):
        late.finish(["ours"], replace=False)
    assert (tmp_path / "out" / "ours").read_text() == "early"
    assert (late.path / "ours").read_text() == "late"


def test_a_pose_is_compared_on_a_system_without_unix_locks_and_limits():
    script = (
        "import sys\n"
        "sys.modules['fcntl'] = sys.modules['resource'] = None\n"
        "import numpy as np\n"
        "from posefit import Body, Camera, SilhouetteCost, Silhouette\n"
        "from posefit.files import Unfinished\n"
        "from posefit.limits import allowed_bytes\n"
        "from posefit.motion import built_in\n"
        "from posefit.silhouette.cost import pose_costs, project\n"
        "body, pose = Body.of(built_in.average_skeleton()), np.zeros((1, 66))\n"
        "camera = Camera.around(np.zeros(3), 0.0, 4.0, (40, 30))\n"
        "observed = Silhouette.of(project(body, camera, pose[0], np.zeros(3)))\n"
        "print(SilhouetteCost.__name__, pose_costs(body, [camera], [observed], pose, np.zeros((1, 3)))[0][0])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.stdout == "SilhouetteCost 0.0\n", done.stderr


def test_a_removed_folder_takes_along_the_parents_that_were_made_for_it(
    tmp_path: Path,
) -> None:
    (tmp_path / "there").mkdir()
    folder = Unfinished.begin(tmp_path / "there" / "o" / "p" / "q", {})
    (folder.path / "poses.npz").touch()
    folder.remove(["poses.npz"])
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]
    kept = Unfinished.begin(tmp_path / "there" / "o" / "q", {})
    (tmp_path / "there" / "o" / "mine").touch()
    kept.remove([])
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["mine", "o", "there"]
