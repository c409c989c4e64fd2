"""The command ``psstereo``."""
