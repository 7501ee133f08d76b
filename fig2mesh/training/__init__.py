"""Training data and weights: bodies, poses, garments, renders, one trainer per network; only for training."""
