"""`posefit bench --device`: what it says where there is no GPU, and its table in numba's simulator of one."""

import pytest
from click.testing import CliRunner

from posefit.cli import main
from posefit_experiments.bench import device


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--device", "tpu"], "device must be one of cpu, cuda, got 'tpu'"),
        (["--device", "cpu"], "device must be cuda, which is timed beside the CPU, got 'cpu'"),
        (["--device", "cuda", "--growth"], "device must not be given beside --growth, got --device cuda"),
        (["--device", "cuda", "--threads", "2"], "device must not be given beside --threads, got --device cuda"),
    ],
)
def test_what_cannot_be_timed_is_said_in_one_line(options: list[str], expected: str) -> None:
    result = CliRunner().invoke(main, ["bench", *options])
    assert result.exit_code == 2
    assert result.stderr == f"posefit: {expected}\n"


@pytest.mark.device
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_the_table_says_that_both_count_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device, "ROUNDS", 1)
    monkeypatch.setattr(device, "_name", lambda: "simulated")
    figures = device.device_figures("cuda", sizes=((24, 18),), poses=(1, 2), frame=(2, 1))
    assert [(case["poses"], case["equal"], case["proposals_differing"]) for case in figures["cases"]] == [
        (1, True, 0),
        (2, True, 0),
    ]
    assert figures["frame"]["cost"] == figures["frame"]["cpu_cost"]
    lines = list(device.device_lines(figures))
    assert len(lines) == 6
    assert lines[2].endswith("  equal")
