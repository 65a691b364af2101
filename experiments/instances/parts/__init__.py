"""What the claims about instances rest on: how they are made, and runs. None is run on its own."""
