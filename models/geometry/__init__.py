"""Places and shapes: poses of sensors, regions, extents of objects, grids."""
