"""Where methods fail: numbers of engines and formulations, and steps of builds."""
