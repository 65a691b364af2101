"""Problems as instances, which need no scene: compiled, and solved."""
