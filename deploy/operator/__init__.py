"""The faces of the operator: terminal and page, and what both share."""
