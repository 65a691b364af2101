"""What the claims about time rest on: runs. None is run on its own."""
