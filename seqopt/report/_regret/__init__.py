"""Speed against accuracy: one problem by every engine and formulation, timed and judged."""
