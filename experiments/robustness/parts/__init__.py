"""What the claims about robustness rest on: cases and their judge. None is run on its own."""
