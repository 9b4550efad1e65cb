"""A UWB device on a body: particle filters over active and passive ranges.

A person or robot carries a device among anchors. Its body blocks lines of sight, and scatters what
anchors send to each other; one particle filter tracks device and body from both. H. Zhu, A. Venus,
E. Leitinger and K. Witrisal, "Multi-Sensor Fusion of Active and Passive Measurements for Extended
Object Tracking", 2025.

Read first :mod:`.filter`, from top to bottom; then :mod:`.geo`, :mod:`.ideal` and :mod:`.ap_pda`,
which say what the body looks like to the links, and :mod:`.kernels.link_likelihood`, which weighs
it. :mod:`.links` turns scans into links, :mod:`.cloud.tempering` finds the start.
"""
