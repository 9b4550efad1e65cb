"""Extended targets of many detections each, from many scans of many sensors, by a jump chain.

*Efficient sensing of multiple extended targets by a doubly inhomogeneous generalised shot noise Cox
process and jump Markov chain Monte Carlo sampling* (DI-GSNCP). Read :mod:`.di_gsncp` first, what
happens in an epoch; then :mod:`.kernels.posterior`, the density, and :mod:`.kernels.moves`, the
steps that are proposed, both as printed in sections 3 and 4, and :mod:`.chain`, which runs them.
:mod:`.scene` and :mod:`.sensors` make the density's arguments from scans; :mod:`.params` holds the
parameters. :mod:`.dbscan` and :mod:`.oracle` are the baselines: clusters, and what could be done if
every detection's target were told. ``kernels/compiled`` holds twins of the kernels in numba.
"""
