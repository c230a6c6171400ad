"""Films of walks and runs in the folders of three data sets, as a user unpacks them; none of them may be passed on.

KTH's actions, Schuldt, Laptev and Caputo, ICPR 2004: `walking/person01_walking_d1_uncomp.avi`, 160 x 120 pixels, and
`00sequences.txt` with the frames that show the person. HumanEva-I, Sigal, Balan and Black, IJCV 2010: `S1/Image_Data/
Walking_1_(C1).avi` with `Calibration_Data`, `Sync_Data` and `Mocap_Data` beside `Image_Data`. CMU's motion capture
database: `16/16_15.mpg` with `16/16.asf`; its .avi shows an animated skeleton and counts only where there is no .mpg.

The layouts are those that public readers of these sets expect; the sets themselves were not at hand. The paper cites
the walks on H. Kjellström's page at KTH, whose format is unknown to us: a film made of them is read by itself.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.masks import Range, existing
from posefit.footage.video import Video
from posefit.geometry.calibration import Calibration
from posefit.reading import read_text
from posefit_reproduce.footage.humaneva import read_calibration, true_points

Activity = Literal["walk", "run"]
ACTIVITIES: dict[str, Activity] = {"walking": "walk", "jogging": "run", "jog": "run", "running": "run"}
_KTH = re.compile(r"(?P<name>person\d+_(?P<does>walking|jogging|running)_d\d)_uncomp\.avi", re.IGNORECASE)
_HUMANEVA = re.compile(r"(?P<trial>(?P<does>walking|jog)_\d+)_\((?P<camera>(?:c|bw)\d)\)\.avi", re.IGNORECASE)
_CMU = re.compile(r"(?P<subject>\d+)_\d+\.(?:mpg|avi)", re.IGNORECASE)
SEQUENCES = "00sequences.txt"
HUMANEVA_START = 5  # the first frames of its films are copies of one: a fault of their codec
LARGEST_TEXT = 1_000_000  # bytes


@dataclass(frozen=True, eq=False)
class Recording:
    """A film, and what its data set knows of it."""

    name: str
    film: Path
    frames: Range = (None, None)  # those that show the person
    calibration: Calibration | None = None
    skeleton: Path | None = None  # the person's own, an .asf file
    # gives HumanEva's true points (n, 18, 3) in metres in the first camera's world, of frames start to stop
    truth: Callable[[int, int], Array] | None = field(default=None, repr=False)


def films_in(path: str | Path, only: str = "") -> dict[Path, Activity | None]:
    """Return the films in a data set's folder, or a film by itself, and what their names say of them: walks or runs.

    In a folder, those with `only` in their path; HumanEva's grey cameras come last, as their masks are poorer. Raises
    InputError where there is none.
    """
    path = existing(Path(path))
    if path.is_file():
        return {path: None}
    films = sorted(film for film in path.rglob("*") if film.suffix.lower() in (".avi", ".mpg"))
    found: dict[Path, Activity | None] = {}
    for film in sorted(films, key=lambda film: "(BW" in film.name):
        if only in film.relative_to(path).as_posix() and (named := _named(film)):
            found[film] = ACTIVITIES.get(named.groupdict().get("does", "").lower())
    if not found:
        known = "walking/person01_walking_d1_uncomp.avi, S1/Image_Data/Walking_1_(C1).avi or 16/16_15.mpg"
        named_so = f" with {only!r} in their names" if only else ""
        raise InputError(f"{path}: expected films of walks or runs such as {known}{named_so}, got {len(films)} others")
    return found


def recording_of(film: Path) -> Recording:
    """Return a film with what its data set knows of it: nothing where its name is of no data set.

    Raises InputError where files that belong to it are missing or are not what they should be.
    """
    named = _named(film)
    if named is None:
        return Recording(film.stem, film)
    if named.re is _KTH:
        return Recording(named["name"], film, _kth_frames(film, named["name"]))
    if named.re is _HUMANEVA:
        return _humaneva(film, named["trial"], named["camera"])
    return Recording(film.stem, film, skeleton=existing(film.with_name(f"{named['subject']}.asf")))


def _named(film: Path) -> re.Match[str] | None:
    """Return how a film's name is that of a data set, or None."""
    if (named := _HUMANEVA.fullmatch(film.name)) and film.parent.name != "Image_Data":
        return None
    if film.suffix != ".mpg" and film.with_suffix(".mpg").exists():
        return None
    return named or _KTH.fullmatch(film.name) or _CMU.fullmatch(film.name)


def _kth_frames(film: Path, name: str) -> Range:
    """Return the first frames that show the person; the file counts from 1, and names the last one."""
    places = [film.parent / SEQUENCES, film.parent.parent / SEQUENCES]
    table = next((place for place in places if place.is_file()), places[1])
    text = read_text(existing(table), LARGEST_TEXT)
    line = re.search(rf"^\s*{re.escape(name)}\s+frames\s+(\d+)\s*-\s*(\d+)", text, re.MULTILINE | re.IGNORECASE)
    if line is None:
        raise InputError(f"{table}: expected a line such as '{name} frames 1-75, 120-190', got none")
    return int(line[1]) - 1, int(line[2])


def _humaneva(film: Path, trial: str, camera: str) -> Recording:
    subject = film.parent.parent
    calibration = read_calibration(subject / "Calibration_Data" / f"{camera}.cal", Video.of(film).size)
    mocap, truth = subject / "Mocap_Data" / f"{trial}.c3d", None
    if mocap.is_file():  # the trials of the test set have none
        measures, sync = mocap.with_name(f"{subject.name}.mp"), subject / "Sync_Data" / f"{trial}_({camera}).ofs"
        truth = true_points(mocap, measures, sync, calibration)
    name = f"{subject.name}_{trial}_{camera}"
    return Recording(name, film, (HUMANEVA_START, None), calibration, truth=truth)
