"""Scores of the networks on held-out data, beside the paper's."""
