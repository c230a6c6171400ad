"""Does an optimiser speak the protocol: populations, box, feasibility, costs of every kind, budget, order?"""

import inspect
from typing import Any, Literal, get_args, get_origin

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Start
from posefit.settings import settings_of
from posefit.testing.case import REFUSALS, Evaluate, OptimiserCase, check_population, checklist, needs_settings
from posefit.testing.results import SkippedError, expect, refusal
from posefit.testing.toy import Toy, ball, shell, sphere

TURNS = 24  # populations after which costs that are right have to show


@checklist
def construction(case: OptimiserCase) -> None:
    """A factory takes the space, the generator and keyword-only settings."""
    kinds = [one.kind for one in inspect.signature(case.factory).parameters.values()]
    plain = [kind for kind in kinds if kind is not inspect.Parameter.KEYWORD_ONLY]
    expect(len(plain) == 2, f"a factory must take (space, rng) and keyword-only settings, got {len(plain)} others")
    expect(inspect.Parameter.VAR_KEYWORD not in kinds, "settings must be named, got **settings that swallow mistakes")
    case.build(Toy(9))


@checklist
def shape(case: OptimiserCase) -> str:
    """The method ask returns an array (n, d)."""
    proposals = case.build(Toy(9)).ask()
    expect(isinstance(proposals, np.ndarray), f"ask must return an array, got {type(proposals).__name__}")
    expect(proposals.ndim == 2 and proposals.shape[1] == 9, f"ask must return (n, 9), got {proposals.shape}")
    expect(len(proposals), "the first population must not be empty, got (0, 9)")
    return f"{len(proposals)} at a time"


@checklist
def dtype(case: OptimiserCase) -> None:
    """The method ask returns float64."""
    for proposals, _ in case.steps(case.build(Toy(9)), Toy(9), sphere, 4):
        expect(proposals.dtype == np.float64, f"ask must return float64, got {proposals.dtype}")


@checklist
def box(case: OptimiserCase) -> str:
    """Every proposal lies in [-1, 1]^d."""
    return case.valid(Toy(9), lambda x: -np.abs(x).sum(axis=1), 12)


@checklist
def periodic(case: OptimiserCase) -> str:
    """Coordinates that wrap around stay in the box too."""
    return case.valid(Toy(6, wrapping=2), lambda x: 1.0 - np.abs(x[:, 0]), 12)


@checklist
def feasible(case: OptimiserCase) -> str:
    """Every proposal is feasible where a third of the box is."""
    return case.valid(Toy(4, ball), lambda x: -x.sum(axis=1), 12)


@checklist
def hardly_feasible(case: OptimiserCase) -> str:
    """Every proposal is feasible, and none is waited for forever, where a few in a thousand are."""
    return case.valid(Toy(3, shell), sphere)


@checklist
def nan_costs(case: OptimiserCase) -> str:
    """Costs that are nan are survived."""
    return case.valid(Toy(9, ball), lambda x: np.where(np.arange(len(x)) % 2, np.nan, sphere(x)))


@checklist
def only_nan_costs(case: OptimiserCase) -> str:
    """A population whose costs are all nan is survived."""
    return case.valid(Toy(9, ball), lambda x: np.full(len(x), np.nan))


@checklist
def infinite_costs(case: OptimiserCase) -> str:
    """Costs of +inf are survived, one or all."""
    case.valid(Toy(9, ball), lambda x: np.full(len(x), np.inf))
    return case.valid(Toy(9, ball), lambda x: np.where(np.arange(len(x)) % 3, np.inf, sphere(x)))


@checklist
def equal_costs(case: OptimiserCase) -> str:
    """Costs that are all equal are survived."""
    return case.valid(Toy(9, ball), lambda x: np.zeros(len(x)))


@checklist
def huge_costs(case: OptimiserCase) -> str:
    """Costs as large as 1e300 are survived."""
    return case.valid(Toy(9, ball), lambda x: 1e300 * sphere(x))


@checklist
def budget(case: OptimiserCase) -> str:
    """A search uses its budget, in whole populations."""
    wanted = 400
    used, optimiser = 0, case.build(Toy(9), evaluations=wanted)
    while len(proposals := optimiser.ask()) and used + len(proposals) <= wanted:
        optimiser.tell(proposals, sphere(proposals))
        used += len(proposals)
    expect(used >= 0.75 * wanted, f"a search must use most of its budget of {wanted}, got {used}")
    return f"{used} of {wanted} evaluations"


@checklist
def order(case: OptimiserCase) -> str:
    """The cost of row i belongs to proposal i."""
    shuffled = np.random.default_rng(1)

    def spoilt(x: Array) -> Array:
        return shuffled.permutation(sphere(x))

    def last(evaluate: Evaluate, seed: int) -> float:
        costs = [
            sphere(proposals).mean() for proposals, _ in case.steps(case.build(Toy(4), seed), Toy(4), evaluate, TURNS)
        ]
        return float(np.mean(costs[len(costs) // 2 :]))

    seeds = range(3)
    good, bad = ([last(evaluate, seed) for seed in seeds] for evaluate in (sphere, spoilt))
    if good == bad:
        raise SkippedError("it does not heed the costs, or has one proposal at a time")
    expect(
        np.median(good) < 0.8 * np.median(bad),
        f"true costs must help more than shuffled ones, got mean costs {np.median(good):.3g} and {np.median(bad):.3g}",
    )
    return f"mean cost {np.median(good):.3g}, shuffled {np.median(bad):.3g}"


@checklist
def tell_without_ask(case: OptimiserCase) -> str:
    """A population that is told once more, without an ask, is refused or harmless."""
    space = Toy(9)
    optimiser = case.build(space)
    proposals = optimiser.ask()
    costs = sphere(proposals)
    optimiser.tell(proposals.copy(), costs.copy())
    with refusal(*REFUSALS) as refused:
        optimiser.tell(proposals, costs)
    for more, _ in case.steps(optimiser, space, sphere, 3):
        check_population(more, space)
    return "refused" if refused else "harmless"


@checklist
def ask_twice(case: OptimiserCase) -> str:
    """A second ask before the tell is refused or harmless."""
    space = Toy(9)
    optimiser = case.build(space)
    proposals = optimiser.ask()
    with refusal(*REFUSALS) as refused:
        proposals = optimiser.ask()
        check_population(proposals, space)
        expect(len(proposals), "a second ask must return a population, got an empty one")
    optimiser.tell(proposals, sphere(proposals))
    for more, _ in case.steps(optimiser, space, sphere, 3):
        check_population(more, space)
    return "refused" if refused else "harmless"


@checklist
def one_dimension(case: OptimiserCase) -> str:
    """A space of one dimension is searched."""
    return case.valid(Toy(1), sphere)


@checklist
def many_dimensions(case: OptimiserCase) -> str:
    """A space of 66 dimensions is searched."""
    return case.valid(Toy(66), sphere)


@checklist
def edge(case: OptimiserCase) -> str:
    """A start on the edge of the box is survived."""
    start = Start(np.ones(5), np.full(5, 0.5), np.full(5, 0.3))
    return case.valid(Toy(5, start=start), sphere)


@checklist
def unknown_setting(case: OptimiserCase) -> None:
    """A setting that does not exist is refused."""
    try:
        case.build(Toy(9), no_such_setting=1)
    except TypeError:
        return
    expect(False, "an unknown setting must raise TypeError, got an optimiser")


@checklist
def nonsense_settings(case: OptimiserCase) -> str:
    """Nonsense in a setting is refused or harmless."""
    needs_settings(case)
    refused: list[str] = []
    harmless: list[str] = []
    for setting in settings_of(case.factory):
        kind = setting.annotation if setting.annotation is not inspect.Parameter.empty else type(setting.default)
        nonsense: object
        if kind is int:
            nonsense = -1
        elif kind is float:
            nonsense = float("nan")
        elif get_origin(kind) is Literal or setting.name == "variant":
            nonsense = "no such choice"
        else:
            continue
        assert nonsense not in get_args(kind)
        nonsensical: dict[str, Any] = {setting.name: nonsense}
        with refusal(ValueError) as refusals:
            for proposals, _ in case.steps(case.build(Toy(5), **nonsensical), Toy(5), sphere, 3):
                check_population(proposals, Toy(5))
        (refused if refusals else harmless).append(setting.name)
    return f"refused: {', '.join(refused) or 'none'}" + (f"; harmless: {', '.join(harmless)}" if harmless else "")
