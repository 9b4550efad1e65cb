"""Tables and figures of four papers, ours beside the published numbers: ``python -m papers``."""
