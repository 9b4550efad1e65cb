"""Estimates against truth: errors per recording, their pooling, and bounds."""
