"""Work in parts: each row once, in order of taking, on several threads."""

from concurrent.futures import ThreadPoolExecutor

import pytest

from posefit.silhouette.drawn import PoseCount, count_poses
from posefit.silhouette.sharing import parts_of, work_through
from tests.cases import each


@each("threads", [1, 2])
def test_what_goes_wrong_in_a_part_is_raised(threads: int) -> None:
    def work(part: slice) -> None:
        if part.start <= 500 < part.stop:
            raise ValueError("row 500")

    with pytest.raises(ValueError, match="row 500"):
        work_through(parts_of(1000, threads), threads, lambda part: (), work)


def test_poses_that_other_threads_draw_are_counted_for_the_one_who_asked() -> None:
    counts = [PoseCount(), PoseCount()]

    def ask(count: PoseCount, n: int) -> None:
        with count.counting():
            work_through(parts_of(n, 3), 3, lambda part: (), lambda part: count_poses(part.stop - part.start))

    with ThreadPoolExecutor(2) as pool:
        for job in [pool.submit(ask, count, n) for count, n in zip(counts, (1000, 3000), strict=True)]:
            job.result(timeout=60)
    assert [count.poses for count in counts] == [1000, 3000]
