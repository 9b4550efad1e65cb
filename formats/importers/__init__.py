"""Importers of the recordings of others: ``autoferry``, ``csv`` and ``labyrinth``.

Beside them stands what they share: ``text`` (files and tables of text) and ``json`` read,
``rows`` makes streams of what was read, and ``tracks`` sets of objects.
"""
