"""Claims about what happens to input that is wrong, odd or cut off."""
