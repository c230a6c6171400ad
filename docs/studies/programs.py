"""Opens a track's files with the programs for which they are made.

    python docs/studies/programs.py --folder programs

The programs are OpenSim, Blender and others, at the versions below. This needs a
network, ten minutes, npm, and a Python for which OpenSim and Blender have packages
(3.11). A cell is a file of a track, read by a program. programs_read.py has the
comparisons, and programs_read.mjs those of JavaScript. The exit status is 1 if a cell
is wrong.
"""

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

import posefit
from posefit.motion import built_in
from posefit.progress import QUIET
from posefit.silhouette.cost import project
from programs_read import EXPECTED, NODE_PROGRAMS, NOT_OFFERED, PROGRAMS

READER = Path(__file__).with_name("programs_read.py")
NODE_READER = Path(__file__).with_name("programs_read.mjs")
# for each program, the files that it reads
FILES: Mapping[str, Sequence[str]] = {
    **{program: [*checks] for program, checks in PROGRAMS.items()},
    **NODE_PROGRAMS,
}
VERSIONS: Mapping[str, tuple[str, ...]] = {
    "opensim": ("opensim==4.6", "numpy==2.4.6"),
    "trc-data-reader": ("trc-data-reader==0.4.1", "numpy==2.4.6"),
    "ezc3d": ("ezc3d==1.7.2",),
    "c3d": ("c3d==0.6.0",),
    "kineticstoolkit": ("kineticstoolkit==0.17.0", "ezc3d==1.7.2"),
    "pyomeca": ("pyomeca==2026.0.2", "ezc3d==1.7.2"),
    # its readers of files do not use torch
    "nimblephysics": ("nimblephysics==0.10.52.1", "--no-deps", "numpy==2.4.6"),
    "bvhio": ("bvhio==1.5.4",),
    "upc-pymotion": ("upc-pymotion==0.3.4",),
    "pybvh": ("pybvh==0.9.0",),
    "bpy": ("bpy==5.0.1",),
    "trimesh": ("trimesh==5.2.0",),
    "pygltflib": ("pygltflib==1.16.5", "numpy==2.4.6"),
    "gltf-validator": ("gltf-validator@2.0.0-dev.3.10",),
    "three": ("three@0.187.0",),
    "av": ("av==18.1.0", "numpy==2.4.6"),
    "pandas": ("pandas==3.1.1",),
}
FRAMES = 24
# for each track: frames that show nobody, and what differs from the plain track
TRACKS: Mapping[str, tuple[tuple[int, ...], Mapping[str, Any]]] = {
    "plain": ((), {}),
    "held frames": ((0, 5, 6, 23), {}),
    "119.88 a second": ((), {"fps": 119.88}),
    "--frames 10:20": ((), {"frames": (10, 20)}),
    "odd size": ((), {"size": (101, 77)}),
    "all of these": (
        (10, 15, 19),
        {"fps": 119.88, "frames": (10, 20), "size": (101, 77)},
    ),
    "--frames 4:5": ((), {"frames": (4, 5)}),
    # the other person is alone in frame 9
    "two people": ((9,), {"other": True}),
}


def write_track(
    folder: Path,
    empty: tuple[int, ...],
    *,
    size: tuple[int, int] = (160, 120),
    fps: float = 30.0,
    frames: tuple[int, int] = (0, FRAMES),
    other: bool = False,
) -> None:
    """Track a walk in masks, and write its files and their expected content.

    Args:
        folder: The folder of the track.
        empty: The frames whose mask does not show the person.
        size: Width and height of the masks, in pixels.
        fps: Frames a second.
        frames: The first frame that is tracked, and the one after the last.
        other: Whether the masks show a second person, two metres aside.
    """
    walk = built_in.motion("walk", frames=FRAMES)
    body = posefit.Body.of(walk.skeleton)
    camera = posefit.Camera.around(walk.translations[0], 0.8, 4.5, size)
    poses = zip(walk.poses, walk.translations, strict=True)
    masks = np.array([project(body, camera, *pose) for pose in poses])
    masks[list(empty)] = False
    person = None
    if other:
        # the tracked person's middle in the first frame
        rows, columns = np.nonzero(masks[0])
        person = (float(columns.mean()), float(rows.mean()))
        aside = walk.translations - (0.0, 0.0, 2.0)
        poses = zip(walk.poses, aside, strict=True)
        masks |= np.array([project(body, camera, *pose) for pose in poses])
    track = posefit.track(
        masks,
        person=person,
        camera=camera,
        fps=fps,
        frames=frames,
        out=folder,
        progress=QUIET,
        method="random@pca",
        evaluations=80,
        body_frames=0,
    )
    expected = {
        "joints": track.joints.tolist(),
        "times": [float(seconds) for seconds in track.table["seconds"]],
        "held": [int(frame) in track.unseen for frame in track.table["frame"]],
        "places": list(track.joint_names),
        "fps": fps,
        "first": track.motion.first,
    }
    (folder / EXPECTED).write_text(json.dumps(expected))


def installed(program: str, folder: Path, python: str) -> list[str]:
    """Return the command that reads files with a program, and install what it needs."""
    place = (folder / "environments" / program).resolve()
    node = program in NODE_PROGRAMS
    own = str(place / "bin" / "python")
    if not (place / "done").exists():
        if node:
            install = ["npm", "install", "--silent", "--prefix", str(place)]
        else:
            subprocess.run([python, "-m", "venv", "--clear", place], check=True)
            install = [own, "-m", "pip", "install", "--quiet"]
        subprocess.run([*install, *VERSIONS[program]], check=True)
        (place / "done").touch()
    if not node:
        return [own, str(READER)]
    # node looks for packages from the script's folder upwards
    script = place / NODE_READER.name
    shutil.copy(NODE_READER, script)
    return ["node", str(script)]


def read(
    program: str, command: Sequence[str], folder: Path
) -> Iterator[tuple[str, str]]:
    """Yield each file that a program reads, and an error, nothing, or a dash.

    A dash means that the program does not offer this.
    """
    words = [*command, program, str(folder.resolve())]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    # a file without a result is wrong because the reader ended before it
    missing = dict.fromkeys(FILES[program], f"ended with {done.returncode}")
    for line in done.stdout.splitlines():
        if line.startswith('["result"'):
            _, name, wrong = json.loads(line)
            missing.pop(name)
            yield name, wrong
    yield from missing.items()


@click.command()
@click.option(
    "--folder", type=Path, required=True, help="Folder for tracks and environments."
)
@click.option(
    "--python", default=sys.executable, help="Python that makes the environments."
)
@click.option(
    "--program",
    "only",
    multiple=True,
    type=click.Choice([*FILES]),
    help="By default all. Repeatable.",
)
def main(folder: Path, python: str, only: tuple[str, ...]) -> None:
    """Print a table of programs, files and tracks, and list what is wrong."""
    for name, (empty, options) in TRACKS.items():
        if not (folder / name / EXPECTED).exists():
            write_track(folder / name, empty, **options)
    cells = 0
    wrong = []
    names = [*TRACKS]
    click.echo(f"| {' | '.join(['program', 'file', *names])} |")
    click.echo("|---|---|" + len(names) * "---|")
    for program in only or FILES:
        command = installed(program, folder, python)
        results = {}
        for track in TRACKS:
            results[track] = dict(read(program, command, folder / track))
        for file in FILES[program]:
            marks = []
            for track in TRACKS:
                words = results[track][file]
                if words == NOT_OFFERED:
                    marks.append(words)
                    continue
                cells += 1
                if words:
                    wrong.append(f"{program}, {file}, {track}: {words}")
                marks.append("wrong" if words else "right")
            row = " | ".join([VERSIONS[program][0], file, *marks])
            click.echo(f"| {row} |")
    click.echo(f"\n{cells} cells, {len(wrong)} wrong\n")
    for words in wrong:
        click.echo(words)
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
