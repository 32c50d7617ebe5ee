"""Methods of the literature: the dissertation's, ICP and its acceleration, robust criteria, baselines."""
