"""Claims about what Bruun et al. printed."""
