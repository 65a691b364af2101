"""What holds beside robots, and how long robots take."""
