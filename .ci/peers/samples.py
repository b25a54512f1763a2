"""What others find in the samples of an emulated receiver, held against what it has played."""

import csv
import re
import sys

import numpy as np

FULL_SCALE_DBM = -28.0


def rows(path, tag=None):
    with open(path, newline="") as file:
        return [row for row in csv.DictReader(file) if tag is None or row["tag"] == tag]


def packages(path):
    """Pulses of rtl_433's analyser: start, width in ms, level in dB of full scale, offset in Hz."""
    text = open(path).read()
    found = []
    for part in re.split(r"Detected OOK package\s*", text)[1:]:
        count = int(re.search(r"Total count:\s*(\d+)", part)[1])
        if count != 1:
            sys.exit(f"a package of {count} pulses: {part[:300]}")
        start = re.match(r"@([\d.]+)s", part)
        found.append(
            (
                float(start[1]) if start else None,
                float(re.search(r"width:\s*([\d.]+) ms", part)[1]),
                float(re.search(r"RSSI:\s*([-\d.]+) dB", part)[1]),
                1e3 * float(re.search(r"Frequency offsets.*?\(([-+\d.]+) kHz", part)[1]),
            )
        )
    return found


def check_shape(width_ms, level_dbfs, offset_hz, pulse):
    assert abs(width_ms - 1e3 * float(pulse["width_s"])) < 0.3, (width_ms, pulse)
    level_dbm = level_dbfs + FULL_SCALE_DBM
    assert abs(level_dbm - float(pulse["power_dbm"])) < 1.0, (level_dbm, pulse)
    # Its FM demodulator averages over the ends as well, and is good for a guess.
    assert abs(offset_hz + 150.08e6 - float(pulse["frequency_hz"])) < 8e3, (offset_hz, pulse)


def judge_file(text, truth):
    found, played = packages(text), rows(truth, "strong")
    assert len(found) == len(played) >= 14, (len(found), len(played))
    worst = 0.0
    for (start, *shape), pulse in zip(found, played):
        begin = float(pulse["time_s"]) - float(pulse["width_s"]) / 2
        worst = max(worst, abs(start - begin))
        check_shape(*shape, pulse)
    assert worst < 1e-3, f"{worst} s apart"
    print(f"{len(found)} pulses, begun within {1e3 * worst:.2f} ms")


def judge_live(text, truth):
    found, played = packages(text), rows(truth, "strong")
    # A busy computer plays fewer in that time, and the server goes on when the client has left.
    assert 5 <= len(found) <= len(played), (len(found), len(played))
    for _, *shape in found[1:-1]:
        nearest = min(played, key=lambda p: abs(float(p["power_dbm"]) - FULL_SCALE_DBM - shape[1]))
        check_shape(*shape, nearest)
    print(f"{len(found)} pulses through rtl_tcp")


def spectrogram_peaks(samples, rate, center):
    """Peaks of a spectrogram of Hann windows over its running median: no code of ours, and another
    design: windows of twice a pulse's length, no matched filter, no channels."""
    size, hop = 2 * int(0.02 * rate), int(0.005 * rate)
    window = np.hanning(size)
    frames = range(0, len(samples) - size, hop)
    power = np.empty((len(frames), size), dtype=np.float32)
    for i, at in enumerate(frames):
        power[i] = np.abs(np.fft.fftshift(np.fft.fft(samples[at : at + size] * window))) ** 2
    # A carrier is in the median over time of its bin, and no pulse is.
    noise = np.median(power, axis=0) / np.log(2)
    ratio = power / noise
    peaks = []
    for i, k in np.argwhere(ratio > 25):
        near = ratio[max(i - 8, 0) : i + 9, max(k - 32, 0) : k + 33]
        if ratio[i, k] < near.max():
            continue
        # The middle of the power over time in this bin, the rest of noise taken off.
        at = np.arange(max(i - 10, 0), min(i + 11, len(power)))
        weight = np.clip(power[at, k] - 4 * noise[k], 0, None)
        time = (np.sum(weight * at) / np.sum(weight) * hop + size / 2) / rate
        a, b, c = np.log(power[i, k - 1 : k + 2].astype(float))
        bin = k + 0.5 * (a - c) / (a - 2 * b + c)
        peaks.append((time, (bin - size // 2) * rate / size + center, 10 * np.log10(ratio[i, k])))
    return sorted(peaks)


def match(name, found, played, time_s, frequency_hz):
    """Every pulse played is found once, and nothing else is found."""
    left = list(found)
    for pulse in played:
        time, hz = float(pulse["time_s"]), float(pulse["frequency_hz"])
        near = [f for f in left if abs(f[0] - time) < time_s and abs(f[1] - hz) < frequency_hz]
        assert len(near) == 1, f"{name}: {len(near)} found of {pulse}"
        left.remove(near[0])
    assert not left, f"{name}: more than was played: {left[:3]}"


def judge_detect(base, truth, ours):
    raw = np.fromfile(f"{base}.sigmf-data", dtype=np.uint8).astype(np.float32)
    samples = ((raw[0::2] - 127.5) + 1j * (raw[1::2] - 127.5)) / 127.5
    played = rows(truth)
    whole = [p for p in played if 0.05 < float(p["time_s"]) < 19.95]
    found = spectrogram_peaks(samples, 250e3, 150.08e6)
    match("NumPy", [f for f in found if 0.05 < f[0] < 19.95], whole, 5e-3, 25.0)
    ours = [(float(r["time_s"]), float(r["frequency_hz"])) for r in rows(ours)]
    match("foxhunt", [f for f in ours if 0.05 < f[0] < 19.95], whole, 2e-3, 15.0)
    weakest = min(float(p["snr_db"]) for p in whole)
    print(f"{len(whole)} pulses of three tags, the weakest with {weakest:.1f} dB")


if __name__ == "__main__":
    {"file": judge_file, "live": judge_live, "detect": judge_detect}[sys.argv[1]](*sys.argv[2:])
