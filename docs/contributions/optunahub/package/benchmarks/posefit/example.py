import optuna
import optunahub

module = optunahub.load_module("benchmarks/posefit")
problem = module.Problem(function=1, instance=10_000, dimension=9)
study = optuna.create_study(directions=problem.directions)
study.optimize(problem, n_trials=100)
print(study.best_value, problem.problem.optimum)
