"""``python -m instrument.cli``: the same as the command ``picoradar``."""

from instrument.cli.main import main

if __name__ == "__main__":
    main()
