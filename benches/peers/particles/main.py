"""particles: its bootstrap filter."""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))

import numpy
import particles
from particles import distributions, state_space_models

import common

TRANSITION = numpy.eye(4) + numpy.eye(4, k=2)


class Bearing(distributions.ProbDist):
    """The distribution of a bearing, given many states."""

    def __init__(self, bearings, receiver, states):
        self.bearings, self.receiver, self.states = bearings, receiver, states

    def logpdf(self, z):
        x, y = self.states[:, 0], self.states[:, 1]
        return numpy.log(self.bearings.likelihood(x, y, self.receiver, z))


class Problem(state_space_models.StateSpaceModel):
    def PX0(self):
        # It takes in the first bearing before it moves.
        noise = numpy.eye(4) * self.bearings.noise**2
        spread = numpy.diag(self.bearings.spread**2)
        return distributions.MvNormal(loc=TRANSITION @ self.bearings.prior,
                                      cov=TRANSITION @ spread @ TRANSITION.T + noise)

    def PX(self, t, xp):
        return distributions.MvNormal(loc=xp @ TRANSITION.T, scale=self.bearings.noise,
                                      cov=numpy.eye(4))

    def PY(self, t, xp, x):
        receiver = self.bearings.sequence[t % len(self.bearings.sequence)][0]
        return Bearing(self.bearings, receiver, x)


class Endless:
    """The bearings in their order, again and again."""

    def __init__(self, bearings):
        self.bearings = bearings

    def __len__(self):
        return 10**9

    def __getitem__(self, t):
        return self.bearings.sequence[t % len(self.bearings.sequence)][1]


class Filter:
    def __init__(self, bearings, count, seed, resampling, threshold):
        numpy.random.seed(seed)
        model = state_space_models.Bootstrap(ssm=Problem(bearings=bearings), data=Endless(bearings))
        self.filter = particles.SMC(fk=model, N=count, resampling=resampling, ESSrmin=threshold,
                                    collect="off")

    def step(self, receiver, z):
        next(self.filter)
        moments = particles.resampling.wmean_and_cov(self.filter.W, self.filter.X)
        return moments[0]


common.cloud({
    "multinomial": lambda *given: Filter(*given, "multinomial", 1.0),
    "systematic": lambda *given: Filter(*given, "systematic", 0.5),
})
