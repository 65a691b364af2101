"""Claims about the engines: how exact, how fast, and where they end."""
