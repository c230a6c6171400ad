"""Problems of the suite for MetaBox, in numpy and in torch, and its data sets to train and to test on.

Z. Ma et al., MetaBox-v2: a unified benchmark platform for meta-black-box optimization, 2025, arXiv 2505.17745.
"""

from collections.abc import Sequence
from typing import Any, Literal, final

import numpy as np
import torch
from metaevobox.environment.problem.basic_problem import Basic_Problem, Basic_Problem_Torch

from posefit.fitting.check import one_of
from posefit.suites import problem as suites
from posefit.suites.functions import FUNCTIONS, HELD_OUT, SUITE, TRAINING


class Problem(Basic_Problem):
    """A problem in the box from -1 to 1, with the optimum 0 or, where it is unknown, None; its name is its id.

    What is not feasible costs what `problem` makes of it, by default what its repair costs.
    """

    lb, ub = -1.0, 1.0
    T1 = 0.0  # milliseconds of evaluations, which MetaBox counts

    def __init__(self, problem: suites.Problem) -> None:
        self.problem, self.dim, self.optimum = problem, problem.dimension, problem.optimum

    def __str__(self) -> str:
        return self.problem.id

    def reset(self) -> None:
        """Forget all evaluations, here and of `problem`."""
        super().reset()
        self.problem.reset()

    def func(self, x: Any) -> Any:
        """Return the costs (n,) of a population (n, d)."""
        return self.problem.evaluate(x)


@final
class TorchProblem(Problem, Basic_Problem_Torch):
    """The same of tensors."""

    def func(self, x: torch.Tensor) -> Any:
        """Return the costs (n,) of a population (n, d), on its device and in its precision."""
        return super().func(x.detach())


@final
class Dataset(torch.utils.data.Dataset[list[Problem]]):
    """Problems in batches."""

    def __init__(self, data: Sequence[Problem], batch_size: int = 1) -> None:
        self.data, self.batch_size, self.N = list(data), batch_size, len(data)
        self.ptr, self.index = range(0, self.N, batch_size), np.arange(self.N)
        self.maxdim = max((one.dim for one in data), default=0)

    @staticmethod
    def get_datasets(
        version: Literal["numpy", "torch"] = "numpy",
        train_batch_size: int = 1,
        test_batch_size: int = 1,
        difficulty: Literal["easy", "difficult", "all"] = "easy",
        user_train_list: Sequence[int] | None = None,
        user_test_list: Sequence[int] | None = None,
        dimension: int = 9,
        instances: int = 5,
    ) -> "tuple[Dataset, Dataset]":
        """Return the data sets to train and to test on, of as many training and held-out instances.

        "easy" functions are those without noise whose optimum is known, "difficult" ones the others; the lists are of
        the numbers of functions instead. Functions without the dimension are left out.
        """
        one_of("version", version, ("numpy", "torch"))
        one_of("difficulty", difficulty, ("easy", "difficult", "all"))
        kind = Problem if version == "numpy" else TorchProblem
        easy = {one: one.exact and not one.noisy for one in FUNCTIONS}
        usual = [one for one in FUNCTIONS if difficulty == "all" or easy[one] == (difficulty == "easy")]
        numbers = [one.number for one in usual if dimension in one.dimensions]
        train, test = (
            [kind(suites.suite(SUITE, number, one, dimension)) for number in own or numbers for one in part[:instances]]
            for own, part in ((user_train_list, TRAINING), (user_test_list, HELD_OUT))
        )
        return Dataset(train, train_batch_size), Dataset(test, test_batch_size)

    def __getitem__(self, item: int) -> list[Problem]:
        first = self.ptr[item]
        return [self.data[k] for k in self.index[first : first + self.batch_size]]

    def __len__(self) -> int:
        return self.N

    def __add__(self, other: "Dataset") -> "Dataset":  # type: ignore[override]
        return Dataset(self.data + other.data, self.batch_size)

    def shuffle(self) -> None:
        """Bring the problems into another order, by numpy's global generator, which MetaBox seeds."""
        self.index = np.random.permutation(self.N)  # noqa: NPY002
