"""Point targets of unknown number, each detected at most once a scan, among clutter.

Three filters of the same model: ``phd`` carries the intensity of targets as a Gaussian mixture
(B.-N. Vo and W.-K. Ma, 2006; statistics of regions after M. Andrecki et al.), ``mbm`` a mixture of
global hypotheses with or without a Poisson part (A. F. Garcia-Fernandez et al., 2018 and 2019),
``pmb`` one Bernoulli a target and the marginals of its associations (J. L. Williams, 2015).

Read :mod:`.phd` first, from top to bottom, with :mod:`.phd_filter` and :mod:`.phd_update`; then
:mod:`.mbm` with :mod:`.mbm_filter`, and :mod:`.pmb` with :mod:`.pmb_filter`. What all assume stands
in :mod:`.model` (motion, survival and births; detections, noise, clutter, views), what they do
alike with the scans of a time in :mod:`.times`, what they ask of a source of detections in
:mod:`.source`.
"""
