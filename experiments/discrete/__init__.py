"""Claims about discrete elements: joints as beds of springs, and bricks laid dry."""
