"""Mortar that cures: bonds by age, from when on states stand, and how long they must wait."""
