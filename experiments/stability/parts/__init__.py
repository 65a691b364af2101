"""What the claims about stability rest on: scenes, models, charts. None is run on its own."""
