"""Whether a change lost accuracy: the baseline, its history, the judgement, and how sure that is.

Imports console, words, config, campaign and study.
"""
