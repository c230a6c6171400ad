"""Every equation and step that an optimiser takes from a publication has one home, and a test of its name."""

import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[2]
TAGS = (
    "KENNEDY1995 (pbest, gbest)",
    "KENNEDY1995 (velocity)",
    "CLERC2002 (constriction)",
    "CLERC2002 (velocity)",
    "GORDON1993 (likelihood)",
    "GORDON1993 (resampling)",
    "GORDON1993 (motion)",
    "DEUTSCHER2005 (survival)",
    "DEUTSCHER2005 (beta)",
    "DEUTSCHER2005 (diffusion)",
    "DEUTSCHER2005 (crossover)",
    "DEUTSCHER2005 (next frame)",
    "HANSEN2016 (8)",
    "HANSEN2016 (38)",
    "HANSEN2016 (39)",
    "HANSEN2016 (40)",
    "HANSEN2016 (41)",
    "HANSEN2016 (42)",
    "HANSEN2016 (43)",
    "HANSEN2016 (44)",
    "HANSEN2016 (45)",
    "HANSEN2016 (46)",
    "HANSEN2016 (47)",
    "HANSEN2016 (48)",
    "HANSEN2016 (49)",
    "HANSEN2016 (50)",
    "HANSEN2016 (51)",
    "HANSEN2016 (52)",
    "HANSEN2016 (53)",
    "HANSEN2016 (55)",
    "HANSEN2016 (56)",
    "HANSEN2016 (57)",
    "HANSEN2016 (58)",
    "HANSEN2016 (B.2)",
    "HANSEN2016 (B.3)",
    "HANSEN2016 (chi)",
    "HANSEN2016 (h_sigma)",
    "AUGER2005 (restart)",
    "TOYAMA2001 (exemplars)",
    "TOYAMA2001 (likelihood)",
    "TOYAMA2001 (dynamics)",
    "RABINER1989 (forward)",
    "RABINER1989 (backward)",
    "RABINER1989 (Viterbi)",
    "URSEM1999 (hill valley)",
    "MAREE2018 (edge length)",
    "MAREE2018 (nearest better)",
    "MAREE2018 (test points)",
    "DAU2022 (exponent)",
    "DAU2022 (normalising constant)",
    "DAU2022 (random walk)",
    "DAU2022 (waste-free)",
    "GODSILL2004 (messages)",
    "GODSILL2004 (step)",
    "DUNN2023 (pooled CDF)",
    "GUO2017 (3)",
    "CEC2013 (peak ratio)",
    "BRIER1950 (score)",
    "GROOD1983 (joint coordinate system)",
    "GROOD1983 (knee)",
    "WU2002 (hip)",
    "WU2002 (ankle)",
    "WU2005 (shoulder)",
    "WU2005 (elbow)",
    "ZENI2008 (heel strike)",
    "ZENI2008 (toe off)",
    "WHITTLE2007 (cadence)",
    "WHITTLE2007 (stance)",
    "WHITTLE2007 (step length)",
    "WHITTLE2007 (speed)",
    "ALEXANDER1989 (Froude number)",
    "VSMM 1.3",
    "VSMM 1.4",
    "VSMM 2.1",
    "VSMM 2.2",
    "VSMM 2.3",
    "VSMM 2.4",
    "VSMM 2.5",
    "VSMM 2.6",
    "VSMM 2.7",
    "VSMM 3",
    "VSMM 4",
    "VSMM 5",
    "VSMM 6.1",
    "VSMM 6.2a",
    "VSMM 6.2b",
    "VSMM 6.3a",
    "VSMM 6.3b",
    "VSMM 6.3c",
    "VSMM 6.3d",
    "VSMM 6.4",
    "VSMM 6.5",
    "VSMM 7a",
    "VSMM 7b",
    "VSMM 7c",
    "VSMM 8.1",
    "VSMM 8.2",
    "VSMM 8.3",
    "VSMM 8.4",
    "VSMM 9",
)


def lines() -> list[str]:
    paths = [path for folder in ("posefit", "plugins") for path in sorted((ROOT / folder).rglob("*.py"))]
    return [line for path in paths for line in path.read_text("utf-8").splitlines()]


def test_a_tag_has_one_home_and_a_test() -> None:
    homes = Counter(match[1] for line in lines() if (match := re.search(r"# ([A-Z]+(?:\d{4})? .*)$", line)))
    tests = "".join(
        path.read_text("utf-8")
        for path in (ROOT / "tests" / "sources").glob("test_*.py")
        if path.name != Path(__file__).name
    )
    for tag in TAGS:
        assert homes[tag] == 1, tag
        assert re.search(rf"def test_.*\n?.*# {re.escape(tag)}", tests), tag


def test_no_tag_is_missing_from_this_list() -> None:
    found = {match[1] for line in lines() if (match := re.search(r"# ([A-Z]+\d{4} \(.*\)|VSMM .*)$", line))}
    assert found == set(TAGS)
