"""Whether the filter is as good as it says and as any could be.

Numbers, goals and `consistency.md`. Imports console, words, config, campaign and study.
"""
