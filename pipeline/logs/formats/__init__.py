"""Readers of logs, one module for each format: times and raw numbers, row by row."""
