"""Arrays that are made once on a machine: found again, made again where a file is damaged, and never half-written."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from posefit.arrays import stored as store
from posefit.arrays.stored import Arrays, cache_folder, stored


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


class Maker:
    """Makes arrays of a number, and counts how often."""

    def __init__(self, number: float) -> None:
        self.number = number
        self.made = 0

    def __call__(self) -> Arrays:
        self.made += 1
        return {"a": np.full((3, 2), self.number), "b": np.arange(4, dtype=np.int16)}


def equals(arrays: Arrays, number: float) -> bool:
    expected = Maker(number)()
    return arrays.keys() == expected.keys() and all(
        np.array_equal(arrays[name], expected[name])
        and arrays[name].dtype == expected[name].dtype
        for name in expected
    )


def test_arrays_of_a_key_are_made_once() -> None:
    first, second = Maker(1.0), Maker(2.0)
    for _ in range(2):
        assert equals(stored("kind", b"first", first), 1.0)
        assert equals(stored("kind", b"second", second), 2.0)
    assert (first.made, second.made) == (1, 1)
    other = Maker(3.0)
    assert equals(stored("other", b"first", other), 3.0)


@pytest.mark.parametrize("damage", ["cut", "one byte", "empty", "a folder"])
def test_a_damaged_file_is_made_again(damage: str) -> None:
    maker = Maker(1.0)
    stored("kind", b"key", maker)
    (path,) = (cache_folder() / "kind").iterdir()
    content = bytearray(path.read_bytes())
    if damage == "cut":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "one byte":
        # in the numbers of the first array
        place = content.index(np.full(6, 1.0).tobytes())
        content[place] ^= 1
        path.write_bytes(content)
    elif damage == "empty":
        path.write_bytes(b"")
    else:
        path.unlink()
        path.mkdir()
    assert equals(stored("kind", b"key", maker), 1.0)
    assert maker.made == 2
    if damage != "a folder":
        assert equals(stored("kind", b"key", maker), 1.0)
        assert maker.made == 2


def test_a_cache_that_cannot_be_written_costs_the_making(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache.write_text("not a folder")
    maker = Maker(1.0)
    for made in (1, 2):
        assert equals(stored("kind", b"key", maker), 1.0)
        assert maker.made == made


def test_without_a_home_there_is_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(store, "cache_folder", homeless)
    assert equals(stored("kind", b"key", Maker(1.0)), 1.0)


def test_many_at_once_get_whole_arrays() -> None:
    def one(number: int) -> bool:
        return equals(stored("kind", b"key", Maker(5.0)), 5.0)

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(one, range(32)))
    assert len(list((cache_folder() / "kind").iterdir())) == 1


def test_the_files_not_used_for_longest_go(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MAX_FILES", 2)
    makers = [Maker(float(k)) for k in range(3)]
    for k in (0, 1):
        stored("kind", bytes([k]), makers[k])
    folder = cache_folder() / "kind"
    for age, path in enumerate(sorted(folder.iterdir(), key=os.path.getmtime)):
        os.utime(path, (1000.0 + age, 1000.0 + age))
    stored("kind", bytes([0]), makers[0])  # in use: it is the newest now
    stored("kind", bytes([2]), makers[2])
    for k in (0, 2, 1):
        stored("kind", bytes([k]), makers[k])
    assert [maker.made for maker in makers] == [1, 2, 1]
