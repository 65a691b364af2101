"""Claims about the choice of grips: what it costs, what changes it, what could go wrong."""
