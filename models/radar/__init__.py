"""What a radar measures: its view, its waveform, what reflects, and the contract of its data."""
