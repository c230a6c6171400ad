"""What is written appears whole or not at all."""

import errno
import json
import os
from threading import Barrier, Thread

import pytest

from posefit.files import MARK as UNFINISHED
from posefit.files import Unfinished, appear, check_new, check_place, new_file, new_folder, replaceable, replaced_file

MARK = b"<!-- ours -->"


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


def test_what_a_killed_run_left_is_neither_in_the_way_nor_removed(tmp_path):
    (tmp_path / ".out.partial").mkdir()
    (tmp_path / ".out.partial" / "old").write_text("old")
    with new_folder(tmp_path / "out") as folder:
        (folder / "new").write_text("new")
    assert [one.name for one in (tmp_path / "out").iterdir()] == ["new"]
    assert (tmp_path / ".out.partial" / "old").read_text() == "old"


def planted(folder):
    """Return somebody's file, to which links lead from every name that could once be guessed."""
    theirs = folder / "theirs"
    theirs.write_text("theirs")
    for name in (".out.partial", ".out.partial.html", ".out.html.partial", ".out.html"):
        (folder / name).symlink_to(theirs)
    return theirs


@pytest.mark.parametrize("opened", [new_file, lambda path: replaced_file(path, MARK)], ids=["new", "replaced"])
@pytest.mark.parametrize("fails", [False, True])
def test_no_link_is_followed_and_none_removed(tmp_path, opened, fails):
    theirs = planted(tmp_path)
    before = sorted(tmp_path.iterdir())
    try:
        with opened(tmp_path / "out.html") as building:
            assert not building.is_symlink()
            building.write_text("mine")
            if fails:
                raise RuntimeError
    except RuntimeError:
        pass
    assert theirs.read_text() == "theirs"
    assert sorted(tmp_path.iterdir()) == sorted([*before, *([] if fails else [tmp_path / "out.html"])])
    assert all((tmp_path / name).is_symlink() for name in (".out.partial", ".out.html"))


@pytest.mark.parametrize("opened", [new_folder, new_file, lambda path: replaced_file(path, MARK)])
def test_a_link_at_the_name_itself_is_something_that_exists(tmp_path, opened):
    (tmp_path / "theirs").write_bytes(MARK)
    (tmp_path / "out").symlink_to(tmp_path / "theirs")
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    for name in ("out", "dangling"):
        with pytest.raises(ValueError, match="expected a new name"), opened(tmp_path / name):
            pass
    assert not (tmp_path / "nothing").exists()


def test_a_name_and_its_place_are_checked_before_anything_is_computed(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "dangling").symlink_to(tmp_path / "nothing")
    for name in ("file", "dangling"):
        check_place(tmp_path / name)
        with pytest.raises(ValueError, match=f"{name}: expected a new name to write to, got one that exists"):
            check_new(tmp_path / name)
    for name in ("none/out", "file/out"):
        check_new(tmp_path / name)
        with pytest.raises(ValueError, match=f"{name}: expected a place to write to, got one in .*, which is none"):
            check_place(tmp_path / name)
    check_new(tmp_path / "out")
    check_place(tmp_path / "out")


@pytest.mark.parametrize("opened", [new_folder, new_file])
def test_of_two_writers_at_once_the_first_to_end_has_the_name(tmp_path, opened):
    def write(path, text):
        (path / "a" if path.is_dir() else path).write_text(text)

    def both():
        with opened(tmp_path / "out") as late:
            write(late, "late")
            with opened(tmp_path / "out") as early:
                assert early != late
                write(early, "early")

    with pytest.raises(ValueError, match="out: expected a new name to write to, got one that exists"):
        both()
    found = tmp_path / "out"
    assert (found / "a" if found.is_dir() else found).read_text() == "early"
    assert list(tmp_path.iterdir()) == [found]


def test_a_new_file_needs_no_hard_links(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "link", refuse)
    with new_file(tmp_path / "out") as building:
        building.write_text("a")
    assert (tmp_path / "out").read_text() == "a"
    with pytest.raises(ValueError, match="got one that exists"), new_file(tmp_path / "late") as building:
        (tmp_path / "late").write_text("early")
    assert (tmp_path / "late").read_text() == "early"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["late", "out"]


def test_only_a_file_that_carries_the_mark_is_replaced(tmp_path):
    path = tmp_path / "out.html"
    for text in (b"one", b"two"):
        with replaced_file(path, MARK) as building:
            building.write_bytes(MARK + text)
    assert path.read_bytes() == MARK + b"two"
    assert replaceable(path, MARK)
    assert not replaceable(tmp_path, MARK)
    path.write_text("a letter")
    wanted = r"out.html: expected a new name or an earlier file of this kind"
    with pytest.raises(ValueError, match=wanted), replaced_file(path, MARK):
        pass
    assert path.read_text() == "a letter"


def test_what_was_there_stays_where_its_replacement_fails(tmp_path):
    path = tmp_path / "out.html"
    path.write_bytes(MARK)

    def fail():
        with replaced_file(path, MARK) as building:
            building.write_text("half")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(ValueError, match="got No space left on device"):
        fail()
    assert path.read_bytes() == MARK
    assert list(tmp_path.iterdir()) == [path]


def test_of_many_that_make_a_file_appear_exactly_one_did(tmp_path):
    start, did = Barrier(8), []

    def work(k):
        start.wait()
        for name in range(50):
            if appear(tmp_path / str(name), {"by": k}):
                did.append((name, k))

    threads = [Thread(target=work, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(name for name, _ in did) == list(range(50))
    assert all(json.loads((tmp_path / str(name)).read_text()) == {"by": k} for name, k in did)
    assert len(list(tmp_path.iterdir())) == 50


def test_bytes_appear_as_they_are(tmp_path):
    assert appear(tmp_path / "a", b"\x00\x01")
    assert not appear(tmp_path / "a", b"other")
    assert (tmp_path / "a").read_bytes() == b"\x00\x01"


def test_only_what_carries_our_mark_for_this_target_and_nobody_works_on_is_left_of_an_earlier_run(tmp_path):
    target = tmp_path / "out"
    at_work = Unfinished.begun(target, {"seed": 0})
    ended = Unfinished.begun(target, {"seed": 1})
    ended.close()
    for name, mark in (
        (".out.partial", None),
        (".out.1", "no JSON"),
        (".out.2", '{"target": "other", "told": {}}'),
        (".out.3", "[]"),
    ):
        (tmp_path / name).mkdir()
        if mark is not None:
            (tmp_path / name / UNFINISHED).write_text(mark)
    (tmp_path / ".out.4").symlink_to(ended.path)
    found = Unfinished.left(target)
    assert [one.path for one in found] == [ended.path]
    assert found[0].told == {"seed": 1}
    assert Unfinished.left(target) == []  # somebody works on it now
    at_work.close()
    assert [one.path for one in Unfinished.left(target)] == [at_work.path]


def test_of_an_unfinished_folder_only_named_files_are_removed(tmp_path):
    one = Unfinished.begun(tmp_path / "out", {})
    (one.path / "ours").write_text("")
    (one.path / "theirs").write_text("theirs")
    one.remove(["ours"])
    assert [path.name for path in one.path.iterdir()] == ["theirs"]
    other = Unfinished.begun(tmp_path / "out", {})
    (other.path / "ours").write_text("")
    other.remove(["ours"])
    assert not other.path.exists()


def test_a_finished_folder_replaces_an_earlier_one_but_nothing_that_came_meanwhile(tmp_path):
    target = tmp_path / "out"
    for text in ("one", "two"):
        place = Unfinished.begun(target, {})
        (place.path / "ours").write_text(text)
        place.finish(["ours"])
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert [(path.name, path.read_text()) for path in target.iterdir()] == [("ours", "two")]
    place = Unfinished.begun(target, {})
    (target / "theirs").write_text("theirs")
    with pytest.raises(OSError, match="theirs"):
        place.finish(["ours"])
    assert sorted(path.name for path in target.iterdir()) == ["ours", "theirs"]
    assert place.path.is_dir()
