"""`python -m tests.fuzz --inputs 200000 --seed 1`: exit status 1 where anything but reading and refusing came."""

import argparse
import multiprocessing
import signal
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, field

from pebble import ProcessExpired, ProcessPool

from tests.fuzz import worker

WAIT = 900.0  # seconds of the clock for an input: for what does not run at all
MEGABYTES = 1_000  # of a process's memory, with everything that it has imported


@dataclass
class Tally:
    """What came of inputs."""

    counts: Counter[tuple[str, str]] = field(default_factory=Counter)  # of each reader, those read and those refused
    largest: int = 0  # MB
    findings: list[str] = field(default_factory=list)

    def find(self, finding: str) -> None:
        """Take what should not have come, and print it at once."""
        self.findings.append(finding)
        print(finding, file=sys.stderr, flush=True)

    def add(self, number: int, answer: worker.Answer) -> None:
        """Take what came of an input."""
        self.counts[answer.reader, answer.outcome] += 1
        self.largest = max(self.largest, answer.megabytes)
        if answer.outcome not in ("read", "refused"):
            self.find(f"{number} {answer.outcome} {answer.reader}: {answer.what}")
        if answer.megabytes > MEGABYTES:
            self.find(f"{number} large {answer.reader}: {answer.megabytes} MB")


def run(seed: int, numbers: range, workers: int, kinds: str = "") -> Tally:
    """Return what came of inputs; a process that dies or hangs over one is replaced."""
    tally, spawn = Tally(), multiprocessing.get_context("spawn")
    with (
        tempfile.TemporaryDirectory() as folder,
        ProcessPool(workers, context=spawn, initializer=worker.start, initargs=(seed, kinds, folder)) as pool,
    ):
        futures = {number: pool.schedule(worker.read, [number], timeout=WAIT) for number in numbers}
        for number, future in futures.items():
            try:
                tally.add(number, future.result())
            except TimeoutError:
                tally.find(f"{number} hang: no answer for {WAIT:g} s")
            except ProcessExpired as error:
                hung = error.exitcode == -signal.SIGPROF
                came = f"hang: more than {worker.SECONDS:g} s of CPU time" if hung else f"abort: {error}"
                tally.find(f"{number} {came}")
    return tally


def main() -> int:
    """Return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--inputs", type=int, default=5_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="one input alone, by its number")
    parser.add_argument("--readers", default="", help="some alone, such as rows,frames")
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    numbers = range(options.inputs) if options.only is None else range(options.only, options.only + 1)
    tally = run(options.seed, numbers, options.workers, options.readers)
    for reader in sorted({reader for reader, _ in tally.counts}):
        read, refused = (tally.counts[reader, outcome] for outcome in ("read", "refused"))
        print(f"{reader:12} read {read:>7,}  refused {refused:>7,}")
    print(f"{len(tally.findings)} findings, largest {tally.largest} MB")
    return int(bool(tally.findings))


if __name__ == "__main__":
    sys.exit(main())
