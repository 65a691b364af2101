"""Programs over layers of candidates in many scenarios at once."""
