"""Making data and weights: bodies, poses, garments, renders, one trainer per network. The main job needs none of it."""
