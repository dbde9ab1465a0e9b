"""The gate: is this code worse than the committed baseline, and how sure is that.

May import `study` and the rooms below it.
"""
