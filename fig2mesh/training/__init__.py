"""Making data and weights: bodies, poses, garments, renders, one trainer per network. The main command needs none of it."""
