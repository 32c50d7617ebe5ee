"""Programs that nobody here wrote against the simulated bench: the makers' own clients and PyMeasure, over ptys.

Install the clients into an environment of their own, beside which `picoradar` may be another one:

    pip install srsinst-dg645 pymeasure mecompyapi pyvisa-py
    picoradar sim > bench.json &
    python benchmarks/foreign_clients.py bench.json

Each line says which client asked for what and got what; the script ends with an error if an answer is wrong.
(`mecompyapi` imports a USB library of FTDI even when a serial port is used; where that is missing an empty
module stands in for it.)
"""

from __future__ import annotations

import json
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any


def dg645(port: str) -> dict[str, tuple[Any, Any]]:
    """Drive the delay generator with its maker's client; give what was found and what is right."""
    from srsinst.dg645 import DG645  # asks for pyvisa-py, which must be there, though it is not used

    device = DG645("serial", port, 9600)
    device.trigger.trigger_source = "single shot"
    device.trigger.trigger_rate = 80e3
    device.delays.delay["B"]["A"] = 1e-8
    device.outputs.amplitude["AB"] = 3.3
    found = {
        "identity": (device.query_text("*IDN?").split(",")[1], "DG645"),
        "rate": (device.trigger.trigger_rate, 80e3),
        "source": (device.trigger.trigger_source, "single shot"),
        "delay of B": (repr(device.delays.delay["B"]), "2,+0.000000010000"),
        "amplitude of AB": (device.outputs.amplitude["AB"], 3.3),
        "last error": (device.query_text("LERR?"), "0"),
    }
    device.disconnect()
    return found


def genesys(port: str) -> dict[str, tuple[Any, Any]]:
    """Drive the supply with PyMeasure."""
    import serial
    from pymeasure.adapters import SerialAdapter
    from pymeasure.instruments.tdk import TDK_Gen80_65

    with serial.Serial(port, 9600, timeout=1) as line:
        device = TDK_Gen80_65(SerialAdapter(line, read_termination="\r", write_termination="\r"))
        device.remote = "REM"
        device.output_enabled = False
        device.voltage_setpoint = 30.0
        return {
            "identity": (device.id, ["LAMBDA", "GEN600-1.3"]),
            "remote": (device.remote, "REM"),
            "set point": (device.voltage_setpoint, 30.0),
            "output": (device.output_enabled, False),
            "mode": (device.mode, "OFF"),
            "fields of STT?": (len(device.status), 6),
        }


def tec(port: str) -> dict[str, tuple[Any, Any]]:
    """Drive the temperature controller with its maker's client."""
    try:
        import ftd2xx  # noqa: F401
    except (ImportError, OSError):
        stand_in = types.ModuleType("ftd2xx")
        stand_in.FTD2XX = stand_in.defines = object  # type: ignore[attr-defined]
        sys.modules["ftd2xx"] = stand_in
    from mecompyapi.tec import MeerstetterTEC

    device = MeerstetterTEC()
    device.connect_serial_port(port=port)
    device.set_temperature(23.0)
    found = {
        "type": (device.get_device_type(), 1091),
        "identity": (device.get_firmware_identification_string().strip(), "8065-TEC SW G01"),
        "target": (device.get_setpoint_temperature(), 23.0),
        "status": (device.get_device_status().name, "READY"),
        "baud rate": (device.get_base_baud_rate(), 57600),
    }
    device.tear()
    return found


CLIENTS: dict[str, Callable[[str], dict[str, tuple[Any, Any]]]] = {"dg645": dg645, "genesys": genesys, "tec": tec}


def main(bench: Path) -> int:
    """Run every client that is installed; returns how many answers were wrong."""
    ports = json.loads(bench.read_text().splitlines()[0])["serial"]
    wrong = 0
    for name, client in CLIENTS.items():
        try:
            answers = client(ports[name]["pty"])
        except ImportError as error:
            print(f"{name:8s} skipped: {error}")
            continue
        for what, (found, right) in answers.items():
            ok = found == right
            wrong += not ok
            print(f"{name:8s} {what:16s} {found!r}{'' if ok else f'   WRONG, should be {right!r}'}")
    return wrong


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
