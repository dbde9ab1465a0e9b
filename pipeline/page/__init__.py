"""The HTML page: one file with everything in it, to look at and click through.

May import `charts` and the rooms below it.
"""
