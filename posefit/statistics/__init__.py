"""What repeated runs can say: nothing here knows of poses, sweeps or files.

    import numpy as np
    from posefit.statistics.intervals import iqm_intervals
    from posefit.statistics.ranks import friedman, wilcoxon

    rng = np.random.default_rng(0)
    errors = rng.gamma(2.0, 1.0, (3, 12, 10))              # (methods, instances, seeds); lower is better
    print(iqm_intervals(errors, rng).values)               # interquartile mean of each method, with `low` and `high`
    print(friedman(errors).mean_ranks)                     # and what a critical-difference plot needs
    for pair in wilcoxon(errors):
        print(pair.first, pair.second, pair.adjusted)      # signed ranks, p adjusted after Holm

Everything that compares methods takes errors (methods, instances, seeds) in which all of one instance and seed belong
together. Randomness comes from a numpy Generator alone.

| looking for | field's term | file |
|---|---|---|
| runs side by side, and what is left of a sweep with gaps | paired, blocked design | pairing.py |
| which methods share enough runs to be held against each other | | sharing.py |
| the mean of the middle half, and how sure it is | interquartile mean, studentised bootstrap | intervals.py |
| the mean of runs of which some have a draw in common | stratified cluster sample | means.py |
| which method is better, judged by order alone | Friedman, Nemenyi, Wilcoxon, Holm | ranks.py |
| which methods share a letter, as no test tells them apart | compact letter display | letters.py |
| how probably a run of one beats a run of another | probability of improvement, Mann-Whitney's U | improvement.py |
| shares of runs and targets reached in time, or within an error | ECDF, ERT, performance profiles | profiles.py |
"""
