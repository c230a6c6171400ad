"""Baseline agents of the environments, on held-out instances: `posefit reproduce agents`.

| looking for | file |
|---|---|
| environments, agents, budgets | design.py |
| a bandit and CMA-ES over constant settings | constants.py |
| PPO and SAC of Stable-Baselines3 | learners.py |
| training, evaluation, rows that are kept | experiment.py |
| scores, intervals, learning curves | tables.py |
"""
