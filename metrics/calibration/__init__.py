"""What sensors are like, from recordings with truth."""
