"""The judge: the history of an arm, the checkers of its promises, and their reports."""
