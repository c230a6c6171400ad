"""Configure-v1: dynamic algorithm configuration with a choice of optimisers.

| looking for | file |
|---|---|
| the environment | single.py; many at once: `posefit_envs.vector.configuring` |
| what an action stands for, and back | orders.py |
| the population that is steered | herd.py |
| its moves beside a swarm's | moves.py |
| what is observed | features.py |
"""
