"""The figures, as matplotlib draws them.

Imports console, words, config, campaign, study and proof.
"""
