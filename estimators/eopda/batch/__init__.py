"""The whole recording at once: robust least squares over trajectory and errors of ranges.

Read :mod:`.range_ls`, the estimator, and then :mod:`.problem`, what is minimised; :mod:`.gather`
takes the ranges out of the scans, :mod:`.fixes` finds where to begin, :mod:`.chain` is the algebra,
linear in the length, and :mod:`.choose` fits the noise and decides what makes ranges too long.
"""
