"""Problems of posefit's suites as those of other tools, where benchmarks are run and optimisers are learned.

Each module imports its tool, which `pip install posefit[NAME]` brings along, and has a `Problem` of that tool's kind.
Unless `infeasible` says another, a proposal that is not feasible costs what its repair costs. Budgets are the tool's.

| tool | module | what it is made of |
|---|---|---|
| EvoX | evox.py | a problem |
| IOH-BLADE, where language models design optimisers | blade.py | numbers of problems to train and to test on |
| MetaBox, in numpy and in torch, with its data sets | metabox.py | a problem |
| Nevergrad, with a plan for its benchmark command | nevergrad.py | a problem's numbers |
| OptunaHub | optunahub.py | a problem |
| pymoo | pymoo.py | a problem |

IOHexperimenter's is `problem.ioh()` of any problem of a suite.

>>> import posefit
>>> from posefit_bridges.pymoo import Problem
>>> Problem(posefit.suite("posefit-2026.3", function=1, instance=10_000, dimension=9)).n_var
9
"""
