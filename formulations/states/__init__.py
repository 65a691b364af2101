"""Programs over the states of a build: of free schedules, of any schedule, and of orders."""
