"""Claims about which steps stand, beside what other programs say."""
