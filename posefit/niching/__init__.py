"""A niching task: numbered silhouettes that two or more known poses explain nearly as well, and its scores.

    from posefit.niching.instance import niche_instance
    from posefit.niching.reports import best_apart
    from posefit.niching.scores import scored

    posed = niche_instance(17)
    proposals = posed.problem.space.draw(np.random.default_rng(0), 20_000)      # or those of any search
    report = best_apart(posed.problem, proposals, posed.problem.evaluate(proposals))
    print(posed.kind, scored(posed, report).peak_ratio)

| looking for | file |
|---|---|
| what a number stands for; which poses are known, and why | instance.py |
| the poses of the box: legs and trunk of walks and runs, arms of everything | space.py |
| peak ratio; Brier score and log score | scores.py |
| what a search has evaluated becomes poses with weights | reports.py |
"""
