"""The map of the equations: every tag in the code, its line, and its tests."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
SOURCES = {
    "SAPSO": "Li, Sun, Chen and Li, Acta Automatica Sinica 38(5), 2012",
    "VSMM": "Patent application CN101894278, 2010",
    "KENNEDY1995": "Kennedy and Eberhart, Particle swarm optimization, 1995",
    "CLERC2002": (
        "Clerc and Kennedy, The particle swarm: explosion, stability and "
        "convergence, 2002"
    ),
    "GORDON1993": (
        "Gordon, Salmond and Smith, Novel approach to nonlinear/non-Gaussian "
        "Bayesian state estimation, 1993"
    ),
    "DEUTSCHER2005": (
        "Deutscher and Reid, Articulated body motion capture by stochastic search, 2005"
    ),
    "HANSEN2016": "Hansen, The CMA evolution strategy: a tutorial, 2016",
    "AUGER2005": (
        "Auger and Hansen, A restart CMA evolution strategy with increasing "
        "population size, 2005"
    ),
    "TOYAMA2001": "Toyama and Blake, Probabilistic tracking in a metric space, 2001",
    "RABINER1989": (
        "Rabiner, A tutorial on hidden Markov models and selected applications in "
        "speech recognition, 1989"
    ),
    "GODSILL2004": (
        "Godsill, Doucet and West, Monte Carlo smoothing for nonlinear time series, "
        "2004"
    ),
    "JOHN2010": (
        "John, Trucco and Ivekovic, Markerless human articulated tracking using "
        "hierarchical particle swarm optimisation, 2010"
    ),
    "ZHAO2008": (
        "Zhao and Liu, Generative tracking of 3D human motion by hierarchical "
        "annealed genetic algorithm, 2008"
    ),
    "KRZESZOWSKI2010": (
        "Krzeszowski, Kwolek and Wojciechowski, Articulated body motion tracking by "
        "combined particle swarm optimization and particle filtering, 2010"
    ),
    "GAVRILA1996": (
        "Gavrila and Davis, 3-D model-based tracking of humans in action: a "
        "multi-view approach, 1996"
    ),
    "PEURSUM2010": (
        "Peursum, Venkatesh and West, A study on smoothing for particle-filtered 3D "
        "human body tracking, 2010"
    ),
    "WACHTER1999": (
        "Wachter and Nagel, Tracking persons in monocular image sequences, 1999"
    ),
    "AGARWAL2006": (
        "Agarwal and Triggs, Recovering 3D human pose from monocular images, 2006"
    ),
    "WANG2003": (
        "Wang, Xu and Ai, Learning object intrinsic structure for robust visual "
        "tracking, 2003"
    ),
    "URTASUN2005": (
        "Urtasun, Fleet, Hertzmann and Fua, Priors for people tracking from small "
        "training sets, 2005"
    ),
    "GROOD1983": (
        "Grood and Suntay, A joint coordinate system for the clinical description of "
        "motions: the knee, 1983"
    ),
    "WU2002": (
        "Wu et al., ISB recommendation on definitions of joint coordinate systems: "
        "ankle, hip and spine, 2002"
    ),
    "WU2005": (
        "Wu et al., ISB recommendation on definitions of joint coordinate systems: "
        "upper limb, 2005"
    ),
    "ZENI2008": (
        "Zeni, Richards and Higginson, Two simple methods for determining gait "
        "events, 2008"
    ),
    "WHITTLE2007": "Whittle, Gait analysis: an introduction, 2007",
    "ALEXANDER1989": (
        "Alexander, Optimization and gaits in the locomotion of vertebrates, 1989"
    ),
}
_TAG = re.compile(
    r"# (?P<source>SAPSO|VSMM|[A-Z]+\d{4}) (?P<step>.+?)(?:, Interpretation S\d+)?$"
)
_WORDS = re.compile(r"[^a-z0-9]+")
# a test, with the comment on the line before it or at the end of its line
_TEST = re.compile(
    r"^(?:# (?P<before>.*)\n)?"
    r"def (?P<name>test_\w+)\([^#\n]*\n?[^#\n]*?(?:  # (?P<after>.*))?$",
    re.MULTILINE,
)


class Tag(NamedTuple):
    """One equation or step, and its place in the code."""

    source: str
    step: str
    path: str
    line: int  # of the code, from 1
    code: str


def page() -> str:
    """Return a list of tags for each source, as Markdown."""
    ordered = sorted(tags(), key=lambda tag: _key(tag.step))
    parts = []
    for source, title in SOURCES.items():
        entries = []
        for tag in ordered:
            if tag.source == source:
                names = ", ".join(f"`{name}`" for name in tests_of(tag))
                entries.append(f"- `{tag.step}` `{tag.path}`: {names}")
        parts += [f"## {source}", f"{title}.", "\n".join(entries)]
    return "\n\n".join(parts) + "\n"


def tags() -> Iterator[Tag]:
    """Yield every tag in posefit and its plugins."""
    for folder in ("posefit", "plugins"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            lines = path.read_text("utf-8").splitlines()
            for number, line in enumerate(lines, 1):
                match = _TAG.search(line)
                if match is None:
                    continue
                # a tag on a separate line belongs to the next line
                at = number if line[: match.start()].strip() else number + 1
                code = lines[at - 1].partition("  # ")[0].strip()
                yield Tag(
                    match["source"],
                    match["step"],
                    str(path.relative_to(ROOT)),
                    at,
                    code,
                )


def tests_of(tag: Tag) -> list[str]:
    """Return the tests of a tag, as FILE::NAME.

    They carry the tag, or are named after the paper's equation or step.
    """
    names = []
    for path in sorted((ROOT / "tests" / "sources").glob("test_*.py")):
        for one in _TEST.finditer(path.read_text("utf-8")):
            carries = f"{tag.source} {tag.step}" in (one["before"], one["after"])
            if carries or (
                path.name == f"test_{tag.source.lower()}.py"
                and _is_named_after(one["name"], tag.step)
            ):
                names.append(f"{path.name}::{one['name']}")
    return names


def _is_named_after(test: str, step: str) -> bool:
    """Return whether a test is named after a step of the SAPSO paper.

    eq_4 is named after (4), and 2_1_3_..._recovery after 2.1.3 recovery.
    """
    if step.isalpha():
        return f"_{step}_" in test
    number, _, word = step.lower().partition(" ")
    number = f"eq{number}" if step.startswith("(") else number
    place = f"_{_WORDS.sub('_', number).strip('_')}_"
    # of velocity, also velocities
    stem = word[:6] if word.isalpha() else word.replace(" ", "_")
    return place in f"{test}_" and stem in test


def _key(step: str) -> list[tuple[int, int, str]]:
    """Return a sort key that orders steps by number: (2) before (10)."""
    return [
        (0, int(part), "") if part.isdigit() else (1, 0, part)
        for part in re.findall(r"\d+|[^\d]+", step)
    ]
