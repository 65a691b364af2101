"""Claims about the library of instances: what is known of each, and by which way to solve it."""
