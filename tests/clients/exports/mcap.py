"""MCAP by its specification (https://mcap.dev/spec), with messages of ROS 2 in CDR: cameras, images, joints."""

import glob
import struct

import numpy as np

from exports.common import BODY25, Camera, JOINTS, check, quaternion_matrix

MAGIC = b"\x89MCAP0\r\n"


class Cursor:
    def __init__(self, data, at=0):
        self.data, self.at, self.begin = data, at, at

    def take(self, kind, aligned=False):
        size = struct.calcsize("<" + kind)
        if aligned:
            self.at += -(self.at - self.begin) % size
        value, = struct.unpack_from("<" + kind, self.data, self.at)
        self.at += size
        return value

    def bytes(self, count):
        self.at += count
        return self.data[self.at - count:self.at]

    def text(self):
        return self.bytes(self.take("I")).decode()


class Cdr(Cursor):
    """Numbers at multiples of their size, counted from behind the four bytes of the head."""

    def __init__(self, data):
        check(data[:4] == b"\0\1\0\0", "CDR head")
        super().__init__(data, 4)

    def get(self, kind):
        return self.take(kind, True)

    def string(self):
        text = self.bytes(self.get("I"))
        check(text[-1:] == b"\0", "text without an end")
        return text[:-1].decode()

    def header(self):
        return self.get("i") * 10**9 + self.get("I"), self.string()

    def many(self, kind, count):
        return np.array([self.get(kind) for _ in range(count)])


def records(data):
    cursor = Cursor(data)
    while cursor.at < len(data):
        at, opcode, length = cursor.at, cursor.take("B"), cursor.take("Q")
        yield at, opcode, cursor.bytes(length)


def read_file(path):
    """(topic, schema, time, message) in the order of the file; summary and indexes are checked against it."""
    data = open(path, "rb").read()
    check(data[:8] == MAGIC and data[-8:] == MAGIC, "magic")
    schemas, channels, found, chunks, indexes, statistics = {}, {}, [], {}, {}, None
    def meet(opcode, body):
        cursor = Cursor(body)
        if opcode == 3:
            number = cursor.take("H")
            schemas[number] = (cursor.text(), cursor.text(), cursor.text())
        elif opcode == 4:
            number, schema = cursor.take("H"), cursor.take("H")
            channels[number] = (cursor.text(), schemas[schema][0])
            check(cursor.text() == "cdr" and cursor.take("I") == 0 and schemas[schema][1] == "ros2msg", "channel")
        elif opcode == 5:
            channel, _, time, published = cursor.take("H"), cursor.take("I"), cursor.take("Q"), cursor.take("Q")
            check(time == published, "times")
            found.append((*channels[channel], time, body[cursor.at:]))
    for at, opcode, body in records(data[8:-8]):
        at, cursor = at + 8, Cursor(body)
        if opcode == 6:
            first, last, size, crc, compression, length = *(cursor.take(k) for k in "QQQI"), cursor.text(), cursor.take("Q")
            check(size == length == len(body) - cursor.at and crc == 0 and compression == "", "chunk")
            inside = body[cursor.at:]
            chunks[at] = (first, last, len(body) + 9, inside)
            for _, kind, part in records(inside):
                meet(kind, part)
        elif opcode == 7:
            channel, entries = cursor.take("H"), cursor.take("I")
            indexes[at] = channel
            for _ in range(entries // 16):
                time, place = cursor.take("Q"), cursor.take("Q")
                message = Cursor(list(chunks.values())[-1][3], place)
                check(message.take("B") == 5 and message.take("Q") and message.take("H") == channel, "message index")
                message.take("I")
                check(message.take("Q") == time, "message index: time")
        elif opcode == 8:
            first, last, place, length = (cursor.take("Q") for _ in range(4))
            check(chunks[place][:3] == (first, last, length), "chunk index")
            for _ in range(cursor.take("I") // 10):
                channel, offset = cursor.take("H"), cursor.take("Q")
                check(indexes[offset] == channel, "chunk index: message index")
        elif opcode == 11:
            statistics = [cursor.take(k) for k in "QHIIII"]
        elif opcode == 2:
            summary = cursor.take("Q")
            check(data[summary] == 3, "the summary begins with a schema")
        elif opcode in (3, 4):
            meet(opcode, body)
    check(statistics == [len(found), len(schemas), len(channels), 0, 0, len(chunks)], "statistics")
    return found


def read_transforms(message):
    placed = {}
    for _ in range(message.get("I")):
        _, parent = message.header()
        name = message.string()
        t, (x, y, z, w) = message.many("d", 3), message.many("d", 4)
        check(parent == "world", "parent")
        R = quaternion_matrix(w, x, y, z).T
        placed[name] = (R, -R @ t)
    return placed


def read_lens(message):
    _, frame = message.header()
    height, width, model = message.get("I"), message.get("I"), message.string()
    d, K = message.many("d", message.get("I")), message.many("d", 9).reshape(3, 3)
    R, P = message.many("d", 9).reshape(3, 3), message.many("d", 12).reshape(3, 4)
    check(model == "plumb_bob" and not d.any() and np.array_equal(R, np.eye(3)), "lens")
    check(np.array_equal(P[:, :3], K) and not P[:, 3].any(), "projection matrix")
    return frame, K, d, (width, height)


def read_points(message):
    _, frame = message.header()
    height, width = message.get("I"), message.get("I")
    fields = [(message.string(), message.get("I"), message.get("B"), message.get("I")) for _ in range(message.get("I"))]
    check(frame == "world" and height == 1 and fields == [("x", 0, 7, 1), ("y", 4, 7, 1), ("z", 8, 7, 1)], "fields")
    check(message.get("B") == 0 and message.get("I") == 12 and message.get("I") == 12 * width, "steps")
    points = np.frombuffer(message.bytes(message.get("I")), "<f4").reshape(width, 3)
    check(message.get("B") == 1 and message.at == len(message.data), "end")
    return points


def read_mcap(folder, compare):
    path, = glob.glob(folder + "/*.mcap")
    placed, lenses, num_images = {}, {}, 0
    rate, frames = compare.manifest["frame_rate_hz"], compare.manifest["frames"]
    for topic, schema, time, data in read_file(path):
        message, frame = Cdr(data), round(time * rate / 1e9)
        check(frame in frames, "time of a frame")
        if schema == "tf2_msgs/msg/TFMessage":
            placed = read_transforms(message)
        elif schema == "sensor_msgs/msg/CameraInfo":
            name, K, d, size = read_lens(message)
            check(topic == f"/{name}/camera_info", "topic of a lens")
            lenses[name] = (K, d, size)
        elif schema == "sensor_msgs/msg/CompressedImage":
            _, name = message.header()
            form, image = message.string(), message.bytes(message.get("I"))
            check(topic == f"/{name}/image" and image[:2] == {"jpeg": b"\xff\xd8", "png": b"\x89P"}[form], "image")
            num_images += 1
        else:
            person = int(topic.split("/")[1].split("_")[1])
            truth = compare.dataset.frames[frame][person][0]
            points, X = read_points(message), np.full((19, 3), np.nan)
            if len(points) == len(BODY25):  # the dataset's own joints, all there
                X[:] = points[[BODY25.index(joint) for joint in JOINTS]]
            else:
                X[~np.isnan(truth[:, 0])] = points
            compare.joint_set(frame, person, X)
    for name, (K, d, _) in lenses.items():
        compare.camera(name, Camera(K, d, *placed[name]), frames)
    check(num_images == compare.manifest["pictures"], "number of images")
    return {"images": num_images}
