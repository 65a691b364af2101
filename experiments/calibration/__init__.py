"""Claims about stiffness: joints fitted to vault tests, and the arch to printed responses."""
