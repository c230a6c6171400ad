"""`sapso+vsmm`: the motion models of `vsmm` say where a swarm starts, and learn what it finds."""
