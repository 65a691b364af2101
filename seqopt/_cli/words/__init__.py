"""Words of options that are read with their scene."""
