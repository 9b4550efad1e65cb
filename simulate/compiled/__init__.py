"""numba twins of what simulators do most."""
