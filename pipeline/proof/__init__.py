"""The consistency study: is the filter as good as it says, and as any could be.

May import `gate` and the rooms below it.
"""
