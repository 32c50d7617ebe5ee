"""``python -m picoradar.instrument.cli``: the same as the command ``picoradar``."""

from picoradar.instrument.cli.main import main

if __name__ == "__main__":
    main()
