"""The terminal: errors, help, progress, interrupts, tables, and files written in one guarded way.

May import `words`.
"""
