"""What the site does that no published extension of Sphinx does."""
