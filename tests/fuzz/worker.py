"""The process that reads inputs: each is read, refused with one line that names it, or anything else."""

import os
import random
import resource
import shutil
import signal
import tempfile
import traceback
import warnings
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from tests.fuzz import written
from tests.fuzz.corpus import Seed, corpus
from tests.fuzz.mutator import mutated

NAME = "subject"  # what every input is called, so that a message can be seen to name it
ADDRESSES = 6_000_000_000  # bytes of addresses that a child may have more than it has at first
CELLS = 2_000  # of a plan here: a million are allowed, and reading takes as long as there are cells
LONGEST = 400  # characters of a message
SECONDS = 10.0  # of CPU time for an input, as a busy machine gives a process little of it


class Answer(NamedTuple):
    """What came of an input."""

    outcome: str  # read, refused or unclean
    reader: str
    megabytes: int  # the largest memory of the process meanwhile
    what: str = ""


def readers(folder: Path) -> dict[str, Callable[[Path], object]]:
    """Return what reads each kind of file, as far as a user's file goes before anything is searched."""
    from posefit.footage.masks import Views
    from posefit.footage.readers import read_masks
    from posefit.footage.video import Video
    from posefit.geometry.calibration import read_calibrations, upright
    from posefit.motion.amc import read_amc
    from posefit.motion.asf import parse_asf
    from posefit.motion.bvh import read_bvh
    from posefit.sweep import plan

    skeleton = parse_asf(folder / "a.asf").skeleton
    plan.MAX_CELLS = CELLS

    def masks(path: Path) -> object:
        views = Views([read_masks(path, (None, None))])
        return [views[k] for k in range(min(len(views), 3))]

    def images(path: Path) -> object:
        room = path.parent / f"{NAME}-folder"
        room.mkdir()
        shutil.copy(path, room)
        return [one.silhouettes for one in Views([read_masks(room, (None, None))])]

    def calibration(path: Path) -> object:
        cameras = read_calibrations(path)
        cameras = [fit for camera in cameras if (fit := camera if camera.size else camera.padded((640, 480)))]
        alike = [camera for camera in cameras if camera.size and 3 * camera.size[0] == 4 * camera.size[1]]
        return [(camera.camera((64, 48), upright(cameras)), camera.maps((64, 48))) for camera in alike]

    def video(path: Path) -> object:
        filmed = Video.of(path)
        return filmed.warnings, [image.mean() for image in islice(filmed.frames(0, None, (64, 48)), 20)]

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
    one = rng.choice([each for each in seeds if each.reader == kinds[number % len(kinds)]])
    return one, mutated(rng, one.content, one.suffix, rng.choice(seeds).content)


def outcome(read: Callable[[Path], object], path: Path) -> tuple[str, str]:
    """Return whether a file was read, refused with one line that names it, or anything else, and what it was."""
    try:
        read(path)
    except ValueError as error:
        message = str(error)
        clean = NAME in message and "\n" not in message.strip() and len(message) < LONGEST
        return ("refused", "") if clean else ("unclean", f"{type(error).__name__}: {message[:500]}")
    except BaseException as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        return "unclean", f"{type(error).__name__}: {str(error)[:300]} ({place.filename}:{place.lineno})"
    return "read", ""


def peak() -> int:
    """Return the largest memory in MB since this was asked last."""
    lines = Path("/proc/self/status").read_text().splitlines()
    size = next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
    Path("/proc/self/clear_refs").write_text("5")
    return size // 1024


class Reader:
    """Reads the inputs of a seed; what is compiled or imported at first is not an input's."""

    def __init__(self, seed: int, kinds: str, folder: str) -> None:
        self.seed, self.folder = seed, Path(tempfile.mkdtemp(dir=folder))
        self.seeds = [valid for valid in corpus(self.folder) if not kinds or valid.reader in kinds.split(",")]
        self.readers = readers(self.folder)
        for valid in self.seeds:
            if (answer := self.read(valid, valid.content)).outcome != "read":
                raise RuntimeError(f"a valid file is not read: {answer}")

    def read(self, valid: Seed, content: bytes) -> Answer:
        """Return what came of what a valid file became."""
        path = self.folder / f"{NAME}{valid.suffix}"
        path.write_bytes(content)
        came, what = outcome(self.readers[valid.reader], path)
        for left in self.folder.glob(f"{NAME}*"):
            shutil.rmtree(left) if left.is_dir() else left.unlink()
        return Answer(came, valid.reader, peak(), what)


def start(seed: int, kinds: str, folder: str) -> None:
    """Make this process ready."""
    global reader
    warnings.simplefilter("ignore")
    reader = Reader(seed, kinds, folder)
    addresses = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (addresses + ADDRESSES, addresses + ADDRESSES))
    quiet = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):  # what libraries print
        os.dup2(quiet, stream)


def read(number: int) -> Answer:
    """Return what came of an input; one that takes too much time ends this process."""
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    answer = reader.read(*input_of(reader.seeds, reader.seed, number))
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    return answer
