"""A numbered black-box benchmark: problems in [-1, 1]^d that never change under one name.

    import posefit

    problem = posefit.suite("posefit-2026.3", function=1, instance=10_000, dimension=9)
    print(problem([0.0] * 9), problem.evaluations, problem.targets[-1])

| looking for | file |
|---|---|
| one problem by its numbers, many to go through; calls, counts, budgets, targets | problem.py |
| which functions, dimensions and instances there are | functions.py |
| the instances of each function | instances.py |
| the boxes that are searched, made by `docs/studies/make_boxes.py` | boxes.py |
| an optimiser on a problem; the run of any loop; scores of runs | running.py |
"""
