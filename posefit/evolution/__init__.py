"""An evolution strategy over any real numbers: covariance matrix adaptation, a whole generation at a time.

It knows nothing of poses, boxes or budgets: `Strategy` draws a generation, learns from its costs, and says when it has
come to an end. Whoever uses it keeps its proposals where they may be, and begins again where it has ended.

N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, 2016. What the tutorial leaves open is as the
library cmaes has it, which the tests hold it against.
"""
