"""What several folders of tests share, and which tests a plain run leaves out."""

import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

# how long an example takes says nothing of it
settings.register_profile("posefit", deadline=None)
settings.load_profile("posefit")
# a run in the background ignores it, and so do its children
signal.signal(signal.SIGINT, signal.default_int_handler)
if os.environ.get("NUMBA_DISABLE_JIT") == "1":
    # the rasteriser takes roots of negative numbers on purpose, and compiled code
    # does not warn
    np.seterr(invalid="ignore")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--all", action="store_true", help="run the slow tests too")


def pytest_collection_modifyitems(
    config: pytest.Config, items: list[pytest.Item]
) -> None:
    if not config.getoption("--all"):
        for item in items:
            if item.get_closest_marker("slow"):
                item.add_marker(pytest.mark.skip(reason="slow: --all runs it"))
    if (
        os.environ.get("NUMBA_ENABLE_CUDASIM") != "1"
        and shutil.which("nvidia-smi") is None
    ):
        for item in items:
            if item.get_closest_marker("device"):
                item.add_marker(
                    pytest.mark.skip(
                        reason="no GPU: NUMBA_ENABLE_CUDASIM=1 and -m device simulate one"
                    )
                )


@pytest.fixture(scope="session")
def seed() -> int:
    """Return what a test adds to a seed that it is free to choose: 0, or what `tests.machines` runs with."""
    return int(os.environ.get("POSEFIT_TEST_SEED", "0"))


@pytest.fixture(scope="session")
def cmu() -> Path:
    """Return the folder of real CMU clips, or skip the test where there is none."""
    beside = Path(__file__).parents[2] / "shared" / "data" / "cmu"
    folder = Path(os.environ.get("POSEFIT_CMU", beside))
    if not (folder / "manifest.tsv").is_file():
        pytest.skip(
            f"no CMU clips in {folder}: name their folder in the environment variable POSEFIT_CMU"
        )
    return folder


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """Return a headless browser, or skip the test where there is none."""
    from tests.report.browser import browser

    with browser() as found:
        yield found
