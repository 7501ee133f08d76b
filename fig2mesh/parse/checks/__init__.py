"""Checks of what a figure is read from: whether files fit together, whether it is a person, what is missed."""
