"""What ``psstereo bench`` measures, one suite a file."""
