"""Claims about builds in time: how long they take, and what proves it."""
