"""Cost of accuracy: every setting of the pipeline varied on a figure, error against seconds and memory."""
