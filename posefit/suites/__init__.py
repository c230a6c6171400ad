"""A numbered black-box benchmark of problems in [-1, 1]^d, which never change.

    import posefit

    problem = posefit.suite("posefit-2026.3", function=1, instance=10_000, dimension=9)
    print(problem([0.0] * 9), problem.evaluations, problem.targets[-1])

| looking for | file |
|---|---|
| one problem by its numbers, and an iterator over many | problem.py |
| the functions and their dimensions | functions.py |
| the instances of each function | instances.py |
| the search boxes, made by `docs/studies/make_boxes.py` | boxes.py |
| runs of an optimiser or of any loop, and their scores | running.py |
| the suite in the form of IOHexperimenter's registry | registry.py |
"""
