"""Digests of what posefit computes, to compare before and after a change: `python -m tests.pins write|compare FILE`.

Eleven tracks (each built-in method, two cameras, masks, and the demonstration video where its folder is
there), every file that one track exports, ten rollouts of environments, ten searches of the suite and the rows of the
default sweep; without times and versions. `compare` names each item that differs and exits with status 1 then;
`--only tracks` and the like restrict it. Digits depend on the processor, so a file holds for the machine that wrote it.
Takes about three minutes.
"""

import hashlib
import json
import subprocess
import sys
import tempfile
import warnings
from argparse import ArgumentParser
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.silhouette.cost import project
from tests.files import csv_rows

VIDEO = Path(__file__).parents[2] / "shared/data/video/sports2d_walk"
POSEFIT = (sys.executable, "-m", "posefit")
FRAMES = "8:16"  # of motions
METHODS = ("sapso@pca", "pso@pca", "cma@pca", "annealed@pca", "particle@full", "random@pca", "vsmm")
EXPORTS = ("*.amc", "*.asf", "*.bvh", "*.c3d", "*.glb", "*.mot", "*.osim", "*.trc", "angles.csv", "gait.csv")
TIMES = ("version", "key", "seconds", "_ms", "ms_", "cpu", "wall")  # in the names of columns that are left out
LABELS = ("kind", "name")  # columns of a row that no result depends on, and that were not there at first
ENVIRONMENTS = (
    ("FitImage", {"max_evaluations": 12}),
    ("FitImage", {"max_evaluations": 12, "noise": {"holes": 0.3, "shadow": 0.5}}),
    ("Track", {"frames": 4, "evaluations_per_frame": 5}),
    ("Race", {}),
)
PLAN = """
suite = "posefit-2026.3"
methods = ["sapso", "cma"]
functions = [1, 2, 3, 4, 8]
instances = 1
budgets = [60]
"""


def digest(*values: Any) -> str:
    """Return a short digest of arrays, texts and bytes."""
    content = hashlib.sha256()
    for value in values:
        content.update(value if isinstance(value, bytes) else np.asarray(value).tobytes())
    return content.hexdigest()[:16]


def posefit(*words: object) -> None:
    """Run a command. Raises CalledProcessError where it fails."""
    subprocess.run([*POSEFIT, *map(str, words)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)


def poses(folder: Path) -> str:
    """Return the digest of the poses in a track's folder."""
    with np.load(folder / "poses.npz") as arrays:
        return digest(arrays["poses"], arrays["translations"])


def tracks(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the name and digest of each track."""
    for method in METHODS:
        out = folder / method
        posefit("track", "walk", "--frames", FRAMES, "--method", method, "--out", out)
        yield method, poses(out)
    posefit("track", "walk", "--frames", FRAMES, "--method", "exemplars", "--view-degrees", 0, "--view-degrees", 90,
            "--out", folder / "cameras")  # fmt: skip
    yield "two cameras", poses(folder / "cameras")
    motion = built_in.motion("walk", frames=32)
    body, place = Body.of(motion.skeleton), motion.translations[0]
    camera = Camera.around(place, azimuth=0.8, distance=3.5, size=(160, 120))
    np.savez(folder / "masks.npz", masks=[project(body, camera, pose, place) for pose in motion.poses[:12]])
    posefit("track", folder / "masks.npz", "--fps", 30, "--height", 1.75, "--out", folder / "masked")
    yield "masks", poses(folder / "masked")
    if VIDEO.is_dir():
        posefit("track", VIDEO / "demo.mp4", "--roi", "0,420,1520,532", "--frames", "55:95", "--out", folder / "film")
        yield "video", poses(folder / "film")


def exports(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the name and digest of every file that a track exports; lines with a version are left out."""
    posefit("track", "walk", "--frames", FRAMES, "--out", folder / "exports")
    for pattern in EXPORTS:
        for path in sorted((folder / "exports").glob(pattern)):
            lines = path.read_bytes().split(b"\n")
            yield path.name, digest(b"\n".join(line for line in lines if b"posefit" not in line))
    rows = [without_times(row) for row in csv_rows(folder / "exports/frames.csv")]
    yield "frames.csv", digest(json.dumps(rows).encode())


def without_times(row: dict[str, str]) -> dict[str, str]:
    """Return the columns of a row that are not of times and versions, and no labels."""
    return {
        name: value for name, value in row.items() if name not in LABELS and not any(word in name for word in TIMES)
    }


def rollouts(_: Path) -> Iterator[tuple[str, str]]:
    """Yield the name and digest of each environment's rollout: one environment, and a vector of three."""
    import gymnasium as gym

    for number, (name, arguments) in enumerate(ENVIRONMENTS):
        for count in (1, 3):
            env: Any = gym.make_vec(f"posefit_envs:posefit/{name}-v0", num_envs=count, **arguments)
            if count == 1:
                env.close()
                env = gym.make(f"posefit_envs:posefit/{name}-v0", **arguments)
            env.action_space.seed(0)
            steps = [env.reset(seed=3)[0]]
            for _step in range(12):
                steps += env.step(env.action_space.sample())[:4]
            env.close()
            yield f"{name} {number} x {count}", digest(*steps)


def rows(folder: Path, plan: str | Path) -> Iterator[tuple[str, str]]:
    """Yield the name and digest of each row of a plan's sweep."""
    out = folder / f"results-{Path(plan).stem}"
    posefit("sweep", plan, "--out", out)
    posefit("report", out, "--csv", out.with_suffix(".csv"))
    for row in csv_rows(out.with_suffix(".csv")):
        names = [row[name] for name in ("method", "function", "motion", "instance", "seed") if row.get(name)]
        yield " ".join(names), digest(json.dumps(without_times(row)).encode())


def searches(folder: Path) -> Iterator[tuple[str, str]]:
    """Yield the name and digest of each search of the suite."""
    (folder / "suite.toml").write_text(PLAN)
    yield from rows(folder, folder / "suite.toml")


PINNED = {
    "tracks": tracks,
    "exports": exports,
    "rollouts": rollouts,
    "searches": searches,
    "sweep": lambda folder: rows(folder, "default"),
}


def main() -> int:
    """Write or compare digests; return the exit status."""
    parser = ArgumentParser(prog="tests.pins", description=__doc__)
    parser.add_argument("what", choices=("write", "compare"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--only", action="append", choices=PINNED)
    arguments = parser.parse_args()
    warnings.filterwarnings("error", "plugin ")  # none may be left out
    digests = {}
    with tempfile.TemporaryDirectory() as name:
        for kind in arguments.only or PINNED:
            for item, value in PINNED[kind](Path(name)):
                digests[f"{kind}: {item}"] = value
    if arguments.what == "write":
        arguments.file.write_text(json.dumps(digests, indent=1) + "\n")
        print(f"{len(digests)} digests written to {arguments.file}")
        return 0
    before = json.loads(arguments.file.read_text())
    before = {item: value for item, value in before.items() if item.partition(":")[0] in (arguments.only or PINNED)}
    differing = sorted(item for item in before.keys() | digests.keys() if before.get(item) != digests.get(item))
    for item in differing:
        print(f"differs: {item}")
    print(f"{len(before) - len(differing)} of {len(before)} are the same")
    return bool(differing)


if __name__ == "__main__":
    sys.exit(main())
