"""Recorded data: headers, readers of formats, and what of them is refused."""
