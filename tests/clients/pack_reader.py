"""Reads a pack with h5py and numpy alone, by docs/formats.md; prints what it found as JSON. Usage: pack_reader.py PACK"""
import glob
import json
import struct
import sys
import zlib

import h5py
import numpy as np


def read_shard(path, result):
    with h5py.File(path, "r") as f:
        assert f.attrs["schema"].decode() == "mvstudio.pack/1"
        plan = json.loads(f["plan"][:].tobytes())
        rig = json.loads(f["rig"][:].tobytes())
        assert rig["schema"] == "mvstudio.calibration/1"
        s, poses = f["samples"], f["poses"]
        for name in s:
            assert s[name].fletcher32 or s[name].size == 0, name
        blob = f["blob"]
        for i in range(len(s["frame"])):
            for what in ("image", "mask"):
                at, size = int(s[what + "_offset"][i]), int(s[what + "_bytes"][i])
                data = blob[at:at + size].tobytes()
                result["bad_crc"] += zlib.crc32(data) != int(s[what + "_crc32"][i])
                if size and (what == "mask" or plan["codec"] == "png"):
                    assert data[:8] == b"\x89PNG\r\n\x1a\n"
                    result["bad_size"] += struct.unpack(">II", data[16:24]) != tuple(s["size_px"][i])
            row = int(s["pose"][i])
            if row < 0 or plan["view"] == "full":
                continue
            rt, seen = s["cam_from_world"][i], s["joint_in_view"][i] == 1
            x = poses["joints_in_world"][row] @ rt[:, :3].T + rt[:, 3]
            px = x[:, :2] / x[:, 2:] @ s["K"][i][:2, :2].T + s["K"][i][:2, 2]
            error = np.abs(px - s["joints_px"][i])[seen]
            result["max_joint_error_px"] = max(result["max_joint_error_px"], float(error.max(initial=0)))
            result["joints"] += int(seen.sum())
        result["samples"] += len(s["frame"])


def main():
    result = {"samples": 0, "joints": 0, "bad_crc": 0, "bad_size": 0, "max_joint_error_px": 0.0}
    for path in sorted(glob.glob(sys.argv[1] + "/shard-*.h5")):
        read_shard(path, result)
    print(json.dumps(result))


main()
