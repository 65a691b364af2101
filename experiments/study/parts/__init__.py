"""What the claims about the paper rest on: scenes, models, charts. None is run on its own."""
