"""The HTML page of the study or of chosen campaigns: sections, charts and template.

Imports every room below it, and of paper what the section on the paper shows.
"""
