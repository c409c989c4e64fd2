"""``python -m psstereo_cli`` is the command ``psstereo``."""

from psstereo_cli.app import main

if __name__ == "__main__":
    main()
