"""Conversion of a request to a model and its report: the runner of the stages and the stores of their results."""
