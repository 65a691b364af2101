"""Commands of whoever never sees a scene: instances, and the judge of their solutions."""
