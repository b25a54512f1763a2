"""What every peer in Python reads, and how it is measured: as common/src/lib.rs does it.

python PEER/main.py PROBLEM FILE REPEATS PARTICLES: with no repeats the answer is printed, else the
nanoseconds of a step, the least of ten parts.
"""

import itertools
import json
import math
import sys
import time

import numpy

PARTS = 10
SEEDS, PARTICLES, STEPS = 40, 1000, 20


def lines(file):
    with open(file) as text:
        return [[float(word) for word in line.split()] for line in text]


class Beacon:
    """A still beacon, measured by level and bearing."""

    def __init__(self, file):
        first, *sweep = lines(file)
        (self.variance, self.drift, self.reference_dbm, self.exponent, level, bearing,
         self.alpha) = first
        self.p = numpy.eye(2) * self.variance
        self.q = numpy.eye(2) * self.drift**2
        self.r = numpy.diag([level**2, bearing**2])
        self.sweep = [(numpy.array(line[:3]), numpy.array(line[3:])) for line in sweep]

    def expected(self, x, y, receiver):
        x, y = x - receiver[0], y - receiver[1]
        distance = math.sqrt(x * x + y * y + receiver[2] ** 2)
        level = self.reference_dbm - 10 * self.exponent * math.log10(distance)
        return numpy.array([level, math.atan2(y, x)])

    def jacobian(self, x, y, receiver):
        x, y = x - receiver[0], y - receiver[1]
        flat = x * x + y * y
        slope = -10 * self.exponent / math.log(10) / (flat + receiver[2] ** 2)
        return numpy.array([[slope * x, slope * y], [-y / flat, x / flat]])


class Bearings:
    """A target of constant velocity, measured by bearings with outliers."""

    def __init__(self, file):
        first, *sequence = lines(file)
        self.prior, self.spread = numpy.array(first[:4]), numpy.array(first[4:8])
        self.noise, self.bias, self.sigma, self.share = first[8:]
        self.sequence = [(numpy.array(line[:2]), line[2]) for line in sequence]

    def likelihood(self, x, y, receiver, z):
        """The densities of a bearing of targets here."""
        off = z - numpy.arctan2(y - receiver[1], x - receiver[0]) - self.bias
        off = (off - math.tau * numpy.round(off / math.tau)) / self.sigma
        peak = (1 - self.share) / (self.sigma * math.sqrt(math.tau))
        return peak * numpy.exp(-0.5 * off * off) + self.share / math.tau


def measured(repeats, steps, work):
    least = math.inf
    for _ in range(PARTS):
        start = time.process_time_ns()
        for _ in range(repeats):
            work()
        least = min(least, time.process_time_ns() - start)
    print(json.dumps({"ns": least / (repeats * steps)}))


def kalman(filters):
    """filters[problem](beacon) has step(receiver, z), and belief(): mean and covariance."""
    problem, file, repeats, _ = sys.argv[1:]
    beacon = Beacon(file)
    filter = filters[problem](beacon)

    def sweep():
        for receiver, z in beacon.sweep:
            filter.step(receiver, z)

    if repeats == "0":
        sweep()
        mean, covariance = (numpy.asarray(part, float).ravel() for part in filter.belief())
        print(json.dumps({"mean": mean.tolist(), "covariance": covariance.tolist()}))
    else:
        measured(int(repeats), len(beacon.sweep), sweep)


def cloud(filters):
    """filters[problem](bearings, particles, seed) has step(receiver, z), which returns the mean,
    and takes the covariance as well."""
    problem, file, repeats, particles = sys.argv[1:]
    bearings = Bearings(file)
    if repeats == "0":
        means = []
        for seed in range(1, SEEDS + 1):
            filter = filters[problem](bearings, PARTICLES, seed)
            for receiver, z in bearings.sequence[:STEPS]:
                mean = filter.step(receiver, z)
            means.append(mean.tolist())
        print(json.dumps({"means": means}))
        return
    filter = filters[problem](bearings, int(particles), 1)
    sequence = itertools.cycle(bearings.sequence)
    measured(int(repeats), int(particles), lambda: filter.step(*next(sequence)))
