"""What happens before the first frame: compiling, which is said only where it is done, and costs little."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import posefit
from posefit.silhouette.drawn import PoseCount

COMPILING = "compiling the kernels, once on this machine; this can take half a minute ..."


@pytest.mark.parametrize("method", [{}, {"optimiser": "annealed"}, {"tracker": "vsmm"}])
def test_a_search_is_made_once(method: dict[str, Any]) -> None:
    drawn = PoseCount()
    with drawn.counting():
        used = posefit.fit("walk", size=(120, 90), **method).summary["evaluations"]
    # the warm-up may have 8 x 40 evaluations; the baselines draw every training pose once, and the scene one
    training = sum(len(posefit.motion.library.built_in(style).poses) for style in ("walk-a", "walk-b", "walk-c"))
    assert used <= drawn.poses - training <= used + 400


@pytest.mark.slow
def test_compiling_is_announced_where_something_is_compiled_and_only_there(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "posefit", "fit", "walk", "--size", "60x45", "--evaluations", "80"]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    said = [subprocess.run(words, env=environment, capture_output=True, text=True).stderr for _ in range(2)]
    assert said[0].count(COMPILING) == 1
    assert said[1].count(COMPILING) == 0
    assert "ready in" in said[1]


def test_a_tracker_that_needs_its_whole_budget_works_all_the_same() -> None:
    from tests.testing import planted

    class Demanding(planted.Holds):
        def __init__(self, task: Any) -> None:
            if task.evaluations < 2000:
                raise ValueError(f"evaluations must be at least 2000, got {task.evaluations}")
            super().__init__(task)

    assert posefit.track("walk", tracker=Demanding, frames=(0, 2), size=(120, 90)).summary["frames"] == 2
    with pytest.raises(ValueError, match="evaluations must be at least 2000, got 400"):
        posefit.track("walk", tracker=Demanding, frames=(0, 2), size=(120, 90), evaluations=400)
