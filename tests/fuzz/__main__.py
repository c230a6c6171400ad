"""`python -m tests.fuzz --inputs 200000 --seed 1`: exit status 1 where anything but reading and refusing came."""

import argparse
import json
import os
import select
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

# of CPU time for an input, as a busy machine gives a process little of it
SECONDS = 10.0
WAIT = 900.0  # seconds of the clock, for what does not run at all
STARTING = 120.0  # seconds for a child to import everything and read the valid files
MEGABYTES = 1_000  # of a child's memory, with everything that it has imported


@dataclass
class Tally:
    """What came of inputs."""

    # of each reader, those read and those refused
    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    largest: int = 0  # MB
    longest: float = 0.0  # seconds
    findings: list[str] = field(default_factory=list)

    def find(self, finding: str) -> None:
        """Take what should not have come, and say so at once."""
        self.findings.append(finding)
        print(finding, file=sys.stderr, flush=True)

    def add(self, number: int, answer: list[object], seconds: float) -> None:
        """Take what a child says of an input."""
        how = str(answer[0])
        reader = str(answer[1])
        megabytes = int(str(answer[2]))
        what = answer[3]
        self.counts[reader, how] += 1
        self.largest, self.longest = (
            max(self.largest, megabytes),
            max(self.longest, seconds),
        )
        if how not in ("read", "refused"):
            self.find(f"{number} {how} {reader}: {what}")
        if megabytes > MEGABYTES:
            self.find(f"{number} large {reader}: {megabytes} MB")
        if seconds > SECONDS:
            self.find(f"{number} hang {reader}: {seconds:.0f} s")


def fuzz(seed: int, numbers: range, tally: Tally, kinds: str) -> None:
    """Have inputs read by child processes, one after the other where one of them dies or hangs."""
    start = numbers.start
    while start < numbers.stop:
        command = [
            sys.executable,
            "-m",
            "tests.fuzz.worker",
            str(seed),
            str(start),
            str(numbers.stop),
            kinds,
        ]
        with subprocess.Popen(command, stdout=subprocess.PIPE, bufsize=0) as child:
            assert child.stdout is not None
            number = start
            since = 0.0
            patience = STARTING
            while ready := _is_heard(child, since + patience):
                line = child.stdout.readline().decode()
                if not line:
                    break
                if line.endswith("begun\n"):
                    number = int(line.split()[0])
                    since = cpu_seconds(child.pid)
                    patience = SECONDS
                else:
                    tally.add(
                        number,
                        json.loads(line.partition(" ")[2]),
                        cpu_seconds(child.pid) - since,
                    )
            if not ready:
                child.kill()
                tally.find(
                    f"{number} hang: more than {patience:g} s of CPU time, or {WAIT:g} s without an answer"
                )
            elif status := child.wait():
                if patience == STARTING:
                    raise RuntimeError("a child could not read the valid files")
                tally.find(f"{number} abort: exit status {status}")
            else:
                return
            start = number + 1


def cpu_seconds(process: int) -> float:
    """Return how much CPU time a process has taken."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _is_heard(child: "subprocess.Popen[bytes]", most: float) -> bool:
    """Return whether a child says something before it has taken so much CPU time, or not run for `WAIT`."""
    end = time.monotonic() + WAIT
    while not select.select([child.stdout], [], [], 1.0)[0]:
        if cpu_seconds(child.pid) > most or time.monotonic() > end:
            return False
    return True


def main() -> int:
    """Return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--inputs", type=int, default=5_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="one input alone, by its number")
    parser.add_argument("--readers", default="", help="some alone, such as rows,frames")
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    numbers = (
        range(given.inputs) if given.only is None else range(given.only, given.only + 1)
    )
    tally = run(given.seed, numbers, given.workers, given.readers)
    for reader in sorted({reader for reader, _ in tally.counts}):
        read, refused = (tally.counts[reader, how] for how in ("read", "refused"))
        print(f"{reader:12} read {read:>7,}  refused {refused:>7,}")
    print(
        f"{len(tally.findings)} findings, largest {tally.largest} MB, longest {tally.longest:.1f} s"
    )
    return int(bool(tally.findings))


def run(seed: int, numbers: range, workers: int, kinds: str = "") -> Tally:
    """Return what came of inputs, of which each worker reads a part."""
    tally = Tally()
    cuts = [numbers.start + len(numbers) * k // workers for k in range(workers + 1)]
    with ThreadPoolExecutor(workers) as pool:
        list(
            pool.map(
                lambda ends: fuzz(seed, range(*ends), tally, kinds), pairwise(cuts)
            )
        )
    return tally


if __name__ == "__main__":
    sys.exit(main())
