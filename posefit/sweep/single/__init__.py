"""Single searches as cells of a sweep: optimisers on problems of a suite, run by the same engines into a ledger.

    suite = "posefit-2026.1"                    # says that the plan is of single searches
    methods = ["sapso", "cma", { method = "pso", settings = { population_size = 20 } }]
    functions = [1, 5]                          # numbers; by default each
    dimensions = [9, 24]                        # by default 9
    instances = 15                              # the first so many that are held out; or a list
    budgets = [100]                             # evaluations for each dimension
    seeds = 1                                   # 0; or a list

| looking for | file |
|---|---|
| what a cell is, and what it measures | search.py |
| a plan becomes cells, all checked before anything runs | plan.py |
| how long searches take, from two that are shorter | estimate.py |
| the rows of a ledger as runs with their targets | rows.py |
"""
