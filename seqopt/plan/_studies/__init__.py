"""Plans of other scenes: other bases of robots, fewer props, a build that goes otherwise."""
