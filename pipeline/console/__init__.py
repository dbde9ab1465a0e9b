"""What a command has to do with its terminal and its files.

Messages, progress, interrupts, writing. Imports no other room.
"""
