"""Frames of a body, traced in real time, and the effects that may go on top of them."""
