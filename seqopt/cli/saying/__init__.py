"""What commands answer: text, JSON, files, and how far they are."""
