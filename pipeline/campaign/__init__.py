"""Making a campaign of runs and reading it: stores, workers, clusters, provenance, summaries.

Imports console, words and config.
"""
