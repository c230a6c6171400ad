"""`python -m tests.fuzz --inputs 200000 --seed 1`: exit status 1 where anything but reading and refusing came."""

import argparse
import json
import select
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import pairwise

SECONDS = 10.0  # for an input
STARTING = 120.0  # seconds for a child to import everything and read the valid files
MEGABYTES = 1_000  # of a child's memory, with everything that it has imported


@dataclass
class Tally:
    """What came of inputs."""

    counts: Counter[str] = field(default_factory=Counter)
    read: Counter[str] = field(default_factory=Counter)  # by reader
    refused: Counter[str] = field(default_factory=Counter)
    largest: int = 0  # MB
    longest: float = 0.0  # seconds
    findings: list[str] = field(default_factory=list)

    def find(self, how: str, finding: str) -> None:
        """Take what should not have come, and say so at once."""
        self.counts[how] += 1
        self.findings.append(finding)
        print(finding, file=sys.stderr, flush=True)

    def add(self, number: int, answer: list[object], seconds: float) -> None:
        """Take what a child says of an input."""
        how, reader, megabytes, what = str(answer[0]), str(answer[1]), int(str(answer[2])), answer[3]
        if how in ("read", "refused"):
            self.counts[how] += 1
            getattr(self, how)[reader] += 1
        else:
            self.find(how, f"{number} {how} {reader}: {what}")
        self.largest, self.longest = max(self.largest, megabytes), max(self.longest, seconds)
        if megabytes > MEGABYTES:
            self.find("large", f"{number} large {reader}: {megabytes} MB")
        if seconds > SECONDS:
            self.find("hang", f"{number} hang {reader}: {seconds:.0f} s")


def fuzz(seed: int, numbers: range, tally: Tally, kinds: str) -> None:
    """Have inputs read by child processes, one after the other where one of them dies or hangs."""
    start = numbers.start
    while start < numbers.stop:
        command = [sys.executable, "-m", "tests.fuzz.worker", str(seed), str(start), str(numbers.stop), kinds]
        with subprocess.Popen(command, stdout=subprocess.PIPE, bufsize=0) as child:
            assert child.stdout is not None
            begun, since, patience = start, time.monotonic(), STARTING
            while True:
                ready, _, _ = select.select([child.stdout], [], [], patience)
                line = child.stdout.readline() if ready else None
                if line is None:
                    child.kill()
                    tally.find("hang", f"{begun} hang: more than {SECONDS:g} s")
                    start = begun + 1
                    break
                if not line:
                    status = child.wait()
                    if status and patience == STARTING:
                        raise RuntimeError("a child could not read the valid files")
                    start = begun + 1 if status else numbers.stop
                    if status:
                        tally.find("abort", f"{begun} abort: exit status {status}")
                    break
                number, _, rest = line.decode().partition(" ")
                if rest.strip() == "begun":
                    begun, since, patience = int(number), time.monotonic(), SECONDS
                else:
                    tally.add(int(number), json.loads(rest), time.monotonic() - since)


def main() -> int:
    """Return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--inputs", type=int, default=5_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="one input alone, by its number")
    parser.add_argument("--readers", default="", help="some alone, such as rows,frames")
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    numbers = range(given.inputs) if given.only is None else range(given.only, given.only + 1)
    tally = run(given.seed, numbers, given.workers, given.readers)
    for name in ("read", "refused", "unclean", "abort", "hang", "large"):
        print(f"{name:8} {tally.counts[name]:>8,}")
    for reader in sorted(tally.read | tally.refused):
        print(f"  {reader:12} read {tally.read[reader]:>7,}  refused {tally.refused[reader]:>7,}")
    print(f"largest {tally.largest} MB, longest {tally.longest:.1f} s")
    return int(bool(tally.findings))


def run(seed: int, numbers: range, workers: int, kinds: str = "") -> Tally:
    """Return what came of inputs, of which each worker reads a part."""
    tally = Tally()
    cuts = [numbers.start + len(numbers) * k // workers for k in range(workers + 1)]
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(lambda ends: fuzz(seed, range(*ends), tally, kinds), pairwise(cuts)))
    return tally


if __name__ == "__main__":
    sys.exit(main())
