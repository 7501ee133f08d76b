"""Bodies, garments, poses and motion clips."""
