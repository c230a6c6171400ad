"""An interacting multiple-model filter (IMM) for any models of any states: a library, not a plugin.

Several models of how a state goes on are run side by side. In every cycle each starts from a mixture of all their
states, predicts, and learns from the measurement; the better it predicted, the more probable it becomes. The equations
are those of H. Blom, Y. Bar-Shalom, The interacting multiple model algorithm for systems with Markovian switching
coefficients, IEEE Trans. Automatic Control 33(8), 1988, as CN101894278 uses them in its step 6 (tags `VSMM 6.2a` to
`VSMM 6.5` in `filter`).

- `IMM` is the filter: `cycle` goes on by one measurement, `fused` says the one state that stands for all models.
- `Model` is what it asks of a model: `predict(state, covariance)`.
- `Measurement` is what was measured against what one state expects; any function of a state may return it.
- `Belief` is all that the filter holds; `start` makes the first one. Nothing else is kept, so a belief can be stored,
  copied or changed between cycles.
- `Manifold` says how an error moves a state: + and - for vectors; `PLACED` for a place and unit quaternions.

A thing on a line either stands or moves by 1 a frame. Its place is measured, and it moves:

>>> import numpy as np
>>> from posefit_imm import IMM, Measurement, start
>>> class Drift:
...     def __init__(self, step):
...         self.step = step
...     def predict(self, state, covariance):
...         return state + self.step, covariance + 0.01
>>> imm = IMM([Drift(0.0), Drift(1.0)], np.array([[0.9, 0.1], [0.1, 0.9]]))
>>> belief = start(np.zeros(1), np.eye(1), models=2)
>>> for seen in (1.0, 2.0, 3.0):
...     belief = imm.cycle(belief, lambda state: Measurement(seen - state, np.eye(1), np.array([[0.01]])))
>>> [round(float(one), 3) for one in belief.probabilities]
[0.0, 1.0]
>>> state, covariance = imm.fused(belief)
>>> round(float(state[0]), 2)
3.0
"""

from posefit_imm.filter import IMM, Belief, Manifold, Measurement, Model, positive_definite, start, update
from posefit_imm.quaternions import PLACED

__all__ = ["IMM", "PLACED", "Belief", "Manifold", "Measurement", "Model", "positive_definite", "start", "update"]
