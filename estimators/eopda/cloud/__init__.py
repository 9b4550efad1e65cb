"""The particles: how they start, are tempered and resampled, and found anew when they are lost."""
