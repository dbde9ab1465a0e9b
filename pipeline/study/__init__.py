"""What the campaigns of the study show.

Findings, verdicts, `report.md`, and what a path makes observable. Imports console, words, config
and campaign.
"""
