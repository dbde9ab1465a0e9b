"""The study: its campaigns by name, findings, verdicts, report, and what a path shows.

May import `campaign` and the rooms below it.
"""
