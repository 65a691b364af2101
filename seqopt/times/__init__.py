"""How long builds take: robots that prepare, mortar that cures, and the proof of makespans."""
