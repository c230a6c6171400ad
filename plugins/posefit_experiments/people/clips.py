"""The recorded clips that are followed, in groups: whoever moves in them is left out of the library.

What a clip shows was read off its pictures and the database's index. Frames are counted from the clip's first, at 30 a
second; an instance other than 0 begins elsewhere in the clip and turns the cameras by a few degrees.
"""

from typing import NamedTuple


class Clip(NamedTuple):
    """So many frames of an instance of a recorded clip."""

    name: str  # of `posefit motions`: the subject, and which of his clips
    frames: int
    instance: int
    shows: str

    @property
    def subject(self) -> str:
        """Whose clip it is."""
        return self.name.partition("_")[0]

    @property
    def library(self) -> str:
        """The library of everybody else."""
        return f"library:-{self.subject}"


WALKS, RUNS = "walks", "runs"
# The first few of a group are other people's, since a quick look takes only these. Runs of the database are short:
# most are over before two seconds are, and all that there is of them is followed.
GROUPS: dict[str, tuple[Clip, ...]] = {
    WALKS: (
        Clip("02_01", 86, 0, "walks straight"),
        Clip("05_01", 120, 0, "walks, veering right, toes first"),
        Clip("49_01", 130, 0, "walks straight, slowly"),
        Clip("16_15", 100, 0, "walks straight"),
        Clip("29_01", 80, 1, "walks straight, at a stroll"),
        Clip("09_12", 80, 0, "walks about, along an arc"),
        Clip("16_13", 100, 0, "walks, veering right"),
        Clip("16_22", 76, 0, "walks fast"),
        Clip("16_31", 100, 0, "walks straight"),
    ),
    RUNS: (
        Clip("09_01", 37, 0, "runs"),
        Clip("16_35", 41, 0, "jogs"),
        Clip("127_06", 44, 0, "runs, bent forward"),
        Clip("127_16", 65, 0, "runs and stops"),
        Clip("09_11", 42, 0, "runs"),
        Clip("16_37", 46, 0, "jogs, veering left"),
        Clip("16_42", 52, 0, "jogs, turns left"),
        Clip("127_03", 83, 0, "stands, then runs"),
    ),
    "jumps": (
        Clip("16_03", 100, 0, "jumps high"),
        Clip("49_04", 63, 0, "runs and leaps"),
        Clip("127_21", 89, 0, "runs, leaps and stops"),
        Clip("16_09", 120, 0, "jumps forward"),
        Clip("49_03", 100, 1, "hops on either foot"),
    ),
    "turns": (
        Clip("16_18", 120, 0, "walks and turns left"),
        Clip("29_01", 100, 6, "walks and turns round"),
        Clip("09_12", 100, 7, "walks and turns round"),
        Clip("16_20", 120, 0, "walks and turns right"),
        Clip("16_28", 66, 0, "walks fast and turns left"),
    ),
    "dances": (
        Clip("05_11", 120, 0, "steps aside, pirouette"),
        Clip("49_06", 121, 0, "cartwheel"),
        Clip("135_07", 120, 0, "kicks of a martial art"),
        Clip("05_05", 120, 0, "raises a leg, leaps and turns"),
        Clip("05_16", 130, 0, "leaps and turns"),
    ),
    "everyday": (
        Clip("02_06", 120, 1, "bends, scoops, lifts an arm"),
        Clip("14_13", 120, 1, "sweeps the floor"),
        Clip("17_03", 110, 0, "sneaks"),
        Clip("02_05", 120, 0, "punches"),
        Clip("14_30", 120, 0, "goes and sits down"),
    ),
}
