"""Problems of the suite for IOH-BLADE, in which language models design optimisers.

N. van Stein et al., BLADE: benchmark suite for LLM-driven automated design and evolution of iterative optimisation
heuristics, GECCO companion, 2025.
"""

import inspect
from collections.abc import Sequence
from contextlib import suppress
from itertools import product
from typing import Any, final

import ioh
import iohblade
import numpy as np
from iohblade.tags import NoiseType, PrimaryCategories, VariableType

from posefit.suites.functions import FUNCTIONS, HELD_OUT, SUITE, TRAINING
from posefit.suites.problem import EVALUATIONS, TARGETS, suite

Address = tuple[int, int, int]  # function, instance and dimension
EXACT = [one.number for one in FUNCTIONS if one.exact and not one.noisy and 9 in one.dimensions]

TASK = """
You are a Python expert who designs a new optimisation algorithm. You can use numpy v2 and the standard library.
`func(x)` draws a person's body in the pose `x` and returns by how much it differs from a silhouette, 100 down to 0.
The search space is [-1, 1]^dim; what is not feasible there costs what its repair costs. There are plateaus, many
local minima, and poses that look nearly the same. Write a class with `__init__(self, budget, dim)` and
`__call__(self, func)`, which minimises `func` in at most `self.budget` calls, and returns the lowest value and its `x`.
"""
EXAMPLE = """
A random search, for example:
```python
class RandomSearch:
    def __init__(self, budget=900, dim=9):
        self.budget, self.dim = budget, dim
    def __call__(self, func):
        proposals = np.random.uniform(func.bounds.lb, func.bounds.ub, (self.budget, self.dim))
        costs = [func(x) for x in proposals]
        return min(costs), proposals[np.argmin(costs)]
```
"""
FORMAT = "\nAnswer in this form:\n# Description: <its main idea in one line>\n# Code:\n```python\n<code>\n```\n"


@final
class Problem(iohblade.Problem):
    """Numbers of problems on which an algorithm is scored by the mean of its AOCC, the higher the better, 1 at most.

    AOCC is that of BLADE, over `budget_factor` evaluations for each dimension, with costs on a logarithmic scale
    between the suite's first target, 32, and its last, 0.25. What is not feasible costs what its repair costs.
    """

    def __init__(
        self,
        logger: Any = None,
        training_instances: Sequence[Address] = tuple(product(EXACT, TRAINING[:5], [9])),
        test_instances: Sequence[Address] = tuple(product(EXACT, HELD_OUT[:15], [9])),
        budget_factor: int = EVALUATIONS,
    ) -> None:
        instances = list(training_instances), list(test_instances)
        super().__init__(logger, *instances, "posefit", eval_timeout=600, dependencies=["posefit[ioh]"])
        self.budget_factor = budget_factor
        self.task_prompt, self.example_prompt, self.format_prompt = TASK, EXAMPLE, FORMAT

    def evaluate(self, solution: iohblade.Solution, test: bool = False) -> iohblade.Solution:
        """Return the solution with its scores on the problems to train or to test on. Raises what its code raises."""
        names: dict[str, Any] = {"np": np}
        exec(solution.code, names)
        scores = []
        for function, instance, dimension in self.test_instances if test else self.training_instances:
            problem, budget = suite(SUITE, function, instance, dimension).ioh(), self.budget_factor * dimension
            logger = iohblade.aoc_logger(budget, TARGETS[-1], TARGETS[0], triggers=[ioh.logger.trigger.ALWAYS])
            problem.attach_logger(logger)
            with suppress(iohblade.OverBudgetException):
                names[solution.name](budget=budget, dim=dimension)(problem)
            scores.append(float(iohblade.correct_aoc(problem, logger, budget)))
        solution.add_metadata("aucs", scores)
        mean = float(np.mean(scores))
        solution.set_scores(mean, f"{solution.name} scored an AOCC of {mean:.3f}; 1 is the best.")
        return solution

    def test(self, solution: iohblade.Solution) -> iohblade.Solution:
        """Return the solution with its scores on the problems to test on."""
        return self.evaluate(solution, test=True)

    def to_dict(self) -> dict[str, Any]:
        """Return what the problem was made of."""
        return {name: getattr(self, name) for name in ("name", "training_instances", "test_instances", "budget_factor")}

    def get_config(self) -> dict[str, Any]:
        """Return what BLADE logs."""
        return {
            "tags": [PrimaryCategories.BBO, NoiseType.NOISELESS, VariableType.CONTINUOUS],
            "name": self.name,
            "prompt": self.get_prompt(),
            "minimisation": False,
            "evaluator": inspect.getsource(self.evaluate),
            "config": self.to_dict(),
        }
