"""What the claims about peers rest on: scenes, models, charts. None is run on its own."""
