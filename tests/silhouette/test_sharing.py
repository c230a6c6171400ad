"""Work in parts: each row once, in order of taking, on several threads."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from posefit.silhouette.drawn import PoseCount, count_poses
from posefit.silhouette.sharing import LEAST_SHARE, PART, SHARED_PART, parts_of, work_through
from tests.cases import each


def test_parts_hold_every_row_once_and_are_about_as_long() -> None:
    for n in [0, 1, LEAST_SHARE, 2 * LEAST_SHARE, PART, PART + 1, 1000, 4000]:
        for threads in [1, 2, 3, 8]:
            parts = parts_of(n, threads)
            rows = [row for part in parts for row in range(part.start, part.stop)]
            assert rows == list(range(n))
            lengths = [part.stop - part.start for part in parts]
            assert max(lengths) - min(lengths) <= 1
            assert max(lengths) <= (PART if threads == 1 or n < 2 * LEAST_SHARE else SHARED_PART)
            # no thread waits while others have two parts to do
            assert len(parts) % max(min(threads, n // LEAST_SHARE), 1) == 0


@each("threads", [1, 2, 5])
def test_every_part_is_taken_and_worked_on_once_and_taken_by_one_thread_at_a_time(threads: int) -> None:
    done, taking, crowds, who = np.zeros(1000, dtype=int), threading.Lock(), [], set()
    company = threading.Event()

    def take(part: slice) -> tuple[slice]:
        crowds.append(taking.acquire(blocking=False))
        time.sleep(0.001)
        taking.release()
        return (part,)

    def work(part: slice, same: slice) -> None:
        assert part == same
        who.add(threading.get_ident())
        if len(who) > 1:
            company.set()
        assert threads == 1 or company.wait(60.0)  # a thread alone does not do them all
        done[part] += 1

    work_through(parts_of(1000, threads), threads, take, work)
    assert (done == 1).all()
    assert all(crowds)
    assert min(threads, 2) <= len(who) <= threads


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
