"""What the paper claims, checked claim by claim, one page each.

Imports all rooms below it.
"""
