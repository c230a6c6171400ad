"""Statistics of repeated runs: nothing here knows of poses, sweeps or files.

    import numpy as np
    from posefit.statistics.means import run_means
    from posefit.statistics.paired import paired_tests

    rng = np.random.default_rng(0)
    errors = rng.gamma(2.0, 1.0, (3, 12, 10))   # (methods, instances, seeds); lower is better
    means = run_means(errors)
    print(means.values, means.low, means.high)
    for pair in paired_tests(errors):
        print(pair.first, pair.second, pair.difference, pair.adjusted)

Errors (methods, instances, seeds) are paired by instance and seed. Nothing is drawn at random: the same errors give
the same numbers.

| looking for | field's term | file |
|---|---|---|
| paired runs, and what can be compared of a sweep with gaps | paired, blocked design | pairing.py |
| the mean of runs with its interval | stratified cluster sample, Satterthwaite | means.py |
| which method is better, and how many runs would show it | paired t test, Holm, power | paired.py |
| shares of runs and targets reached in time, or within an error | ECDF, ERT, performance profiles | profiles.py |
"""
