"""Recordings for the fuzzer: sound ones, and mutations of their tables whose check sums fit."""

from __future__ import annotations

import contextlib
import io
import json
import random
import sqlite3
import tempfile
import zlib
from pathlib import Path

import numpy as np
import zstandard

from benchmarks.fuzz import mutate
from picoradar.drivers.traces import CodeScale, Trace
from picoradar.instrument.cli.main import run
from picoradar.instrument.line import ScanLine, StretchTerms
from picoradar.instrument.recording import Recording
from picoradar.instrument.recording.layout import line_crc32

COLUMNS = {
    "scan": ("header", "header_crc32", "stop_reason", "laser_off_verified", "summary"),
    "line": ("k", "device_time_s", "acknowledged_at_s", "n", "sweeps", "crc32", "points"),
    "wave": ("k", "rows", "samples", "bytes_per_sum", "crc32", "data"),
    "window": ("k", "n", "samples", "bytes_per_sum", "crc32", "pieces", "data"),
    "echo": ("k", "n", "data"),
    "stretch": ("k", "n", "data"),
    "event": ("id", "t", "kind", "state", "data"),
}
SCHEMA = (
    "CREATE VIEW more AS SELECT 1", "CREATE TRIGGER more AFTER UPDATE ON scan BEGIN DELETE FROM line; END",
    "DROP TABLE event", "DROP TABLE line", "DROP TABLE scan", "DELETE FROM scan", "PRAGMA user_version=1",
    "PRAGMA user_version=-5", "PRAGMA application_id=0", "ALTER TABLE line RENAME COLUMN n TO m",
    "ALTER TABLE wave ADD COLUMN more", "INSERT INTO line SELECT k + 10, 1, 1, n, sweeps, crc32, points FROM line",
)  # fmt: skip


def sound_recordings() -> list[bytes]:
    """A scan in sweeps and one in windows, as the command makes them, and a small one; constraints taken out."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder, name) for name in ("sweep.db", "window.db", "small.db")]
        for path, mode in zip(paths, ("sweep", "window"), strict=False):
            with contextlib.redirect_stdout(io.StringIO()):
                run(["scan", "--grid", "3x2", "--mode", mode, "--seed", "4", "-o", str(path), "--json"])
        _small(paths[2])
        for path in paths:
            _loosen(path)
        return [path.read_bytes() for path in paths]


def _small(path: Path) -> None:
    trace = {"start_ps": 6500.0, "step_ps": 6.7, "samples": 9, "zero_code": 40.0, "mv_per_code": 0.5}
    header = {"raster": {"rows": 3, "columns": 2}, "trace": trace, "settings": {}, "scanner": {"dg645": "DG645"}}
    header["raster"]["step_mm"] = 1.0
    header["range_error"] = {"material": "bone", "bias_mm": 3.2, "sd_mm": 0.4}
    header["stretch"] = StretchTerms(3.2, rest_mm=0.15, piece_sd=0.25, power=0.45, power_sd=0.05, law_sd=0.03)._asdict()
    times_ps = 6500.0 + 6.7 * np.arange(9)
    with Recording.create(path, header) as recording:
        for k in range(3):
            sums = np.random.default_rng(k).integers(0, 500, (2, 9)).astype(np.uint16)
            recording.append(
                ScanLine(
                    index=k,
                    columns=np.arange(2, dtype=np.int32),
                    angles_rad=np.zeros((2, 2)),
                    points_mm=np.full((2, 3), 900.0),
                    covariance_mm2=np.zeros((2, 3, 3)),
                    range_mm=np.full(2, 900.0),
                    range_variance_mm2=np.full(2, 0.05),
                    response_mv=np.full(2, 40.0),
                    flags=np.zeros(2, dtype=np.uint16),
                    traces=Trace(sums, 8, times_ps, CodeScale(40.0, 0.5)),
                    sweeps=8,
                    device_time_s=0.5 + k,
                    last_points_mm=np.array([[np.nan] * 3, [930.0] * 3]),
                    last_range_mm=np.array([np.nan, 930.0]),
                    last_range_variance_mm2=np.array([np.nan, 0.1]),
                    last_response_mv=np.array([np.nan, 15.0]),
                    range_covariance_mm2=np.array([np.nan, -0.01]),
                    stretch=np.array([[0.7, 0.01], [np.nan, np.nan]]),
                )
            )
            recording.event(0.5 + k, "note", state="scanning", words="all well")
        recording.finish("finished", laser_off_verified=True)


def _loosen(path: Path) -> None:
    """Let every column hold every type, as a file made by another program may."""
    database = sqlite3.connect(path)
    database.execute("PRAGMA writable_schema=1")
    database.execute("UPDATE sqlite_schema SET sql=replace(replace(sql, ' NOT NULL', ''), ' CHECK (id = 1)', '')")
    database.commit()
    database.close()


def table_value(rng: random.Random, content: bytes) -> bytes:
    """Change a field, the header or the tables themselves; in most cases with check sums that fit."""
    with tempfile.NamedTemporaryFile(suffix=".db") as file:
        file.write(content)
        file.flush()
        database = sqlite3.connect(file.name, isolation_level=None)
        try:
            database.execute("PRAGMA journal_mode=OFF")
            database.execute("PRAGMA synchronous=OFF")
            for _ in range(rng.choice((1, 1, 2, 3))):
                _change(rng, database)
        except (sqlite3.Error, OverflowError, UnicodeError, ValueError, RecursionError, zstandard.ZstdError):
            pass  # what cannot be written is no input
        finally:
            database.close()
        return Path(file.name).read_bytes()


def _change(rng: random.Random, database: sqlite3.Connection) -> None:
    chosen = rng.random()
    if chosen < 0.05:
        database.execute(rng.choice(SCHEMA))
    elif chosen < 0.4:
        _change_header(rng, database)
    elif chosen < 0.55:
        _change_packed(rng, database)
    else:
        table = rng.choice(list(COLUMNS))
        column = rng.choice(COLUMNS[table])
        rows = database.execute(f"SELECT rowid, {column} FROM {table}").fetchall()
        if rows:
            key, before = rng.choice(rows)
            database.execute(f"UPDATE {table} SET {column}=? WHERE rowid=?", (_value(rng, before), key))
    if rng.random() < 0.7:
        _renew_check_sums(database)


def _value(rng: random.Random, before: object) -> object:
    if isinstance(before, bytes) and rng.random() < 0.6:
        return rng.choice(mutate.BYTES)(rng, before)
    if isinstance(before, str) and rng.random() < 0.6:
        return mutate.json_value(rng, before.encode()).decode()
    value = rng.choice((*mutate.VALUES, *mutate.WHOLE, b"", b"\0" * 300, rng.randbytes(20)))
    return value if isinstance(value, int | float | str | bytes | None) else json.dumps(value)


def _change_header(rng: random.Random, database: sqlite3.Connection) -> None:
    found = database.execute("SELECT header FROM scan WHERE typeof(header)='text'").fetchone()
    if found is None:
        return  # an earlier step has taken it
    (text,) = found
    step = mutate.json_value if rng.random() < 0.8 else rng.choice(mutate.BYTES)
    changed = step(rng, text.encode()).decode("utf-8", errors="replace")
    database.execute("UPDATE scan SET header=?, header_crc32=?", (changed, zlib.crc32(changed.encode())))


def _change_packed(rng: random.Random, database: sqlite3.Connection) -> None:
    """Put a frame of another size, also one that is a bomb, into a row."""
    size = rng.choice((0, 1, 36, 1000, 10_000_000))
    packer = zstandard.ZstdCompressor(write_content_size=rng.random() < 0.5)
    table, column = rng.choice((("wave", "data"), ("window", "data"), ("window", "pieces")))
    database.execute(f"UPDATE {table} SET {column}=?", (packer.compress(bytes(size)),))


def _renew_check_sums(database: sqlite3.Connection) -> None:
    more = "coalesce(echo.data, x''), coalesce(stretch.data, x'')"
    for k, begun, n, sweeps, *blobs in database.execute(
        f"SELECT line.k, device_time_s, line.n, sweeps, points, {more} FROM line LEFT JOIN echo USING (k)"
        " LEFT JOIN stretch USING (k)"
    ).fetchall():
        with contextlib.suppress(Exception):
            database.execute("UPDATE line SET crc32=? WHERE k=?", (line_crc32(k, n, sweeps, begun, *blobs), k))
    for k, rows, samples, width, data in database.execute(
        "SELECT k, rows, samples, bytes_per_sum, data FROM wave"
    ).fetchall():
        with contextlib.suppress(Exception):
            head = np.array([k, rows, samples, width], dtype="<i8").tobytes()
            database.execute("UPDATE wave SET crc32=? WHERE k=?", (zlib.crc32(data, zlib.crc32(head)), k))
    query = "SELECT k, n, samples, bytes_per_sum, pieces, data FROM window"
    for k, n, samples, width, pieces, data in database.execute(query).fetchall():
        with contextlib.suppress(Exception):
            head = np.array([k, n, samples, width], dtype="<i8").tobytes()
            crc = zlib.crc32(data, zlib.crc32(pieces, zlib.crc32(head)))
            database.execute("UPDATE window SET crc32=? WHERE k=?", (crc, k))
