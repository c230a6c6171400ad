"""What is written appears whole or not at all."""

import errno
import os

import pytest

from posefit.files import new_file, new_folder


def test_a_folder_appears_when_it_is_whole(tmp_path):
    with new_folder(tmp_path / "out") as folder:
        (folder / "a.txt").write_text("a")
        assert not (tmp_path / "out").exists()
    assert (tmp_path / "out" / "a.txt").read_text() == "a"
    assert [one.name for one in tmp_path.iterdir()] == ["out"]


def test_a_file_appears_when_it_is_whole_and_keeps_its_suffix_meanwhile(tmp_path):
    with new_file(tmp_path / "out.csv") as building:
        building.write_text("a")
        assert building.suffix == ".csv"
        assert not (tmp_path / "out.csv").exists()
    assert [one.name for one in tmp_path.iterdir()] == ["out.csv"]


@pytest.mark.parametrize("opened", [new_folder, new_file])
@pytest.mark.parametrize("error", [RuntimeError("no"), KeyboardInterrupt()])
def test_nothing_is_left_of_what_fails(tmp_path, opened, error):
    def fail():
        with opened(tmp_path / "out") as building:
            (building / "a" if building.is_dir() else building).write_text("a")
            raise error

    with pytest.raises(type(error)):
        fail()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("opened", [new_folder, new_file])
def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path, opened):
    def fail():
        with opened(tmp_path / "out") as building:
            (building / "a" if building.is_dir() else building).write_text("a")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(ValueError, match="out: expected a place to write to, got No space left on device"):
        fail()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("opened", [new_folder, new_file])
def test_what_exists_is_kept(tmp_path, opened):
    (tmp_path / "out").write_text("mine")
    with (
        pytest.raises(ValueError, match="out: expected a new name to write to, got one that exists"),
        opened(tmp_path / "out"),
    ):
        pass
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.parametrize("opened", [new_folder, new_file])
def test_a_place_that_is_not_there_is_one_line(tmp_path, opened):
    (tmp_path / "file").write_text("")
    for parent, reason in (("none", "No such file or directory"), ("file", "Not a directory")):

        def fail(where=tmp_path / parent / "out"):
            with opened(where) as building:
                building.write_text("a")

        with pytest.raises(ValueError, match=f"out: expected a place to write to, got {reason}"):
            fail()


def test_what_a_killed_run_left_is_not_in_the_way(tmp_path):
    (tmp_path / ".out.partial").mkdir()
    (tmp_path / ".out.partial" / "old").write_text("old")
    with new_folder(tmp_path / "out") as folder:
        (folder / "new").write_text("new")
    assert [one.name for one in (tmp_path / "out").iterdir()] == ["new"]
