"""What every filter of points assumes: of targets, of detections, of clutter, of the view."""
