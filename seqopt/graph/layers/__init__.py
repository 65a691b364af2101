"""The open grips of a schedule as layers of candidates, whose neighbors share a step."""
