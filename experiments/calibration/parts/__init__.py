"""What the claims about stiffness rest on: scenes, models, charts. None is run on its own."""
