"""Track before detect: targets seen in the maps themselves, not in detections made of them.

The mean of every cell of every station's map is computed from where targets are, how they head and
what they reflect; :mod:`.scene` does so, for stations anywhere. :mod:`.targets` follows each
target by the likelihood of the cells about it, :mod:`.moves` finds new ones in what is not
explained and thinks again about those that are held. Read :mod:`.filter` first.
"""
