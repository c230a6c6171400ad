"""An evolution strategy over any real numbers: covariance matrix adaptation, a whole generation at a time.

`Strategy` is independent of poses, boxes and budgets: it draws a generation, learns from its costs, and reports when it
has come to an end. The caller keeps proposals inside the constraints and restarts it.

N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, 2016. What the tutorial leaves open is as the
library cmaes has it, which the tests hold it against.
"""
