"""What several experiments share: how a claim is declared, found and run; scenes; figures."""
