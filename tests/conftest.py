"""What several folders of tests share."""

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def cmu() -> Path:
    """Return the folder of real CMU clips, or skip the test where there is none."""
    beside = Path(__file__).parents[2] / "shared" / "data" / "cmu"
    folder = Path(os.environ.get("POSEFIT_CMU", beside))
    if not (folder / "manifest.tsv").is_file():
        pytest.skip(f"no CMU clips in {folder}: name their folder in the environment variable POSEFIT_CMU")
    return folder
