"""What the claims about discrete rest on: scenes, models, charts. None is run on its own."""
