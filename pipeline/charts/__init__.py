"""Figures as PNG, in one style.

May import `proof` and the rooms below it.
"""
