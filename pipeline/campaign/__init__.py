"""Campaigns: stores, the workers that make their runs, provenance, and what a campaign comes to.

May import `config` and the rooms below it.
"""
