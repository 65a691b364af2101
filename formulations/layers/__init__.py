"""Programs over layers of candidates: the open grips of a schedule, one layer a move."""
