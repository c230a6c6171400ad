"""What is compared: environments, agents, budgets of training, and held-out instances."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from posefit_envs.configure import ITERATIONS, POPULATION_SIZE
from posefit_envs.configuring.single import EVERY
from posefit_envs.fit import MAX_EVALUATIONS

HELD_OUT = 10_000  # the first instance of the test split
INSTANCES, SEEDS, STEPS = 40, 5, 20_000
QUICK_INSTANCES, QUICK_STEPS = 4, 300
CURVE = 5  # looks at an agent while it learns
CURVE_INSTANCES = 16  # that each look takes, the first of those held out
STRONGEST, BEST_KNOWN_EVALUATIONS = "cma", 24_400  # the method, and its budget, for what is best known
UNTRAINED = 0  # steps of training of a reference


@dataclass(frozen=True)
class Contested:
    """An environment, the budget of its episodes in evaluations and in steps, and who plays it."""

    name: str
    evaluations: int
    length: int  # steps of an episode
    references: tuple[str, ...]  # not trained
    learners: tuple[str, ...]


CONFIGURE = Contested(
    "posefit/Configure-v1",
    POPULATION_SIZE * (ITERATIONS + 1),
    ITERATIONS // EVERY,
    ("random search", "random actions", "middle", "sapso"),
    ("bandit", "cma over constants", "ppo", "sac"),
)
FIT = Contested(
    "posefit/Fit-v1",
    MAX_EVALUATIONS,
    MAX_EVALUATIONS - 1,
    ("random search", "random actions", "gaussian", "sapso", "cma"),
    ("bandit", "cma over constants", "ppo", "sac"),
)
TASKS = {"configure": CONFIGURE, "fit": FIT}


class Training(NamedTuple):
    """One row: an agent in an environment, a seed of its training and evaluation, and the steps it is asked to take."""

    task: str
    agent: str
    seed: int
    steps: int
    instances: int


def agent_turns(
    tasks: tuple[str, ...], agents: tuple[str, ...], seeds: int, steps: int, instances: int
) -> list[Training]:
    """Return the rows that are asked for, of each agent that a task has."""
    turns = []
    for name in tasks:
        task = TASKS[name]
        for seed in range(seeds):
            for agent in (*task.references, *task.learners):
                if not agents or agent in agents or agent == "random search":
                    trained = steps if agent in task.learners else UNTRAINED
                    turns.append(Training(name, agent, seed, trained, instances))
    return turns


def check_design(tasks: tuple[str, ...], agents: tuple[str, ...], numbers: dict[str, Any]) -> None:
    """Return nothing. Raises ValueError where there is no such environment or agent, or a number makes no sense."""
    for task in tasks:
        if task not in TASKS:
            raise ValueError(f"environment must be one of {', '.join(TASKS)}, got {task!r}")
    known = dict.fromkeys(agent for task in tasks for agent in (*TASKS[task].references, *TASKS[task].learners))
    for agent in agents:
        if agent not in known:
            raise ValueError(f"agent must be one of {', '.join(known)}, got {agent!r}")
    for name, value in numbers.items():
        if value < 1:
            raise ValueError(f"{name} must be at least 1, got {value}")
    if numbers["instances"] > HELD_OUT:
        raise ValueError(f"instances must be at most {HELD_OUT}, got {numbers['instances']}")
