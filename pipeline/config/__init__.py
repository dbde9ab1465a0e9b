"""The configuration: its schema, its rules, how it is loaded, and what it means in SI.

Imports console and words.
"""
