"""Colours for the seen and the unseen side of a figure."""
