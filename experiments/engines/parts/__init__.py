"""What the claims about engines rest on: scenes, models, charts. None is run on its own."""
