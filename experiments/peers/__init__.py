"""Claims about the tools that one would take instead."""
