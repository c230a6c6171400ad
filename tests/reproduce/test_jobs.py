"""Jobs in processes: their results come back under their keys."""

import os
from functools import partial

import pytest

from posefit_reproduce.jobs import each


def test_jobs_come_back_under_their_keys_from_other_processes() -> None:
    steps: list[int] = []

    def watched(found, count):
        for one in found:
            steps.append(count)
            yield one

    found = each(
        {**{k: partial(divmod, k, 3) for k in (5, 4, 9)}, "who": os.getpid}, 2, watched
    )
    assert found.pop("who") != os.getpid()
    assert list(found.items()) == [(5, (1, 2)), (4, (1, 1)), (9, (3, 0))]
    assert steps == [4] * 4


def test_mistakes_are_reported() -> None:
    with pytest.raises(ValueError, match="workers must be at least 1, got 0"):
        each({"one": os.getpid}, 0)
    with pytest.raises(ValueError, match=r"\('a', 0\): ZeroDivisionError"):
        each({("a", k): partial(divmod, 1, k) for k in (0, 1)}, 1)
