"""Statistics of repeated runs, independent of poses, sweeps and files.

    import numpy as np
    from posefit.statistics.means import run_means
    from posefit.statistics.paired import paired_tests

    rng = np.random.default_rng(0)
    errors = rng.gamma(2.0, 1.0, (3, 12, 10))   # (methods, instances, seeds)
    means = run_means(errors)
    print(means.values, means.low, means.high)
    for pair in paired_tests(errors):
        print(pair.first, pair.second, pair.difference, pair.adjusted)

Errors (methods, instances, seeds) are paired by instance and seed; lower is better.
Nothing is random: the same errors give the same numbers.

| looking for | field's term | file |
|---|---|---|
| the shared runs of a sweep with gaps | paired, blocked design | pairing.py |
| means with intervals | stratified cluster sample, Satterthwaite | means.py |
| better methods, and the runs that show it | paired t test, Holm, power | paired.py |
| shares of runs within a time or an error | ECDF, ERT, profiles | profiles.py |
"""
