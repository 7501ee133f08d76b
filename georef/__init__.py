"""Places on the earth: frames, transforms, geodesy and placement. Imports nothing of the other packages."""
