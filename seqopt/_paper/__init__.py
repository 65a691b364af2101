"""The tables and figures of Bruun et al., computed anew and set beside what they print."""
