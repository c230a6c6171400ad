"""The readers of strangers' files hold against 5,000 damaged ones, and the harness notices what does not hold."""

import random

import pytest

from tests.fuzz.__main__ import MEGABYTES, SECONDS, Tally, run
from tests.fuzz.corpus import Seed
from tests.fuzz.mutator import mutated
from tests.fuzz.worker import input_of, outcome


@pytest.mark.slow
def test_five_thousand_damaged_files_are_read_or_refused_with_one_line():
    tally = run(2, range(5_000), 1)
    assert tally.findings == []
    assert tally.counts.total() == 5_000
    # some were still whole enough
    assert all(tally.counts[reader, "read"] for reader, _ in tally.counts.copy())


def test_an_input_is_the_same_for_the_same_seed_and_number():
    seeds = [
        Seed("plan", ".toml", b"seeds = [0, 1, 2]\n" * 9),
        Seed("ledger", ".json", b'{"format": 1}'),
    ]
    assert input_of(seeds, 1, 7) == input_of(seeds, 1, 7)
    assert (
        len(
            {
                mutated(random.Random(k), seeds[0].content, ".toml", b"x")[:60]
                for k in range(50)
            }
        )
        > 10
    )


def test_the_harness_reports_files_that_are_neither_read_nor_refused(tmp_path):
    path = tmp_path / "subject.toml"

    def raising(error):
        def read(_):
            raise error

        return read

    assert outcome(lambda _: None, path)[0] == "read"
    assert (
        outcome(raising(ValueError(f"{path}: expected a plan, got none")), path)[0]
        == "refused"
    )
    assert outcome(raising(ValueError("no")), path)[0] == "unclean"
    assert outcome(raising(KeyError("rows")), path)[0] == "unclean"
    tally = Tally()
    tally.add(0, ["read", "plan", MEGABYTES + 1, ""], 0.0)
    tally.add(1, ["refused", "plan", 1, ""], SECONDS + 1.0)
    tally.add(2, ["unclean", "plan", 1, "KeyError: 'rows'"], 0.0)
    assert [finding.split()[1] for finding in tally.findings] == [
        "large",
        "hang",
        "unclean",
    ]
