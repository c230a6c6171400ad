"""Statistics of repeated runs: nothing here knows of poses, sweeps or files.

    import numpy as np
    from posefit.statistics.intervals import iqm_intervals
    from posefit.statistics.ranks import wilcoxon

    rng = np.random.default_rng(0)
    errors = rng.gamma(2.0, 1.0, (3, 12, 10))              # (methods, instances, seeds); lower is better
    print(iqm_intervals(errors, rng).values)               # interquartile mean of each method, with `low` and `high`
    for pair in wilcoxon(errors):
        print(pair.first, pair.second, pair.adjusted)      # signed ranks, p adjusted after Holm

Everything that compares methods takes errors (methods, instances, seeds), paired by instance and seed. Randomness comes
from a numpy Generator alone.

| looking for | field's term | file |
|---|---|---|
| paired runs, and what can be compared of a sweep with gaps | paired, blocked design | pairing.py |
| the mean of the middle half, with its interval | interquartile mean, studentised bootstrap | intervals.py |
| the mean of runs of which some have a draw in common | stratified cluster sample | means.py |
| which method is better, by order alone | Wilcoxon, Holm | ranks.py |
| shares of runs and targets reached in time, or within an error | ECDF, ERT, performance profiles | profiles.py |
"""
