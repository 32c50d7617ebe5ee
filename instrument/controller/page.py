"""Brings the generated parts of docs/controller.md up to date: states, diagram and interlocks, from their one source.

python -m picoradar.instrument.controller.page docs/controller.md
"""

from __future__ import annotations

import re
import sys
from functools import partial
from pathlib import Path

from picoradar.instrument.controller.exposure import exposure_of
from picoradar.instrument.controller.interlocks import interlock_table
from picoradar.instrument.controller.states import diagram, state_table
from picoradar.instrument.settings import Settings


def parts() -> dict[str, str]:
    """Get the generated parts by name."""
    settings = Settings()
    return {
        "states": state_table(),
        "diagram": f"```mermaid\n{diagram()}\n```",
        "interlocks": interlock_table(settings, exposure_of(settings.pulser)),
    }


def renewed(page: str) -> str:
    """Return the page with each part between ``<!-- name -->`` and ``<!-- end -->`` written anew.

    Raises
    ------
    ValueError
        When the page has no place for a part.
    """
    for name, text in parts().items():
        place = re.compile(rf"(<!-- {name} -->\n).*?(^<!-- end -->)", re.DOTALL | re.MULTILINE)
        if not place.search(page):
            raise ValueError(f"the page has no place <!-- {name} --> ... <!-- end -->")
        page = place.sub(partial(_filled, text), page)
    return page


def _filled(text: str, found: re.Match[str]) -> str:
    return f"{found[1]}{text}\n{found[2]}"


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(renewed(path.read_text(encoding="utf-8")), encoding="utf-8")
