"""What the claims about grips rest on: scenes, models, charts. None is run on its own."""
