"""What claims about placement rest on: another analysis. None is run on its own."""
