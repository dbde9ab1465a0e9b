"""The configuration: its schema, rules and messages, loading it, and what it means in SI.

May import `words`, `console` and the library.
"""
