"""Hypothesis without a clock: the first example pays for loading PROJ, and a busy machine is no failure."""

from hypothesis import settings

settings.register_profile("no-deadline", deadline=None)
settings.load_profile("no-deadline")
