"""The tables of a recording (docs/recording.md), and how a file says that it is one."""

from __future__ import annotations

APPLICATION_ID = 0x7069636F  # "pico"
LAYOUT = 4  # 1 had no table `window`, 2 none `zero`, 3 neither `echo` nor `stretch`
WINDOW_TABLE = """
CREATE TABLE window (
    k INTEGER PRIMARY KEY REFERENCES line(k) ON DELETE CASCADE,
    n INTEGER NOT NULL,
    samples INTEGER NOT NULL,
    bytes_per_sum INTEGER NOT NULL,
    crc32 INTEGER NOT NULL,
    pieces BLOB NOT NULL,
    data BLOB NOT NULL
);
"""
ZERO_TABLE = """
CREATE TABLE IF NOT EXISTS zero (
    id INTEGER PRIMARY KEY,
    lines INTEGER NOT NULL,
    device_time_s REAL NOT NULL,
    x_rad REAL NOT NULL,
    y_rad REAL NOT NULL,
    mark_mm REAL NOT NULL,
    mark_sd_mm REAL NOT NULL,
    sweeps INTEGER NOT NULL,
    clipped INTEGER NOT NULL,
    head_crc32 INTEGER NOT NULL,
    n INTEGER NOT NULL,
    samples INTEGER NOT NULL,
    bytes_per_sum INTEGER NOT NULL,
    crc32 INTEGER NOT NULL,
    pieces BLOB,
    data BLOB NOT NULL
);
"""
ECHO_TABLES = """
CREATE TABLE IF NOT EXISTS echo (
    k INTEGER PRIMARY KEY REFERENCES line(k) ON DELETE CASCADE,
    n INTEGER NOT NULL,
    data BLOB NOT NULL
);
CREATE TABLE IF NOT EXISTS stretch (
    k INTEGER PRIMARY KEY REFERENCES line(k) ON DELETE CASCADE,
    n INTEGER NOT NULL,
    data BLOB NOT NULL
);
"""
LATER_TABLES = {1: WINDOW_TABLE + ZERO_TABLE + ECHO_TABLES, 2: ZERO_TABLE + ECHO_TABLES, 3: ECHO_TABLES}
"""What a recording of an earlier layout lacks."""
SCHEMA = (
    """
CREATE TABLE scan (
    id INTEGER PRIMARY KEY CHECK (id = 1),
    header TEXT NOT NULL,
    header_crc32 INTEGER NOT NULL,
    stop_reason TEXT,
    laser_off_verified INTEGER,
    summary TEXT
);
CREATE TABLE line (
    k INTEGER PRIMARY KEY,
    device_time_s REAL NOT NULL,
    acknowledged_at_s REAL NOT NULL,
    n INTEGER NOT NULL,
    sweeps INTEGER NOT NULL,
    crc32 INTEGER NOT NULL,
    points BLOB NOT NULL
);
CREATE TABLE wave (
    k INTEGER PRIMARY KEY REFERENCES line(k) ON DELETE CASCADE,
    rows INTEGER NOT NULL,
    samples INTEGER NOT NULL,
    bytes_per_sum INTEGER NOT NULL,
    crc32 INTEGER NOT NULL,
    data BLOB NOT NULL
);
CREATE TABLE event (
    id INTEGER PRIMARY KEY,
    t REAL NOT NULL,
    kind TEXT NOT NULL,
    state TEXT,
    data TEXT NOT NULL
);
CREATE TABLE spare_header (
    id INTEGER PRIMARY KEY CHECK (id = 1),
    header TEXT NOT NULL,
    header_crc32 INTEGER NOT NULL
);
"""
    + WINDOW_TABLE
    + ZERO_TABLE
    + ECHO_TABLES
)
