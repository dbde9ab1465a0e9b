"""How far a run of a campaign is."""

NOT_RUN, DONE, FAILED = 0, 1, 2
"""Values of ``status``."""
