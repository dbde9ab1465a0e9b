"""Pieces of Markdown and templates filled in; imports `pipeline.console` at most."""
