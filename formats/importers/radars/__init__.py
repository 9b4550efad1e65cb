"""Published sets of radar recordings, and the tables of radars that count people."""
