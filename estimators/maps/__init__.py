"""From the range-angle maps of base stations to classified detections with covariances.

E. Favarelli, E. Matricardi, L. Pucci, E. Paolini, W. Xu and A. Giorgetti, "Multi-base station
cooperative sensing with AI-aided tracking", section III: the maps of a time are fused to a soft
map, a network tells the classes of the targets that are followed, and bright pixels are clustered.

Read :mod:`.detector` first: its ``Chain`` is that way, and a source of detections for any filter
that asks for one. :mod:`.pairs` tells two pedestrians apart, which the paper does not.
"""
