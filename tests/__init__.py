"""What proves the arm: tests, and the programs that judge it."""
