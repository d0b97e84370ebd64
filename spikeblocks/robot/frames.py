"""Frames: one value of a topic as bytes, for UDP and serial lines; their C header.

All numbers are little-endian::

    offset  bytes  what
         0      4  the letters SBR1
         4      4  the topic: CRC-32 of its name, as in /scan
         8      4  the sender: any number that it chooses when it starts
        12      4  how many frames the sender has sent of this topic, from 1
        16      8  the time by the sender's clock, in ns, a signed integer
        24      4  n, how many numbers follow
        28      4  CRC-32 of the bytes before and of the numbers
        32    8 n  the numbers of the value, IEEE 754 doubles, in the order of its components

A frame is a datagram on UDP. On a serial line it is encoded by COBS (consistent overhead byte
stuffing, Cheshire and Baker 1999), after which it has no zero byte, and a zero byte ends it.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterable

import numpy as np

from blocks.core import FloatArray
from spikeblocks.robot.messages import UnfitMessageError, check
from spikeblocks.robot.ports import Ports, Topic
from spikeblocks.robot.safety import Arrival

MAGIC = b"SBR1"
HEAD = struct.Struct("<4sIIIqI")
CHECKSUM = struct.Struct("<I")
START = HEAD.size + CHECKSUM.size  # of the numbers
MOST = 65_507  # the bytes of a datagram


def topic_number(name: str) -> int:
    """The number that stands for a topic in frames."""
    return zlib.crc32(name.encode())


def pack(topic: str, values: FloatArray, arrival: Arrival) -> bytes:
    """A frame."""
    numbers = np.ravel(values).astype("<f8").tobytes()
    fields = (topic_number(topic), arrival.sender, arrival.sequence & 0xFFFFFFFF)
    head = HEAD.pack(MAGIC, *fields, arrival.stamp, len(numbers) // 8)
    return head + CHECKSUM.pack(zlib.crc32(numbers, zlib.crc32(head))) + numbers


def unpack(frame: bytes, topics: dict[int, Topic]) -> tuple[Topic, Arrival, FloatArray]:
    """The topic, the arrival and the values of a frame.

    Raises
    ------
    UnfitMessageError : it is damaged, of another topic, or holds no value of the topic's signal.
    """
    if len(frame) < START or frame[:4] != MAGIC:
        raise UnfitMessageError(f"{len(frame)} bytes that are no frame")
    _, number, sender, sequence, stamp, count = HEAD.unpack_from(frame)
    numbers = frame[START:]
    if len(numbers) != 8 * count:
        raise UnfitMessageError(f"a frame of {count} numbers with {len(numbers)} bytes of them")
    (checksum,) = CHECKSUM.unpack_from(frame, HEAD.size)
    if checksum != zlib.crc32(numbers, zlib.crc32(frame[: HEAD.size])):
        raise UnfitMessageError("a frame with a wrong checksum")
    topic = topics.get(number)
    if topic is None:
        raise UnfitMessageError(f"a frame of another topic (0x{number:08X})")
    values = np.frombuffer(numbers, dtype="<f8").astype(np.float64)
    return topic, Arrival(stamp, sender, sequence), check(values, topic.codec.signal)


def stuff(data: bytes) -> bytes:
    """Bytes encoded by COBS, with the zero byte at the end."""
    out = bytearray()
    for group in data.split(b"\0"):
        while len(group) >= 254:
            out += b"\xff" + group[:254]
            group = group[254:]
        out += bytes([len(group) + 1]) + group
    return bytes(out) + b"\0"


def unstuff(data: bytes) -> bytes:
    """What COBS has encoded, from what stands before a zero byte.

    Raises
    ------
    UnfitMessageError : it is cut.
    """
    out, at = bytearray(), 0
    while at < len(data):
        code = data[at]
        group = data[at + 1 : at + code]
        if len(group) != code - 1:
            raise UnfitMessageError("a frame that is cut")
        out += group
        at += code
        if code < 255 and at < len(data):
            out.append(0)
    return bytes(out)


def c_header(ports: Ports) -> str:
    """A C header for the other side: the numbers of the topics, and functions on frames."""
    topics = [*ports.inputs.values(), *ports.outputs.values()]
    topics += [] if ports.dead_man is None else [ports.dead_man]
    lines = "\n".join(_constants(topics))
    return _HEADER.replace("@TOPICS@", lines)


def _constants(topics: Iterable[Topic]) -> Iterable[str]:
    for topic in topics:
        name = re.sub(r"\W", "_", topic.name.strip("/")).upper()
        yield f"/* {topic.name}: {', '.join(topic.codec.signal.names[:8]) or 'a number'} */"
        yield f"#define ROBOT_{name}_TOPIC 0x{topic_number(topic.name):08X}u"
        yield f"#define ROBOT_{name}_COUNT {topic.size}"


_HEADER = """\
/* Frames of topics, made by 'runtime drive --header'. C99, no allocation. The layout:
   0 "SBR1", 4 topic, 8 sender, 12 sequence, 16 stamp (ns), 24 count, 28 CRC-32, 32 doubles;
   little-endian, on a machine whose doubles are IEEE 754 in the order of its integers. */
#ifndef ROBOT_FRAMES_H
#define ROBOT_FRAMES_H
#include <stddef.h>
#include <stdint.h>
#include <string.h>

@TOPICS@
#define ROBOT_FRAME_SIZE(count) (32u + 8u * (size_t)(count))

typedef struct {
    uint32_t topic, sender, sequence, count;
    int64_t stamp;
} robot_frame;

static inline uint32_t robot_crc(uint32_t crc, const uint8_t *data, size_t size) {
    crc = ~crc;
    for (size_t i = 0; i < size; ++i) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; ++bit)
            crc = (crc >> 1) ^ (0xEDB88320u & (0u - (crc & 1u)));
    }
    return ~crc;
}

static inline void robot_put(uint8_t *at, uint64_t value, int bytes) {
    for (int i = 0; i < bytes; ++i)
        at[i] = (uint8_t)(value >> (8 * i));
}

static inline uint64_t robot_get(const uint8_t *at, int bytes) {
    uint64_t value = 0;
    for (int i = 0; i < bytes; ++i)
        value |= (uint64_t)at[i] << (8 * i);
    return value;
}

/* Write a frame into a buffer of ROBOT_FRAME_SIZE(frame->count) bytes; returns their number. */
static inline size_t robot_pack(uint8_t *to, const robot_frame *frame, const double *values) {
    memcpy(to, "SBR1", 4);
    robot_put(to + 4, frame->topic, 4);
    robot_put(to + 8, frame->sender, 4);
    robot_put(to + 12, frame->sequence, 4);
    robot_put(to + 16, (uint64_t)frame->stamp, 8);
    robot_put(to + 24, frame->count, 4);
    for (uint32_t i = 0; i < frame->count; ++i) {
        uint64_t word;
        memcpy(&word, values + i, 8);
        robot_put(to + 32 + 8 * (size_t)i, word, 8);
    }
    uint32_t crc = robot_crc(0, to, 28);
    robot_put(to + 28, robot_crc(crc, to + 32, 8 * (size_t)frame->count), 4);
    return ROBOT_FRAME_SIZE(frame->count);
}

/* Read a frame of at most `most` values; 1 if it is one, 0 if it is damaged or longer. */
static inline int robot_unpack(const uint8_t *from, size_t size, robot_frame *frame,
                               double *values, uint32_t most) {
    if (size < 32 || memcmp(from, "SBR1", 4) != 0)
        return 0;
    frame->topic = (uint32_t)robot_get(from + 4, 4);
    frame->sender = (uint32_t)robot_get(from + 8, 4);
    frame->sequence = (uint32_t)robot_get(from + 12, 4);
    frame->stamp = (int64_t)robot_get(from + 16, 8);
    frame->count = (uint32_t)robot_get(from + 24, 4);
    if (frame->count > most || size != ROBOT_FRAME_SIZE(frame->count))
        return 0;
    uint32_t crc = robot_crc(0, from, 28);
    if (robot_crc(crc, from + 32, 8 * (size_t)frame->count) != (uint32_t)robot_get(from + 28, 4))
        return 0;
    for (uint32_t i = 0; i < frame->count; ++i) {
        uint64_t word = robot_get(from + 32 + 8 * (size_t)i, 8);
        memcpy(values + i, &word, 8);
    }
    return 1;
}
#endif
"""
