"""The child process: reads inputs one after the other, and says of each on stdout what came of it.

A line is `NUMBER begun`, and then `NUMBER OUTCOME MEGABYTES [WHAT]` as JSON; OUTCOME is read, refused or unclean.
"""

import json
import os
import random
import resource
import shutil
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from itertools import islice
from pathlib import Path

from tests.fuzz import written
from tests.fuzz.corpus import Seed, corpus
from tests.fuzz.mutator import mutated

NAME = "subject"  # what every input is called, so that a message can be seen to name it
# bytes of addresses that a child may have more than it has at first
ADDRESSES = 6_000_000_000
# of a plan here: a million are allowed, and reading takes as long as there are cells
CELLS = 2_000
LONGEST = 400  # characters of a message


def readers(folder: Path) -> dict[str, Callable[[Path], object]]:
    """Return what reads each kind of file, as far as a user's file goes before anything is searched."""
    from posefit.footage.kinds import resolve
    from posefit.footage.observations import Observations
    from posefit.footage.source import views_of_masks
    from posefit.footage.video import Video
    from posefit.geometry.calibration import read_calibrations, upright
    from posefit.motion.amc import read_amc
    from posefit.motion.asf import parse_asf
    from posefit.motion.bvh import read_bvh
    from posefit.sweep import plan

    skeleton = parse_asf(folder / "a.asf").skeleton
    plan.MAX_CELLS = CELLS

    def masks(path: Path) -> object:
        views = Observations(views_of_masks(resolve(path)))
        return [views[k] for k in range(min(len(views), 3))]

    def images(path: Path) -> object:
        room = path.parent / f"{NAME}-folder"
        room.mkdir()
        shutil.copy(path, room)
        return [one.silhouettes for one in Observations(views_of_masks(resolve(room)))]

    def calibration(path: Path) -> object:
        cameras = read_calibrations(path)
        cameras = [
            fit
            for camera in cameras
            if (fit := camera if camera.size else camera.padded((640, 480)))
        ]
        alike = [
            camera
            for camera in cameras
            if camera.size and 3 * camera.size[0] == 4 * camera.size[1]
        ]
        return [
            (camera.camera((64, 48), upright(cameras)), camera.maps((64, 48)))
            for camera in alike
        ]

    def video(path: Path) -> object:
        filmed = Video.of(path, 64)
        return filmed.warnings, [image.mean() for image in islice(filmed.frames(), 20)]

    return {
        "asf": parse_asf,
        "amc": lambda path: read_amc(path, skeleton).resampled(30.0),
        "bvh": lambda path: read_bvh(path).resampled(30.0),
        "masks": masks,
        "images": images,
        "calibration": calibration,
        "video": video,
        "plan": plan.Plan.read,
        **written.readers(),
    }


def input_of(seeds: list[Seed], seed: int, number: int) -> tuple[Seed, bytes]:
    """Return the valid file that an input was, and what it became."""
    rng = random.Random(f"{seed}/{number}")
    kinds = sorted({one.reader for one in seeds})
    one = rng.choice(
        [each for each in seeds if each.reader == kinds[number % len(kinds)]]
    )
    return one, mutated(rng, one.content, one.suffix, rng.choice(seeds).content)


def outcome(read: Callable[[Path], object], path: Path) -> tuple[str, str]:
    """Return whether a file was read, refused with one line that names it, or anything else, and what it was."""
    try:
        read(path)
    except ValueError as error:
        message = str(error)
        clean = (
            NAME in message and "\n" not in message.strip() and len(message) < LONGEST
        )
        return (
            ("refused", "")
            if clean
            else ("unclean", f"{type(error).__name__}: {message[:500]}")
        )
    except BaseException as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return (
            "unclean",
            f"{type(error).__name__}: {str(error)[:300]} ({place.filename}:{place.lineno})",
        )
    return "read", ""


def peak() -> int:
    """Return the largest memory in MB since this was asked last."""
    with open("/proc/self/status", encoding="ascii") as file:
        size = next(int(line.split()[1]) for line in file if line.startswith("VmHWM"))
    with open("/proc/self/clear_refs", "w", encoding="ascii") as file:
        file.write("5")
    return size // 1024


def main(seed: int, numbers: range, kinds: str) -> None:
    """Read inputs."""
    say = os.fdopen(os.dup(1), "w", buffering=1)
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        seeds = [
            one for one in corpus(folder) if not kinds or one.reader in kinds.split(",")
        ]
        known = readers(folder)
        for one in seeds:  # what is compiled or imported at first is not an input's
            (folder / f"{NAME}{one.suffix}").write_bytes(one.content)
            how, what = outcome(known[one.reader], folder / f"{NAME}{one.suffix}")
            assert how == "read", (one.reader, one.suffix, what)
            _clear(folder)
        with open("/proc/self/statm", encoding="ascii") as file:
            addresses = int(file.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(
            resource.RLIMIT_AS, (addresses + ADDRESSES, addresses + ADDRESSES)
        )
        peak()
        quiet = os.open(os.devnull, os.O_WRONLY)
        for stream in (1, 2):  # what libraries print is no part of the answer
            os.dup2(quiet, stream)
        for number in numbers:
            print(f"{number} begun", file=say)
            one, content = input_of(seeds, seed, number)
            path = folder / f"{NAME}{one.suffix}"
            path.write_bytes(content)
            how, what = outcome(known[one.reader], path)
            print(number, json.dumps([how, one.reader, peak(), what]), file=say)
            _clear(folder)


def _clear(folder: Path) -> None:
    for path in folder.glob(f"{NAME}*"):
        shutil.rmtree(path) if path.is_dir() else path.unlink()


if __name__ == "__main__":
    main(int(sys.argv[1]), range(int(sys.argv[2]), int(sys.argv[3])), sys.argv[4])
