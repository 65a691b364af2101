"""What the heat maps of failures are made of, cell by cell."""
