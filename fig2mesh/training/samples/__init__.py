"""Samples and shards of training data, and loading them."""
