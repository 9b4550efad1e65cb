"""Inputs and outputs of commands, and their names."""
