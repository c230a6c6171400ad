"""The recorded clips that are followed, in groups: whoever moves in them is left out of the library.

What a clip shows was read off its pictures and the database's index; 16_15 and 16_28 are not among them, since an arm
jumps in their first frames. Frames are counted from the clip's first, at 30 a second; an instance other than 0 begins
elsewhere in the clip and turns the cameras by a few degrees.
"""

from typing import NamedTuple


class Piece(NamedTuple):
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
GROUPS: dict[str, tuple[Piece, ...]] = {
    WALKS: (
        Piece("02_01", 86, 0, "walks straight"),
        Piece("05_01", 120, 0, "walks, veering right, toes first"),
        Piece("49_01", 130, 0, "walks straight, slowly"),
        Piece("16_16", 100, 0, "walks straight"),
        Piece("29_01", 80, 1, "walks straight, at a stroll"),
        Piece("09_12", 80, 0, "walks about, along an arc"),
        Piece("16_13", 100, 0, "walks, veering right"),
        Piece("16_22", 76, 0, "walks fast"),
        Piece("16_31", 100, 0, "walks straight"),
    ),
    RUNS: (
        Piece("09_01", 37, 0, "runs"),
        Piece("16_35", 41, 0, "jogs"),
        Piece("127_06", 44, 0, "runs, bent forward"),
        Piece("127_16", 65, 0, "runs and stops"),
        Piece("09_11", 42, 0, "runs"),
        Piece("16_37", 46, 0, "jogs, veering left"),
        Piece("16_42", 52, 0, "jogs, turns left"),
        Piece("127_03", 83, 0, "stands, then runs"),
    ),
    "jumps": (
        Piece("16_03", 100, 0, "jumps high"),
        Piece("49_04", 63, 0, "runs and leaps"),
        Piece("127_21", 89, 0, "runs, leaps and stops"),
        Piece("16_09", 120, 0, "jumps forward"),
        Piece("49_03", 100, 1, "hops on either foot"),
    ),
    "turns": (
        Piece("16_18", 120, 0, "walks and turns left"),
        Piece("29_01", 100, 6, "walks and turns round"),
        Piece("09_12", 100, 7, "walks and turns round"),
        Piece("16_20", 120, 0, "walks and turns right"),
        Piece("16_27", 61, 0, "walks fast and turns left"),
    ),
    "dances": (
        Piece("05_11", 120, 0, "steps aside, pirouette"),
        Piece("49_06", 121, 0, "cartwheel"),
        Piece("135_07", 120, 0, "kicks of a martial art"),
        Piece("05_05", 120, 0, "raises a leg, leaps and turns"),
        Piece("05_16", 130, 0, "leaps and turns"),
    ),
    "everyday": (
        Piece("02_06", 120, 1, "bends, scoops, lifts an arm"),
        Piece("14_13", 120, 1, "sweeps the floor"),
        Piece("17_03", 110, 0, "sneaks"),
        Piece("02_05", 120, 0, "punches"),
        Piece("14_30", 120, 0, "goes and sits down"),
    ),
}
