"""Colours for the visible and the hidden sides of a figure."""
