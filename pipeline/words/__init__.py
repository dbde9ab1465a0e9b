"""Words: Markdown, and templates filled in. Imports nothing of the pipeline."""
