"""All build orders at once: states by which bricks stand."""
