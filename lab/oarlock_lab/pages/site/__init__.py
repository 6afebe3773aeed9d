"""The documentation site: prepares Markdown from docs/, the package and shipped recordings, and builds it."""
