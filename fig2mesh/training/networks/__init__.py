"""One trainer per network, and the loop they share."""
