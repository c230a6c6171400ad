"""A numbered black-box benchmark: problems in [-1, 1]^d that never change under one name.

    import posefit

    problem = posefit.suite("posefit-2026.1", function=1, instance=10_000, dimension=9)
    print(problem([0.0] * 9), problem.evaluations, problem.targets[-1])

| looking for | file |
|---|---|
| one problem by its numbers, many to go through | front.py |
| what a problem is: calls, counts, budgets, targets, what is not feasible | problem.py |
| which functions, dimensions and instances there are | functions.py |
| what an instance is of each function | instances.py |
| the boxes that are searched, and how they were learned | boxes.py, make_boxes.py |
| the best costs that are known | known.py |
"""
