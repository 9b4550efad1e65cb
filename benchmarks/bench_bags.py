"""A bag of ROS 2 with point clouds becomes a recording: rate, memory, and beside reading it alone.

The bag is written by rosbags, MCAP without compression. `alone` is what rosbags takes to read all
messages and deserialise them. Seconds are those of the processor, of the whole process for the
commands, start-up included.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import calibration
import numpy as np
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
CLOUD = "sensor_msgs/msg/PointCloud2"
STRIDE = 24
FIELDS = ("x", "y", "z", "velocity", "power", "spare")


def clouds(mebibytes: float, points: int) -> Iterator[tuple[int, object]]:
    """Clouds of noise, ten a second, with as many bytes of points in all."""
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 20, (points, len(FIELDS))).astype("<f4")
    kinds = STORE.types
    fields = [
        kinds["sensor_msgs/msg/PointField"](name=n, offset=4 * k, datatype=7, count=1)
        for k, n in enumerate(FIELDS)
    ]
    for k in range(int(mebibytes * 2**20 / (STRIDE * points))):
        time_ns = 1_700_000_000 * 10**9 + k * 10**8
        stamp = kinds["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        header = kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="radar")
        data = np.roll(noise, k, 0) + np.float32(1e-3 * k)
        yield time_ns, kinds[CLOUD](
            header=header, height=1, width=points, fields=fields, is_bigendian=False,
            point_step=STRIDE, row_step=STRIDE * points, data=data.view(np.uint8).ravel(),
            is_dense=True,
        )  # fmt: skip


def write(path: Path, mebibytes: float, points: int, plugin: StoragePlugin) -> None:
    """Write the bag."""
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/radar/points", CLOUD, typestore=STORE)
        for time_ns, cloud in clouds(mebibytes, points):
            writer.write(connection, time_ns, STORE.serialize_cdr(cloud, CLOUD))


def alone(path: Path) -> None:
    """Read all messages by rosbags."""
    with Reader(path) as reader:
        for connection, _, raw in reader.messages():
            STORE.deserialize_cdr(raw, connection.msgtype)


def command(*words: object) -> tuple[float, float]:
    """Processor seconds and most resident memory [MiB] of an echoset command."""
    text = "import sys; from echoset.cli.main import main; sys.exit(main(sys.argv[1:]))"
    args = [sys.executable, "-c", text, *map(str, words)]
    _, status, usage = os.wait4(os.spawnv(os.P_NOWAIT, sys.executable, args), 0)
    if status:
        raise SystemExit(f"failed: {' '.join(args[3:])}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main() -> None:
    """Write the bag, read it alone, and convert it into both formats."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mebibytes", type=float, default=128, help="bytes of points; 1024 a GiB")
    parser.add_argument("--points", type=int, default=4000, help="points of a cloud")
    parser.add_argument("--sqlite3", action="store_true", help="a bag of that storage")
    options = parser.parse_args()
    unit = calibration.fastest(calibration.kernel)
    plugin = StoragePlugin.SQLITE3 if options.sqlite3 else StoragePlugin.MCAP
    with TemporaryDirectory() as folder:
        bag = Path(folder, "bag")
        write(bag, options.mebibytes, options.points, plugin)
        start = time.process_time()
        alone(bag)
        read = time.process_time() - start
        _line("alone", options.mebibytes, read, read, unit)
        for form in ("h5", "mcap"):
            seconds, memory = command("convert", "-q", "--from", "ros2", bag, "-o", f"{bag}.{form}")
            size = Path(f"{bag}.{form}").stat().st_size / 2**20
            tail = f"{memory:7.0f} MiB resident, file of {size:.0f} MiB"
            _line(form, options.mebibytes, seconds, read, unit, tail)


def _line(
    name: str, mebibytes: float, seconds: float, read: float, unit: float, tail: str = ""
) -> None:
    print(
        f"{name:<6}{seconds:8.2f} s {mebibytes / seconds:7.0f} MiB/s {seconds / read:6.1f} x alone "
        f"{seconds / unit:8.1f} kernels {tail}",
        flush=True,
    )


if __name__ == "__main__":
    main()
