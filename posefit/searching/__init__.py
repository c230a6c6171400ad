"""Several searches of one problem: the poses that a silhouette leaves open, whatever optimiser looks for them.

    from posefit.searching.modes import modes

    posterior = modes(problem, factory, searches=8, evaluations=2440, rng=np.random.default_rng(0))

`factory(space, rng)` builds any optimiser. What is told is a `posefit.uncertainty.modes.Posterior`.

| looking for | file |
|---|---|
| the modes of one problem, with their weights | modes.py |
| other poses that a silhouette hardly tells from one, as proposals | twins.py |
| how likely a frame is lost | doubt.py |
| those of every frame that an optimiser follows | tracker.py |
| several starts of a track, and the best of them | starts.py |
| a track that looks all around again after a gap | again.py |
| turns that nobody makes, and which way somebody faces all along | whirls.py |
| a track that is followed again where there were some | anew.py |
| what tracks cost, and what several took together | spent.py |
"""
