"""Mutation testing of the safety path: each small change of the code must fail a test."""
